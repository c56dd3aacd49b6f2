"""Constraints: what is one, what a problem makes of them, and what optimality means with them."""

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from tests.differences import differences
from workbench import Block, Constraint, Problem, Residual, residuals
from workbench.errors import BadConstraint, DuplicateResidual

X = Block("x", (2,), "m")
x = X.symbol


def near(*constraints: Constraint, bounds=None) -> Problem:
    """The point (2, 1) is looked for."""
    residual = Residual("near", x - cs.DM([2.0, 1.0]), 1.0)
    return Problem((residual,), ("x",), bounds, blocks=(X,), constraints=constraints)


def optimality(problem: Problem, *at: float) -> float:
    values = {"x": np.array(at)}
    return problem.optimality(problem.split(values)[0], problem.linearize(values))


def test_bad_constraints_are_refused() -> None:
    for arguments, message in [
        ((x.T, 0.0), r"must be a column \(k, 1\), not \(1, 2\); casadi.vec makes one"),
        ((x, 0.0, -1.0), r"c\[0\] has the lower limit 0 and the upper limit -1; no number"),
        ((x,), r"c\[0\] has no finite limit; give one, or drop it"),
        ((x, [0.0, 1, 2]), r"has 2 rows; give one lower limit or 2 of them, not .*\(3,\)"),
        ((X, 0.0), r"take its .symbol"),
        ((x, 0.0, 1.0, "m", (), 0.0), "a finite tolerance above zero in m, not 0.0"),
    ]:
        with pytest.raises(BadConstraint, match=message):
            Constraint("c", *arguments)


def test_names_are_shared_with_the_residuals() -> None:
    with pytest.raises(DuplicateResidual, match="'near'"):
        near(Constraint("near", x, 0.0))


def test_constraint_derivatives_match_differences() -> None:
    h = Block("h").symbol
    c = Constraint("c", cs.vertcat(x[0] * x[1] ** 2, cs.sin(x[0]) + h), -1.0, [2.0, 3.0])
    problem = near(c)
    there = problem.stacked_constraints
    assert there is not None
    assert problem.fixed.names == ("h",)
    at, fixed = np.array([0.7, -1.2]), np.array([0.3])
    np.testing.assert_allclose(there.values(at, fixed), [0.7 * 1.44, np.sin(0.7) + 0.3])
    here = there.linearize(at, fixed)
    J = differences(lambda v: there.values(v, fixed), at)
    np.testing.assert_allclose(here.jacobian, J, atol=1e-8)
    y = np.array([0.4, -2.0])
    H = differences(lambda v: y @ there.linearize(v, fixed).jacobian, at)
    np.testing.assert_allclose(there.hessian(at, fixed, y), H, atol=1e-7)
    assert there.label(1) == "c[1]"


def test_hessian_of_constrained_points_matches_differences() -> None:
    body = random_body(3, n_vertices=6, n_joints=3, n_betas=2)
    pose, betas, trans = (block.symbol for block in body.blocks())
    joints, skin = body.joint_points(pose, betas, trans), body.points(pose, betas, trans)
    far = cs.sumsqr(joints.symbol[:, 2] - skin.symbol[:, 1]) * trans[0]
    mixed = cs.dot(skin.symbol[:, 0], joints.symbol[:, 1]) + cs.sin(pose[0, 1]) * betas[0]
    c = Constraint("c", cs.vertcat(far, mixed), 0.0, points=(joints, skin))
    free = ["pose", "trans", "betas[1]"]
    there = Problem([residuals.gaussian(trans)], free, constraints=(c,)).stacked_constraints
    assert there is not None
    rng = np.random.default_rng(42)
    at, fixed, y = 0.5 * rng.normal(size=9 + 3 + 1), np.array([0.3, 0.0]), np.array([0.7, -1.3])
    H = differences(lambda v: y @ there.linearize(v, fixed).jacobian, at)
    assert abs(H).max() > 0.1
    np.testing.assert_allclose(there.hessian(at, fixed, y), H, atol=1e-7)
    np.testing.assert_array_equal(there.hessian(at, fixed, 0 * y), np.zeros(H.shape))


def test_violation_is_counted_in_tolerances() -> None:
    there = near(
        Constraint("a", x[0], upper=1.0, unit="m", tolerance=0.1), Constraint("b", x[1], 0.0, 0.0)
    ).stacked_constraints
    assert there is not None
    assert there.violation(np.array([1.25, 1e-6])) == pytest.approx(2.5)
    assert there.violation(np.array([0.5, 0.0])) == 0
    assert there.violation(np.array([np.nan, 0.0])) == np.inf
    assert there.worst(np.array([1.25, 1e-6])) == "a is 1.25 m, above its limit 1"
    assert there.worst(np.array([1.0, -3.0])) == "b is -3, below its limit 0"
    np.testing.assert_array_equal(there.equal, [False, True])


def test_points_of_a_body_may_be_constrained() -> None:
    body = random_body(3, n_vertices=15, n_joints=3, n_betas=2)
    symbols = [block.symbol for block in body.blocks()]
    joints = body.joint_points(*symbols)
    observed = Block("observed", (15, 3), "m").symbol
    problem = Problem(
        (residuals.vertices(body.points(*symbols), observed, sigma=0.02),),
        ("pose", "trans"),
        constraints=(Constraint("floor", joints.symbol[1, :].T, 0.0, points=(joints,)),),
    )
    values = body.start() | {"observed": np.zeros((15, 3)), "trans": np.array([0.0, 0.3, 0.0])}
    at = problem.split(values)
    there = problem.stacked_constraints
    assert there is not None
    np.testing.assert_allclose(there.values(*at), body.joints(trans=values["trans"])[:, 1])
    J = differences(lambda v: there.values(v, at[1]), at[0])
    np.testing.assert_allclose(there.linearize(*at).jacobian, J, atol=1e-8)


def test_a_part_of_a_problem_keeps_the_constraints_that_it_can_move() -> None:
    y = Block("y").symbol
    residual = Residual("near", cs.vertcat(x, y), 1.0)
    problem = Problem(
        (residual,),
        ("x", "y"),
        constraints=(Constraint("of x", x[0], 0.0), Constraint("of y", y, 0.0)),
    )
    assert [c.name for c in problem.freeing("x").constraints] == ["of x"]
    assert problem.freeing("y").freeing("x").constraints == ()  # as with bounds


# Optimality.


def test_the_conditions_of_karush_kuhn_and_tucker_hold_at_the_solution_only() -> None:
    problem = near(Constraint("disc", cs.sumsqr(x), upper=1.0))
    solution = np.array([2.0, 1.0]) / np.sqrt(5)
    assert optimality(problem, *solution) < 1e-12
    assert optimality(problem, *(-solution)) > 0.1  # the multiplier has the wrong sign
    # the way that is left along x, over the residual in the row that x can change
    left = 0.001 * 2 / np.sqrt(5) / (2 - 2 / np.sqrt(5))
    assert optimality(problem, *(0.999 * solution)) == pytest.approx(left, rel=0.01)
    turned = np.array([np.cos(0.5), np.sin(0.5)])
    along = np.array([-turned[1], turned[0]])
    rows = np.array([2.0, 1.0]) - turned  # each coordinate has a row, the shorter below a sigma
    way = abs(rows @ along) * np.abs(along)
    expected = (way / np.maximum(np.abs(rows), 1.0)).max()
    assert optimality(problem, *turned) == pytest.approx(expected, rel=1e-6)


def test_violated_constraint_is_not_stationary() -> None:
    """Not even where the gradient vanishes: the way back counts, in units of the residual."""
    problem = near(Constraint("left", x[0], upper=1.0))
    assert optimality(problem, 2.5, 1.0) == pytest.approx(1.5 / 0.5)
    assert optimality(problem, 2.0, 1.0) == np.inf  # no residual, and yet not allowed
    assert optimality(problem, 1.0, 1.0) == 0
    assert optimality(problem, 1.0 + 1e-7, 1.0) < 1e-6  # within the tolerance


def test_contradictory_constraints_are_nowhere_stationary() -> None:
    problem = near(Constraint("left", x[0], upper=0.0), Constraint("right", x[0], lower=1.0))
    assert optimality(problem, 0.5, 1.0) == np.inf
    flat = near(Constraint("flat", x[0] ** 2, lower=1.0))  # its slope at 0 is none
    assert optimality(flat, 0.0, 1.0) == np.inf
