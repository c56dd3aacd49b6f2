"""A few blocks first, then more."""

import numpy as np
import pytest

from tests.solvers.problems import body_fit, decay
from workbench import SOLVERS, LevenbergMarquardt, Staged, Status
from workbench.errors import BadArgument, UnknownName
from workbench.solvers import Iterate

STAGES = (("trans",), ("trans", "pose"))


def test_it_ends_where_all_blocks_at_once_end() -> None:
    problem, start = body_fit()
    solution = Staged(STAGES).solve(problem, start)
    whole = LevenbergMarquardt().solve(problem, start)
    assert solution.status is Status.CONVERGED
    assert solution.solver == "staged levenberg-marquardt"
    assert solution.values.keys() == whole.values.keys()
    assert solution.cost == pytest.approx(whole.cost, rel=1e-9)


def test_every_stage_moves_its_blocks_only() -> None:
    problem, start = body_fit()
    seen: list[Iterate] = []
    solution = Staged(STAGES).solve(problem, start, callback=seen.append)
    assert seen == list(solution.trace)
    poses = [i.values["pose"] for i in seen]
    moved = [not np.array_equal(pose, start["pose"]) for pose in poses]
    first = moved.index(True)
    assert first >= 2  # the start and a step of the first stage, at least
    for iterate in seen[:first]:
        np.testing.assert_array_equal(iterate.values["betas"], start["betas"])
    assert not np.array_equal(seen[first - 1].values["trans"], start["trans"])
    costs = [i.cost for i in seen]
    assert (np.diff(costs) <= 1e-9 * np.array(costs[:-1])).all()
    evaluations = [i.evaluations.total for i in seen]
    assert evaluations == sorted(evaluations)
    seconds = [i.seconds for i in seen]
    assert seconds == sorted(seconds)
    assert solution.evaluations.total >= evaluations[-1]


def test_a_stage_that_is_stopped_is_the_last() -> None:
    problem, start = body_fit()
    solution = Staged(STAGES).solve(problem, start, callback=lambda _: True)
    assert solution.status is Status.STOPPED
    assert len(solution.trace) == 1
    assert solution.values.keys() == {"pose", "betas", "trans"}


def test_any_solver_will_do() -> None:
    problem, start = body_fit()
    solution = Staged(STAGES, SOLVERS["nlopt-lbfgs"]).solve(problem, start)
    assert solution.converged
    assert Staged(STAGES, SOLVERS["ipopt"]).abilities == SOLVERS["ipopt"].abilities


def test_bounds_hold_in_every_stage() -> None:
    problem, start = decay(bounds={"x": ([0.0, 0.0, 0.55], [1.9, 5.0, 5.0])})
    solution = Staged((("x",),)).solve(problem, start)
    assert (solution.values["x"] >= problem.lower).all()


def test_stages_are_tuples_of_names() -> None:
    with pytest.raises(BadArgument, match="a stage is a tuple of names of blocks"):
        Staged(("trans", "pose"))  # type: ignore[arg-type]
    with pytest.raises(BadArgument, match=r"not \(\)"):
        Staged(((),))
    with pytest.raises(UnknownName, match="no free block is called 'poze'; there are"):
        Staged((("poze",),)).solve(*body_fit())
