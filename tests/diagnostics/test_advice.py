"""Every suggestion has been carried out, and does what it says."""

from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import SMPL_NAMES
from tests.diagnostics import cases
from tests.tiers import few
from workbench import Block, Problem, Residual, diagnose

FAST = (cases.scale_against_depth, cases.the_same_twice, cases.naive_rodrigues, cases.uneven)
CASES = pytest.mark.parametrize(
    "case", few(cases.CASES, (*FAST, cases.two_pieces)), ids=lambda case: case.__name__
)


@CASES
def test_every_suggestion_does_what_it_says(case: Callable[[], cases.Case]) -> None:
    found = cases.diagnosed(case)
    assert any(suggestion.cured for suggestion in found.suggestions)  # all have something wrong
    for suggestion in found.suggestions:
        assert suggestion.before == found.state
        after = diagnose(suggestion.problem, suggestion.values)
        if suggestion.kind == "rescale":  # the same problem, in other units
            s = np.linalg.svd(after.here.dense / after.here.column_norms, compute_uv=False)
            rank, condition = len(s), s[0] / s[-1]
        else:
            rank, condition = after.rank, after.condition
        assert suggestion.after.unknowns == after.shape[1], suggestion.what
        assert suggestion.after.rank == rank, suggestion.what
        assert suggestion.after.condition == pytest.approx(condition, rel=1e-9), suggestion.what
        assert suggestion.cured == (rank == after.shape[1]), suggestion.what
        if suggestion.kind in ("fix", "prior", "rewrap"):
            assert after.shape[1] - rank < found.shape[1] - found.rank, suggestion.what
        assert f"{suggestion.what}: {suggestion.before} -> {suggestion.after}" in found.report()


@pytest.mark.thorough
@pytest.mark.parametrize("past", [-0.02, 0.01])
def test_near_a_full_turn_one_turn_is_taken_off(past: float) -> None:
    """There the rank is full, and the condition is bad."""
    problem, values = cases.full_turn()
    pose = values["pose"].copy()
    knee = SMPL_NAMES.index("left_knee")
    pose[knee] *= 1 + past / (2 * np.pi)
    found = diagnose(problem, values | {"pose": pose})
    found.assert_rank(75)
    (turned,) = (s for s in found.suggestions if s.kind == "rewrap")
    assert turned.after.condition < turned.before.condition / 3
    axis = pose[knee] / np.linalg.norm(pose[knee])
    np.testing.assert_allclose(turned.values["pose"][knee], past * axis, atol=1e-12)
    residual = turned.problem.linearize(turned.values).residual
    np.testing.assert_allclose(residual, found.here.residual, atol=1e-9)


def test_what_is_fixed_keeps_its_value_and_other_bounds_stay() -> None:
    problem, values = cases.scale_against_depth()
    bounded = Problem(problem.residuals, problem.free.names, {"scale": (0.5, 2), "trans": (-9, 9)})
    found = {s.what: s for s in diagnose(bounded, values).suggestions}
    assert found["fix scale"].problem.free.names == ("trans",)
    assert set(found["fix scale"].problem.bounds) == {"trans"}
    assert found["fix scale"].values["scale"] == 1.0
    assert set(found["add a Gaussian prior on scale (sigma 1)"].problem.bounds) == {
        "scale",
        "trans",
    }


def test_a_prior_stands_at_the_present_value() -> None:
    problem, values = cases.scale_against_depth()
    priors = [s.problem for s in diagnose(problem, values).suggestions if s.kind == "prior"]
    (fuller,) = (problem for problem in priors if "prior on scale" in problem.rows)
    np.testing.assert_array_equal(
        fuller.linearize(values).residual[fuller.rows["prior on scale"]], 0.0
    )


def test_a_prior_of_that_name_does_not_stand_in_the_way() -> None:
    x = Block("x", (2,))
    problem = Problem((Residual("prior on x", x.symbol[0] - x.symbol[1], 1.0),), ("x",))
    found = diagnose(problem, {"x": np.zeros(2)}).suggestions
    (prior,) = (suggestion for suggestion in found if suggestion.kind == "prior")
    assert list(prior.problem.rows) == ["prior on x", "prior on x'"]


def test_blocks_that_need_a_prior_each_get_it_together() -> None:
    x, y = Block("x", (1, 3), "m"), Block("y", (2,))
    differences = cs.vertcat(x.symbol[0] - x.symbol[1], x.symbol[2], y.symbol[0] - y.symbol[1])
    problem = Problem((Residual("r", differences, 1.0),), ("x", "y"), blocks=(x, y))
    found = diagnose(problem, {"x": np.zeros((1, 3)), "y": np.zeros(2)})
    priors = [s for s in found.suggestions if s.kind == "prior"]
    assert [(s.what, s.after.rank, s.cured) for s in priors] == [
        ("add a Gaussian prior on x and y (sigma 1 m, 1)", 5, True),
    ]


def test_of_many_blocks_the_first_few_are_named_and_counted() -> None:
    """The suggestion itself puts a prior on all of them."""
    blocks = [Block(f"b{k}", (2,), "m") for k in range(9)]
    differences = cs.vertcat(*(b.symbol[0] - b.symbol[1] for b in blocks))
    problem = Problem([Residual("r", differences, 1.0)], [b.name for b in blocks], blocks=blocks)
    found = diagnose(problem, {b.name: np.zeros(2) for b in blocks})
    *_, together = (s for s in found.suggestions if s.kind == "prior")
    assert together.what == (
        "add a Gaussian prior on b0, b1, b2, b3, b4 and 4 more "
        "(sigma 1 m, 1 m, 1 m, 1 m, 1 m and 4 more)"
    )
    assert len(together.problem.residuals) == 10
    assert together.cured


def test_a_healthy_problem_gets_no_advice() -> None:
    x = Block("x", (3,))
    A = np.random.default_rng(0).normal(size=(8, 3))
    problem = Problem((Residual("r", cs.DM(A) @ x.symbol, 0.1),), ("x",), blocks=(x,))
    found = diagnose(problem, {"x": np.zeros(3)})
    assert found.suggestions == ()
    assert found.findings == ()
    assert "no warnings" in found.report()
    found.assert_no_warnings()
