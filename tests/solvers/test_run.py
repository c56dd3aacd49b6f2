"""The judge of every run: what a solver says of itself does not count."""

from tests.solvers.problems import decay
from workbench import GaussNewton, Status
from workbench.solvers.limits import Stop
from workbench.solvers.run import Run


def test_a_solver_that_only_says_it_converged_has_not() -> None:
    problem, start = decay()
    with Run("boastful", GaussNewton(), problem, start, None) as run:
        run.linearize(run.x)
        raise Stop(Status.CONVERGED)
    solution = run.solution()
    assert solution.optimality > 1e-3
    assert solution.status is Status.STALLED
    assert solution.message == Status.STALLED.value


def test_a_solver_that_gave_up_where_nothing_is_left_has_converged() -> None:
    problem, start = decay()
    minimum = GaussNewton().solve(problem, start).values
    with Run("modest", GaussNewton(), problem, start | minimum, None) as run:
        run.linearize(run.x)
        run.stall()
    assert run.solution().status is Status.CONVERGED


def test_nothing_evaluated_leaves_the_start() -> None:
    problem, start = decay()
    with Run("idle", GaussNewton(max_evaluations=0), problem, start, None) as run:
        run.linearize(run.x)
    solution = run.solution()
    assert solution.status is Status.MAX_EVALUATIONS
    assert solution.cost == float("inf")
    assert (solution.values["x"] == start["x"]).all()
