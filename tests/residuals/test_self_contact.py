"""Self-contact: the hinge, the gaps and SMPLify's spheres."""

from itertools import pairwise

import casadi as cs
import numpy as np
import pytest

from tests.differences import assert_jacobian
from workbench import SOLVERS, Block, Constraint, Problem, load_body, residuals, solve
from workbench.bodies.capsules import capsule_gaps, capsule_points, segment_distances
from workbench.errors import BadResidual
from workbench.fitting import pose_prior, shape_prior
from workbench.priors.poses import draw_poses, shipped_mixture
from workbench.residuals import Residual, apart, gaps, spheres
from workbench.solvers import DEFAULT

RADII, PAIR = np.array([0.05, 0.03]), np.array([[0, 1]])
ENDS = Block("ends", (4, 3), "m")


def parallel(distance: float) -> np.ndarray:
    """Two segments of 0.2 m side by side."""
    x = np.array([[0, 0, 0], [0, 0.2, 0], [distance, 0, 0], [distance, 0.2, 0]])
    return x.astype(float)


def at(ends: np.ndarray, **options: float) -> np.ndarray:
    """The rows of SMPLify's term."""
    residual = spheres(ENDS.symbol, RADII, PAIR, sigma=1.0, **options)
    f = cs.Function("f", [ENDS.symbol], [residual.expression])
    return np.asarray(f(ends.T)).ravel()


def test_gaps_match_distances_of_segments() -> None:
    rng = np.random.default_rng(0)
    pairs = np.array([[0, 1], [2, 0], [1, 3]])
    ends = Block("e", (8, 3), "m")
    f = cs.Function("f", [ends.symbol], [gaps(ends.symbol, np.zeros(4), pairs)])
    for trial in range(50):
        e = rng.standard_normal((4, 2, 3))
        if trial < 10:
            e[1, 1] = e[1, 0] + (e[0, 1] - e[0, 0]) * rng.uniform(-1, 1)  # parallel
        elif trial < 20:
            e[0, 1], e[3, 1] = e[0, 0], e[3, 0]  # spheres
        distances = np.asarray(f(e.reshape(8, 3).T)).ravel()
        assert np.allclose(distances, segment_distances(e[:, 0], e[:, 1], pairs), atol=1e-12)
        slopes = np.asarray(
            cs.Function("J", [ends.symbol], [f.jacobian()(ends.symbol, 0)])(e.reshape(8, 3).T)
        )
        assert np.isfinite(slopes).all()


def test_hinge_is_the_depth_of_the_overlap() -> None:
    for distance, depth in [(0.2, 0.0), (0.08, 0.0), (0.05, 0.03), (0, 0.08)]:
        problem = Problem([apart(ENDS.symbol, RADII, PAIR, sigma=0.01)], free=("ends",))
        linear = problem.linearize({"ends": parallel(distance)})
        assert linear.residual * 0.01 == pytest.approx(depth, abs=1e-12)
        assert np.isfinite(linear.jacobian).all()


def test_spheres_decrease_with_distance() -> None:
    rows = [at(parallel(d)) for d in (0, 0.01, 0.02, 0.05, 0.08, 1.0)]
    assert rows[0].max() == pytest.approx(1)
    energies = [float(r @ r) for r in rows]
    assert all(a > b for a, b in pairwise(energies))
    assert energies[-1] < 1e-300
    width = 0.3**2 * (RADII**2).sum()
    one = at(np.repeat([[0.0, 0, 0], [0.02, 0, 0]], 2, axis=0))
    assert one @ one == pytest.approx(16 * np.exp(-(0.02**2) / width))


@pytest.mark.parametrize("term", [apart, spheres])
def test_derivatives_by_pose_and_betas_match_differences(term) -> None:
    body, rng = load_body("small"), np.random.default_rng(1)
    pose, betas, trans = body.blocks()
    ends = capsule_points(body, pose.symbol, betas.symbol, trans.symbol)
    values = {"pose": 0.5 * rng.standard_normal((24, 3)), "betas": rng.standard_normal(10)}
    values["trans"] = np.zeros(3)
    values["pose"] *= 0.2
    values["pose"][body.joint_names.index("left_shoulder"), 2] = -1.7  # the arm into the side
    capsules = body.capsules
    pairs = capsules.pairs[np.argsort(capsule_gaps(body, **values))[:4]]
    assert capsule_gaps(body, **values).min() < 0
    radii = capsules.radii_in(betas.symbol)
    problem = Problem([term(ends, radii, pairs, sigma=0.1)], free=("pose", "betas"))
    x, fixed = problem.free.pack(values), problem.fixed.pack(values)
    assert abs(problem.linearize_at(x, fixed).jacobian).max() > 1e-4
    assert_jacobian(problem, x, fixed, 1e-6)


def test_bad_capsules_are_refused() -> None:
    with pytest.raises(BadResidual, match="two ends"):
        gaps(Block("e", (3, 3), "m").symbol, RADII, PAIR)
    with pytest.raises(BadResidual, match="radii"):
        gaps(ENDS.symbol, np.ones(3), PAIR)
    with pytest.raises(BadResidual, match="from 0 to 1"):
        gaps(ENDS.symbol, RADII, [[0, 2]])
    with pytest.raises(BadResidual, match="at least 2 spheres"):
        spheres(ENDS.symbol, RADII, PAIR, sigma=1.0, per_capsule=1)


@pytest.mark.thorough
def test_hinge_and_constraint_agree_in_cost() -> None:
    """The hinge is the quadratic penalty of the limit: what remains shrinks with its sigma^2."""
    body, rng = load_body("small"), np.random.default_rng(5)
    poses = draw_poses(shipped_mixture(), 100, rng)
    overlap = -capsule_gaps(body, poses).min(axis=1)
    taken = poses[int(np.argmin(abs(overlap - 0.06)))]
    pose, betas, trans = (block.symbol for block in body.blocks())
    observed = Block("observed", (24, 3), "m")
    base = (
        residuals.landmarks(body.joint_points(pose, betas, trans), observed.symbol, sigma=0.01),
        pose_prior(body),
        shape_prior(body),
    )
    ends, capsules = capsule_points(body, pose, betas, trans), body.capsules
    radii, free = capsules.radii_in(betas), ("pose", "betas", "trans")
    at = body.start() | {"observed": body.joints(taken)}

    def problem(*terms: Residual, constraints: tuple[Constraint, ...] = ()) -> Problem:
        return Problem([*base, *terms], free, blocks=[observed], constraints=constraints)

    alone = problem()
    limit = Constraint(
        "limit", gaps(ends, radii, capsules.pairs), 0.0, unit="m", points=(ends,), tolerance=1e-4
    )
    start = at | solve(alone, at).values
    assert capsule_gaps(body, *(start[name] for name in free)).min() < -0.02
    costs, worst = {}, {}
    for name, one, solver, first in (
        ("hinge", problem(apart(ends, radii, capsules.pairs, sigma=1e-3)), SOLVERS[DEFAULT], start),
        ("stiff", problem(apart(ends, radii, capsules.pairs, sigma=1e-4)), SOLVERS[DEFAULT], None),
        ("sqp", problem(constraints=(limit,)), SOLVERS["sqp"], None),
        ("ipopt", problem(constraints=(limit,)), SOLVERS["ipopt"], None),
    ):
        end = start | solver.solve(one, start if first is None else first).values
        start = end if name == "hinge" else start  # the others go on where the hinge ended
        r = alone.residual(*alone.split(end))
        costs[name] = 0.5 * float(r @ r)
        worst[name] = -float(capsule_gaps(body, *(end[block] for block in free)).min())
    assert costs["sqp"] == pytest.approx(costs["ipopt"], rel=1e-3)
    assert costs["hinge"] == pytest.approx(costs["ipopt"], rel=1e-2)
    assert costs["hinge"] < costs["stiff"] < costs["ipopt"] * (1 + 1e-4)
    assert costs["stiff"] == pytest.approx(costs["ipopt"], rel=1e-3)
    assert worst["hinge"] < 2e-3
    assert worst["stiff"] < worst["hinge"] / 20
    assert max(worst["sqp"], worst["ipopt"]) < 2e-4
