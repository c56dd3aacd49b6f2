"""Several starts: minima as hypotheses, and how sure it is that there are no more; stages."""

import signal
from contextlib import suppress
from dataclasses import replace
from math import lgamma
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.solvers.problems import body_fit, rosenbrock
from workbench import (
    SOLVERS,
    Block,
    LevenbergMarquardt,
    Problem,
    Residual,
    Spread,
    Staged,
    Starts,
    Status,
    Values,
)
from workbench.errors import BadArgument, UnknownName
from workbench.processes import FORKING
from workbench.solvers import DEFAULT, Iterate, Solution, SolveStage, within_bounds
from workbench.solvers.starts import all_seen, further_minima

OMEGA = 4.0
TWENTY = Starts(20, draw=Spread({"omega": 4.0}))
COPIES = pytest.mark.skipif(not FORKING, reason="this system cannot copy processes")
ALONE_AND_COPIED = pytest.mark.parametrize(
    "workers", [1, pytest.param(2, marks=(COPIES, pytest.mark.thorough))]
)


def waves(bounded: bool = False) -> tuple[wb.Problem, wb.Values]:
    """sin(omega t) as it was seen for omega = 4: many minima in omega."""
    omega, times = wb.Block("omega", (), "rad/s"), np.linspace(0, 3, 40)
    r = wb.Residual("wave", cs.sin(omega.symbol * times) - np.sin(OMEGA * times), sigma=0.1)
    bounds = {"omega": (0.5, 20.0)} if bounded else None
    return wb.Problem([r], ["omega"], bounds, [omega]), {"omega": np.array(9.0)}


def runs_of(solution: Solution) -> int:
    return sum(len(one.starts) for one in solution.hypotheses)


def test_starts_end_at_the_lowest_of_their_minima(tmp_path: Path) -> None:
    problem, start = waves()
    solution = TWENTY.solve(problem, start)
    assert solution.converged
    assert abs(solution.values["omega"]) == pytest.approx(OMEGA)
    costs = [one.cost for one in solution.hypotheses]
    assert costs == sorted(costs)
    assert costs[0] == solution.cost
    assert len(costs) > 2
    assert sorted(k for one in solution.hypotheses for k in one.starts) == list(range(20))
    assert solution.cost < LevenbergMarquardt().solve(problem, start).cost
    for one in solution.hypotheses:
        here = problem.linearize({**start, **one.values})
        assert here.cost == pytest.approx(one.cost, rel=1e-9, abs=1e-20)
        assert problem.optimality(problem.free.pack(one.values), here) <= 1e-6
    sure = all_seen(20, len(costs))
    assert 0 < sure < 1
    assert solution.message.endswith(
        f"others to {len(costs) - 1} other ends; "
        f"the probability that there are no further minima is {sure:.2g}"
    )
    solution.save(tmp_path / "run.npz")
    again = Solution.load(tmp_path / "run.npz")
    for one, other in zip(again.hypotheses, solution.hypotheses, strict=True):
        assert (one.cost, one.status, one.starts) == (other.cost, other.status, other.starts)
        np.testing.assert_array_equal(one.values["omega"], other.values["omega"])


def test_minima_are_told_apart_by_residuals_and_not_by_unknowns() -> None:
    """Residuals of omega^2 cannot tell omega from -omega: that is one minimum."""
    omega = wb.Block("omega", (), "rad/s")
    r = wb.Residual("square", omega.symbol**2 - 4.0, sigma=1.0)
    problem = wb.Problem([r], ["omega"], blocks=[omega])
    starts = [{"omega": np.array(x)} for x in (-3.0, 3.0, 1.0)]
    solution = Starts(starts).solve(problem, starts[0])
    assert [sorted(one.starts) for one in solution.hypotheses] == [[0, 1, 2]]
    assert "3 of 3 starts led here, and none elsewhere" in solution.message


def test_start_k_depends_on_the_seed_and_k_alone() -> None:
    problem, start = waves()
    few, many = (replace(TWENTY, starts=n).drawn(problem, start) for n in (3, 6))
    assert [one["omega"] for one in few] == [one["omega"] for one in many[:3]]
    assert few[0]["omega"] == start["omega"]
    other = replace(TWENTY, seed=1).drawn(problem, start)
    assert other[1]["omega"] != many[1]["omega"]


@COPIES
def test_copies_of_the_process_give_the_same_minima() -> None:
    problem, start = waves()
    seen: list[Iterate] = []
    alone = TWENTY.solve(problem, start)
    together = replace(TWENTY, workers=3).solve(problem, start, callback=seen.append)
    assert together.values["omega"] == alone.values["omega"]
    assert [one.starts for one in together.hypotheses] == [one.starts for one in alone.hypotheses]
    assert together.evaluations == alone.evaluations
    assert together.message == alone.message
    assert len(seen) >= 20 + together.iterations


@ALONE_AND_COPIED
def test_starts_stop_when_the_callback_returns_true_and_only_then(workers: int) -> None:
    """As with a single run: a callback may return anything, such as the length of a list."""
    few, seen = replace(TWENTY, starts=3, workers=workers), []
    went_on = few.solve(*waves(), callback=lambda one: seen.append(one) or len(seen))
    assert went_on.converged
    assert runs_of(went_on) == 3
    for true in (True, np.True_):
        stopped = few.solve(*waves(), callback=lambda _, true=true: true)
        assert stopped.status is Status.STOPPED
        assert runs_of(stopped) == 1
        assert stopped.message.startswith("stopped by the callback; ")
        assert "1 of 1 starts led here" in stopped.message


@ALONE_AND_COPIED
def test_starts_stop_when_ctrl_c_is_pressed(workers: int) -> None:
    iterates = []

    def press(iterate: Iterate) -> bool:
        """Press Ctrl-C, as the callback returns True, in the second run."""
        iterates.append(iterate)
        if sum(one.evaluations.residual == 0 for one in iterates) < 2:
            return False
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        return True

    solution = replace(TWENTY, workers=workers).solve(*waves(), callback=press)
    assert solution.status is Status.STOPPED
    assert solution.message.startswith("interrupted from the keyboard; ")
    assert "callback" not in solution.message
    assert runs_of(solution) == 2


def test_starts_are_drawn_between_bounds() -> None:
    problem, start = waves(bounded=True)
    values = [float(one["omega"]) for one in Starts(40).drawn(problem, start)[1:]]
    assert 0.5 <= min(values) < 4 < 15 < max(values) <= 20.0
    assert Starts(20).solve(problem, start).values["omega"] == pytest.approx(OMEGA)
    with pytest.raises(BadArgument, match=r"but omega has not both; bound them, or draw by Spread"):
        within_bounds(*waves(), np.random.default_rng(0))


def test_starts_refuse_numbers_below_one_and_unknown_blocks() -> None:
    problem, start = waves()
    for wrong in (0, []):
        with pytest.raises(BadArgument, match="`starts` must be 1 or more, not 0"):
            Starts(wrong)
    with pytest.raises(BadArgument, match="`workers` must be 1 or more, not 0"):
        Starts(2, workers=0)
    with pytest.raises(UnknownName, match="omeg"):
        Starts(3, draw=Spread({"omeg": 1.0})).solve(problem, start)


@pytest.mark.parametrize(("n", "w"), [(10, 2), (20, 5), (30, 1)])
def test_probability_of_no_further_minima_is_the_posterior(n: int, w: int) -> None:
    """Summed over every number k of minima, with Dirichlet(1) shares of the starts."""
    k = np.arange(w, 400_000)
    log = np.array([lgamma(i + 1) - lgamma(i - w + 1) + lgamma(i) - lgamma(n + i) for i in k])
    weights = np.exp(log - log.max())
    assert all_seen(n, w) == pytest.approx(weights[0] / weights.sum(), rel=1e-3)


def test_too_few_starts_say_nothing_of_further_minima() -> None:
    assert np.isnan(all_seen(3, 2))
    assert further_minima(3, 2).startswith("these are too few starts to say whether")


def test_starts_and_stages_go_on_beyond_a_saddle() -> None:
    """(x^2 - 1)^2 + y^2 from the ridge between its two minima."""
    x = Block("x", (2,)).symbol
    problem = Problem((Residual("ridge", cs.vertcat(x[0] ** 2 - 1, x[1]), 1.0),), ("x",))
    start: Values = {"x": np.array([0.0, 1.0])}
    alone = LevenbergMarquardt().solve(problem, start)
    assert alone.status is Status.SADDLE
    for solver in (Starts(1), Starts([start], workers=2), Staged((("x",),))):
        seen: list[Iterate] = []
        solution = solver.solve(problem, start, callback=seen.append)
        assert solution.converged
        np.testing.assert_allclose(np.abs(solution.values["x"]), [1, 0], atol=1e-6)
        assert solution.evaluations.total > alone.evaluations.total
        assert solution.trace[-1].cost < 1e-12 < alone.cost
        counts = [iterate.evaluations.total for iterate in seen]
        assert counts == sorted(counts)
    stopped = Starts(1).solve(problem, start, callback=lambda iterate: iterate.cost < 0.5)
    assert stopped.status is Status.STOPPED
    assert stopped.cost < 0.5


# Stages: a few blocks first, then more.


STAGES = (("trans",), ("trans", "pose"))


def test_stages_and_several_starts_are_solved_by_the_default_solver() -> None:
    assert Staged(STAGES).solver == Starts(2).solver == SOLVERS[DEFAULT]


@pytest.mark.parametrize("name", ["levenberg-marquardt", "nlopt-lbfgs"])
def test_stages_end_where_all_blocks_at_once_end(name: str) -> None:
    problem, start = body_fit()
    solution = Staged(STAGES, SOLVERS[name]).solve(problem, start)
    whole = SOLVERS[name].solve(problem, start)
    assert solution.status is Status.CONVERGED
    assert solution.solver == f"staged {whole.solver}"
    assert solution.values.keys() == whole.values.keys()
    assert solution.cost == pytest.approx(whole.cost, rel=1e-9)
    for several in (Staged(STAGES, SOLVERS[name]), Starts(2, SOLVERS[name])):
        assert several.abilities == SOLVERS[name].abilities


def test_every_stage_moves_its_blocks_only() -> None:
    problem, start = body_fit()
    seen: list[Iterate] = []
    solution = Staged(STAGES).solve(problem, start, callback=seen.append)
    assert [i.cost for i in seen] == [i.cost for i in solution.trace]
    moved = [not np.array_equal(i.values["pose"], start["pose"]) for i in seen]
    first = moved.index(True)
    assert first >= 2  # the start and a step of the first stage, at least
    for iterate in seen[:first]:
        np.testing.assert_array_equal(iterate.values["betas"], start["betas"])
    assert not np.array_equal(seen[first - 1].values["trans"], start["trans"])
    costs = [i.cost for i in seen]
    assert (np.diff(costs) <= 1e-9 * np.array(costs[:-1])).all()
    evaluations, seconds = [i.evaluations.total for i in seen], [i.seconds for i in seen]
    assert (evaluations, seconds) == (sorted(evaluations), sorted(seconds))
    assert solution.evaluations.total >= evaluations[-1]


def test_the_trace_of_stages_over_starts_is_that_of_the_best_start() -> None:
    problem, start = rosenbrock()
    several = Starts(4, draw=Spread({"x": 3.0}), seed=1)
    alone, staged = several.solve(problem, start), Staged((), several).solve(problem, start)
    assert [i.cost for i in staged.trace] == [i.cost for i in alone.trace]
    assert staged.stages == (alone.iterations,)


def test_a_stage_that_is_stopped_is_the_last() -> None:
    problem, start = body_fit()
    solution = Staged(STAGES).solve(problem, start, callback=lambda _: True)
    assert solution.status is Status.STOPPED
    assert len(solution.trace) == 1
    assert solution.values.keys() == {"pose", "betas", "trans"}


@pytest.mark.parametrize("wrong", [wb.TrustRegion, "ipopt", 1])
def test_a_solver_is_an_object(wrong: Any) -> None:
    problem, start = rosenbrock()
    for use in (
        lambda: Starts(2, wrong),
        lambda: Staged((), wrong),
        lambda: SolveStage(solver=wrong),
        lambda: wb.solve(problem, start, wrong if wrong != "ipopt" else int),
    ):
        with pytest.raises(BadArgument, match=r"is an object, such as TrustRegion\(\), not "):
            use()


def test_stages_are_tuples_of_names() -> None:
    with pytest.raises(BadArgument, match="a stage is a tuple of names of blocks"):
        Staged(("trans", "pose"))  # type: ignore[arg-type]
    with pytest.raises(BadArgument, match=r"not \(\)"):
        Staged(((),))
    with pytest.raises(BadArgument, match=r"not \('trans', 1\)"):
        Staged((("trans", 1),))  # type: ignore[arg-type]
    with pytest.raises(UnknownName, match="no free block is called 'poze'; there are"):
        Staged((("poze",),)).solve(*body_fit())
