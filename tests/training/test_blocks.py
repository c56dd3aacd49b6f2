"""The arithmetic of training and its blocks: skinning, derivatives, shares, joints, starts."""

from dataclasses import replace
from functools import partial
from math import inf

import numpy as np
import pytest

from tests.tiers import few
from workbench.arrays import Array
from workbench.bodies.forward.posing import unpose
from workbench.geometry.mirror import NoMirror, find_mirror
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.blocks import BLOCKS, BlockInput
from workbench.training.estimate import NAMES, TERMS, Estimate, Sigmas, SkinningPass
from workbench.training.execution import Execution, Processes
from workbench.training.normal_equations import NormalEquations, dot, steihaug, within
from workbench.training.objective import Objective
from workbench.training.poses import fitted_poses
from workbench.training.shares import (
    NoShares,
    fit_joint_regressor,
    kkt_residuals,
    many_shares,
    shares,
)

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


def test_shares_meet_optimality_and_beat_corners() -> None:
    rng = np.random.default_rng(1)
    for n, rows in ((3, 9), (6, 20), (24, 10), (12, 300)):
        B, v = rng.standard_normal((rows, n)), rng.standard_normal(rows)
        G, c = B.T @ B, B.T @ v
        w = shares(G, c, np.eye(n)[0])
        every = np.ones((1, n), dtype=bool)
        assert kkt_residuals(G[None], c[None], w[None], every)[0] < 1e-12
        costs = [0.5 * e @ G @ e - c @ e for e in np.eye(n)]
        assert 0.5 * w @ G @ w - c @ w <= min(costs) + 1e-12
    # known: the nearest point of a segment
    near = shares(np.eye(2), np.array([0.9, 0.3]), np.array([0.0, 1.0]))
    np.testing.assert_allclose(near, [0.8, 0.2], atol=1e-14)
    corner = shares(np.eye(2), np.array([3.0, 0.3]), np.array([0.5, 0.5]))
    np.testing.assert_array_equal(corner, [1.0, 0.0])


def test_many_shares_agree_with_single_ones() -> None:
    """Also where a matrix is singular, or a row of its start is a corner."""
    rng = np.random.default_rng(3)
    B, v = rng.standard_normal((12, 9, 6)), rng.standard_normal((12, 9))
    B[3, :, 1] = B[3, :, 0]  # two columns are the same
    B[4] = 0
    grams, rights = B.swapaxes(1, 2) @ B, (v[:, None] @ B)[:, 0]
    starts = np.full((12, 6), 1 / 6)
    starts[5] = np.eye(6)[2]
    every = np.ones((12, 6), dtype=bool)
    solutions = many_shares(grams, rights, starts, every)
    for G, c, w, start in zip(grams, rights, solutions, starts, strict=True):
        np.testing.assert_allclose(w, shares(G, c, start), atol=1e-12)
    allowed = every.copy()
    allowed[:, 4] = False
    assert not many_shares(grams, rights, np.tile(np.eye(6)[0], (12, 1)), allowed)[:, 4].any()
    with pytest.raises(NoShares, match="not finite"):
        shares(np.full((2, 2), np.nan), np.zeros(2), np.array([0.5, 0.5]))


def test_joint_regressor_holds_for_other_shapes() -> None:
    betas = np.random.default_rng(8).standard_normal((5, 2))
    people = BODY.vertices(betas=betas)
    joints = np.stack([BODY.J_regressor @ person for person in people])
    regressor = fit_joint_regressor(people[:3], joints[:3], START.rings())
    assert regressor.kkt < 1e-8
    rows = regressor.matrix.toarray()
    assert rows.min() >= 0
    np.testing.assert_allclose(rows.sum(axis=1), 1, atol=1e-14)
    away = np.stack([regressor.matrix @ person for person in people]) - joints
    assert np.abs(away[:, 1:]).max() < 1e-9  # also of the two that it has not seen
    assert np.abs(rows - BODY.J_regressor.toarray())[1:].max() > 0.01  # a row is not determined
    hull = people.min(axis=1)[:, None] - 1e-12, people.max(axis=1)[:, None] + 1e-12
    regressed = np.stack([regressor.matrix @ person for person in people])
    assert ((hull[0] <= regressed) & (regressed <= hull[1])).all()


@pytest.mark.parametrize("block", few(["poses", "surfaces", "weights", "together"], 3))
def test_blocks_lower_the_cost_and_stay_at_the_truth(block: str) -> None:
    held = objective(replace(Sigmas(data=0.001), **OFF))
    away = true_estimate().moved(a_change(true_estimate(), 0.005))
    kept = away.weights.clip(0)
    away = replace(away, weights=kept / kept.sum(axis=1, keepdims=True))
    fitted, _ = BLOCKS[block](BlockInput(held, START.faces), away)
    assert held.cost(fitted) < 0.999 * held.cost(away)
    np.testing.assert_allclose(fitted.weights.sum(axis=1), 1, atol=1e-13)
    assert fitted.weights.min() >= 0
    at, _ = BLOCKS[block](BlockInput(held, START.faces), true_estimate())
    assert held.cost(at) < 1e-15


@pytest.mark.thorough
def test_poses_do_not_depend_on_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    estimate = replace(true_estimate(), poses=TRUTH.poses + 0.05)
    fit = partial(fitted_poses, estimate, DATA, START.faces, 0.002, 3)
    whole = fit().poses
    assert np.abs(whole - TRUTH.poses).max() < 0.02
    monkeypatch.setattr("workbench.training.poses.JOB_SIZE", 5)
    np.testing.assert_allclose(fit(execution=Execution(Processes(2))).poses, whole, atol=1e-12)


def test_mirror_is_found_in_noise() -> None:
    noisy = START.template + 0.005 * np.random.default_rng(0).standard_normal((35, 3))
    mirror = find_mirror(noisy, START.faces)
    np.testing.assert_allclose(START.template[mirror] * [-1, 1, 1], START.template, atol=1e-12)


def test_mesh_without_sides_has_no_mirror() -> None:
    flipped = START.faces.copy()
    a, b, c = flipped[0]
    other = next(f for f in range(1, len(flipped)) if {a, b} <= set(flipped[f].tolist()))
    d = next(v for v in flipped[other].tolist() if v not in (a, b))
    flipped[0], flipped[other] = (a, d, c), (d, b, c)
    with pytest.raises(NoMirror, match="without symmetry"):
        find_mirror(START.template, flipped)


def test_unposed_meshes_pose_back() -> None:
    strange = DATA.vertices[0] + 0.02 * np.random.default_rng(0).standard_normal((35, 3))
    person = replace(BODY, template=unpose(BODY, TRUTH.poses[0], strange))
    np.testing.assert_allclose(person.vertices(TRUTH.poses[0]), strange, atol=1e-10)


def test_skinning_pass_is_the_body() -> None:
    passed = SkinningPass.of(true_estimate(), slice(0, 12), DATA.subject)
    points = passed.points + TRUTH.trans[:, None]
    np.testing.assert_allclose(points, DATA.vertices, atol=1e-13)


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
    assert -dot(equations.negative_gradient, change) == pytest.approx(
        (ahead - behind) / (2 * h), rel=1e-5
    )
    other = {n: np.roll(c, 1, axis=0) for n, c in change.items()}
    other["weights"] = within(other["weights"], estimate.weights > 0)
    left, right = dot(equations.product(change), other), dot(change, equations.product(other))
    assert left == pytest.approx(right, rel=1e-9)
    left = dot(equations.preconditioned(change), other)
    assert left == pytest.approx(dot(change, equations.preconditioned(other)), rel=1e-9)
    assert dot(equations.preconditioned(change), change) > 0


def test_conjugate_gradients_solve_and_stay_inside() -> None:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((8, 6))
    H, b = A.T @ A, rng.standard_normal(6)

    def product(x: dict[str, Array]) -> dict[str, Array]:
        return {"x": H @ x["x"]}

    free = steihaug(product, lambda r: r, {"x": b}, tolerance=1e-12)
    np.testing.assert_allclose(free.change["x"], np.linalg.solve(H, b), rtol=1e-8)
    cost = 0.5 * free.change["x"] @ H @ free.change["x"] - b @ free.change["x"]
    assert free.predicted == pytest.approx(-cost, rel=1e-9)
    near = steihaug(product, lambda r: r, {"x": b}, radius=0.3 * free.length)
    assert np.linalg.norm(near.change["x"]) == pytest.approx(0.3 * free.length, rel=1e-9)
    assert not near.inside
    assert 0 < near.predicted < free.predicted
