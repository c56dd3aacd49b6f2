"""The arithmetic of training: one pass of skinning, its tangent, slopes, conjugate gradients."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from workbench.arrays import Array
from workbench.synthetic.made_up import (
    draw_registrations,
    jointed_tube,
    random_smpl,
)
from workbench.training.estimate import NAMES, TERMS, Estimate, Sigmas, SkinningPass
from workbench.training.normal_equations import NormalEquations, dot, solve, within
from workbench.training.objective import Objective

START = jointed_tube(7, 5)


BODY = random_smpl(START, 2, seed=3)


DATA, TRUTH = draw_registrations(BODY, 3, 4, seed=4)


OFF = dict.fromkeys(TERMS, inf)


def true_estimate() -> Estimate:
    people = BODY.vertices(betas=TRUTH.betas)
    joints = np.stack([BODY.J_regressor @ person for person in people])
    return Estimate(people, joints, BODY.posedirs, BODY.weights, TRUTH.poses, BODY.parents)


def objective(sigmas: Sigmas, *, mirror: bool = False) -> Objective:
    sides = START.mirror() if mirror else None
    template = START.template if mirror else None
    return Objective(DATA, START.rings(), START.weights(), sides, sigmas, template)


def a_change(estimate: Estimate, size: float = 0.01) -> dict[str, Array]:
    rng = np.random.default_rng(5)
    change = {n: size * rng.standard_normal(getattr(estimate, n).shape) for n in NAMES}
    return change | {"weights": within(change["weights"], estimate.weights > 0)}


def bend(*names: str) -> float:
    """How far the points are from a straight line between two estimates that differ in these."""
    here = true_estimate()
    change = {n: d for n, d in a_change(here, 0.1).items() if n in names}

    def points(share: float) -> Array:
        return SkinningPass.of(here.moved(change, share), slice(0, 12), DATA.subject).points

    return float(np.abs(points(0) - 2 * points(1) + points(2)).max())


def test_skinning_pass_is_the_body() -> None:
    passed = SkinningPass.of(true_estimate(), slice(0, 12), DATA.subject)
    points = passed.points + TRUTH.trans[:, None]
    np.testing.assert_allclose(points, DATA.vertices, atol=1e-13)


def test_skinning_is_linear_in_all_but_rotations() -> None:
    """Facts to know first, 1: jointly in templates, joints and posedirs; in weights apart."""
    assert bend("templates", "joints", "posedirs") < 1e-13
    assert bend("weights") < 1e-13
    assert bend("weights", "posedirs") > 1e-3
    assert bend("poses") > 1e-3


def test_cost_vanishes_at_the_truth() -> None:
    off = replace(Sigmas(), **OFF)
    assert objective(off).cost(true_estimate()) < 1e-20
    here = true_estimate()
    moved = replace(here, templates=here.templates + 0.01, joints=here.joints + 0.01)
    assert objective(off).cost(moved) < 1e-20  # translation is always at its best
    P = replace(true_estimate(), posedirs=2 * BODY.posedirs)
    costs = objective(replace(Sigmas(), posedirs=0.5)).costs(P)
    assert costs["E_P"] == pytest.approx(0.5 * np.sum((2 * BODY.posedirs / 0.5) ** 2), rel=1e-12)


def test_tangent_is_differences_and_the_adjoint_of_pulls() -> None:
    estimate = true_estimate()
    change = a_change(estimate)

    def points(share: float) -> Array:
        return SkinningPass.of(estimate.moved(change, share), slice(0, 12), DATA.subject).points

    passed = SkinningPass.of(estimate, slice(0, 12), DATA.subject)
    moved = passed.tangent(change)
    h = 1e-5
    np.testing.assert_allclose(moved, (points(h) - points(-h)) / (2 * h), atol=1e-9)
    pull = np.random.default_rng(6).standard_normal(moved.shape)
    gradient = estimate.zero_change(NAMES)
    passed.adjoint(pull, gradient)
    assert dot(gradient, change) == pytest.approx(float(np.vdot(pull, moved)), rel=1e-12)


@pytest.mark.parametrize("mirror", [False, True])
def test_slope_is_that_of_the_cost_and_curvature_symmetric(mirror: bool) -> None:
    estimate = true_estimate().moved(a_change(true_estimate()))
    held = objective(Sigmas(), mirror=mirror)
    equations = NormalEquations(held, estimate, NAMES)
    change = a_change(estimate, 1e-3)
    h = 1e-3
    ahead, behind = (held.cost(estimate.moved(change, s)) for s in (h, -h))
    assert -dot(equations.slope, change) == pytest.approx((ahead - behind) / (2 * h), rel=1e-5)
    other = {n: np.roll(c, 1, axis=0) for n, c in change.items()}
    other["weights"] = within(other["weights"], estimate.weights > 0)
    left, right = dot(equations.product(change), other), dot(change, equations.product(other))
    assert left == pytest.approx(right, rel=1e-9)
    left = dot(equations.preconditioned(change), other)
    assert left == pytest.approx(dot(change, equations.preconditioned(other)), rel=1e-9)
    assert dot(equations.preconditioned(change), change) > 0


def test_preconditioner_inverts_poses_exactly() -> None:
    """All that turns move is in their blocks, blend shapes included: the inverse is exact."""
    equations = NormalEquations(objective(Sigmas()), true_estimate(), ("poses",))
    change = {"poses": a_change(true_estimate())["poses"]}
    back = equations.preconditioned(equations.product(change))
    np.testing.assert_allclose(back["poses"], change["poses"], rtol=1e-5, atol=1e-7)


def test_root_joint_stays_where_nothing_holds_it() -> None:
    """Turning about another point is a translation more: only E_J, or E_Y, says where it is."""
    names = ("templates", "joints")
    change = {name: a_change(true_estimate())[name] for name in names}
    loose = objective(replace(Sigmas(), **OFF))
    free = NormalEquations(loose, true_estimate(), names).preconditioned(change)
    assert not free["joints"][:, 0].any()
    assert free["joints"][:, 1:].all()
    held = NormalEquations(objective(Sigmas()), true_estimate(), names).preconditioned(change)
    assert held["joints"].all()


def test_conjugate_gradients_solve_and_stay_inside() -> None:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((8, 6))
    H, b = A.T @ A, rng.standard_normal(6)

    def product(x: dict[str, Array]) -> dict[str, Array]:
        return {"x": H @ x["x"]}

    free = solve(product, lambda r: r, {"x": b}, tolerance=1e-12)
    np.testing.assert_allclose(free.change["x"], np.linalg.solve(H, b), rtol=1e-8)
    cost = 0.5 * free.change["x"] @ H @ free.change["x"] - b @ free.change["x"]
    assert free.predicted == pytest.approx(-cost, rel=1e-9)
    near = solve(product, lambda r: r, {"x": b}, radius=0.3 * free.length)
    assert np.linalg.norm(near.change["x"]) == pytest.approx(0.3 * free.length, rel=1e-9)
    assert not near.inside
    assert 0 < near.predicted < free.predicted
