"""Right answers by other ways than ours pass, in lectures 7, 11, 12, 15 and 16."""

import casadi as cs
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.stats
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from tests.lectures.answered import all_pass
from workbench import load_body
from workbench.fitting import Observations, image_fit, photograph
from workbench.geometry.rigid import Similarity
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import GemanMcClure, Icp, point_to_plane

pytestmark = pytest.mark.thorough

Array = np.ndarray


def by_normal_equations(e: Array, J: Array, damping: float) -> Array:
    return np.linalg.solve(J.T @ J + damping * np.eye(J.shape[1]), -J.T @ e)


def over_the_promise(f, e: Array, J: Array, x: Array, p: Array) -> float:
    fall = 0.5 * np.sum(f(x) ** 2) - 0.5 * np.sum(f(x + p) ** 2)
    return fall / (-(J.T @ e) @ p - 0.5 * p @ J.T @ J @ p)


def searched_along(e: Array, J: Array) -> Array:
    g = -J.T @ e
    return g * float(np.linalg.lstsq((J @ g)[:, None], -e, rcond=None)[0][0])


def halved(newton: Array, cauchy: Array, radius: float) -> Array:
    def at(s: float) -> Array:
        return s * cauchy if s <= 1 else cauchy + (s - 1) * (newton - cauchy)

    if np.linalg.norm(newton) <= radius:
        return newton
    return at(scipy.optimize.brentq(lambda s: np.linalg.norm(at(s)) - radius, 0, 2, xtol=1e-14))


def by_bisection(e: Array, J: Array, radius: float) -> float:
    low, high = -30.0, 30.0
    if np.linalg.norm(np.linalg.lstsq(J, -e, rcond=None)[0]) <= radius:
        return 0.0
    for _ in range(100):
        middle = (low + high) / 2
        long = np.linalg.norm(by_normal_equations(e, J, np.exp(middle))) > radius
        low, high = (middle, high) if long else (low, middle)
    return float(np.exp(low))


def by_scipy(f, J, x: Array) -> Array:
    return scipy.optimize.least_squares(f, x, J, gtol=1e-12, xtol=1e-15, ftol=1e-15).x


def one_by_one(costs: Array, efforts: Array, goal: float) -> float:
    for cost, effort in zip(costs, efforts, strict=True):
        if cost <= goal:
            return effort
    return np.inf


def row_by_row(times: Array) -> list:
    return [[t / min(row) if np.isfinite(t) else np.inf for t in row] for row in times]


def by_counting(times: Array, alphas: Array) -> list:
    ratio = np.array(row_by_row(times))
    return [[sum(r <= a for r in column) / len(column) for column in ratio.T] for a in alphas]


def by_stats(successes: int, trials: int) -> list[float]:
    return list(scipy.stats.binomtest(successes, trials).proportion_ci(method="wilson"))


def by_inverse(J: Array) -> Array:
    return np.sqrt(np.diag(np.linalg.inv(J.T @ J)))


def sorted_out(draws: Array, level: float) -> Array:
    order, n = np.sort(draws, axis=0), len(draws)
    cut = round(n * (1 - level) / 2)
    return np.column_stack([order[cut], order[n - 1 - cut]])


def by_ratio(log_p, x: Array, y: Array, u: float) -> Array:
    return np.where(u < min(1.0, np.exp(log_p(y) - log_p(x))), y, x)


def by_halves(log_p, start: Array, count: int) -> Array:
    """Differential evolution as in the lecture: one half moves, and the other stands still."""
    rng, H = np.random.default_rng(5), 20
    x = start + 2.5 * rng.standard_normal((2, H, 2))
    here = np.array([[log_p(one) for one in half] for half in x])
    kept, rounds = [], 10 * count // (2 * H)
    for k in range(rounds):
        for moving, other in ((0, x[1]), (1, x[0])):
            a, b = rng.integers(H, size=(2, H))
            steps = rng.choice([1.0, 1.2], size=(H, 1)) * (other[a] - other[b])
            y = x[moving] + steps + 1e-4 * rng.standard_normal((H, 2))
            there = np.array([log_p(one) for one in y])
            taken = np.log(rng.uniform(size=H)) < there - here[moving]
            x[moving][taken], here[moving][taken] = y[taken], there[taken]
        if k >= rounds // 5:
            kept.append(x.reshape(-1, 2).copy())
    return np.concatenate(kept)[-8 * count :: 8]


def by_nnls(p: Array, a: Array, b: Array, c: Array) -> Array:
    heavy = 1e5  # so that the shares sum to one
    A = np.vstack([np.transpose([a, b, c]), heavy * np.ones(3)])
    shares = scipy.optimize.nnls(A, np.append(p, heavy))[0]
    return shares / shares.sum() @ np.array([a, b, c])


def by_brute_force(points: Array, cloud: Array) -> Array:
    contacts = cloud[cdist(points, cloud).argmin(axis=1)]
    p, q = points.mean(axis=0), contacts.mean(axis=0)
    R, _ = Rotation.align_vectors(contacts - q, points - p)
    return R.apply(points - p) + q


def by_casadi(p: Array, corners: Array, shares: Array) -> Array:
    v = cs.SX.sym("v", 3, 3)  # a column for each corner
    slope = cs.gradient(cs.norm_2(cs.DM(p) - v @ cs.DM(shares)), v)
    return np.asarray(cs.Function("slope", [v], [slope])(corners.T)).T


def by_a_matrix(V: Array, M: Array, edges: Array, sigma: float) -> Array:
    A = np.zeros((len(edges), len(V)))
    A[np.arange(len(edges)), edges[:, 0]] = -1
    A[np.arange(len(edges)), edges[:, 1]] = 1
    return ((A @ V - A @ M) / sigma).ravel()


def by_point_to_plane(points: Array, vertices: Array, faces: Array) -> tuple[Array, Array]:
    tree, ends = SurfaceTree(vertices, faces), []
    for angle in np.radians(np.arange(0, 360, 30)):
        R = Rotation.from_euler("y", angle).as_matrix()
        start = Similarity(R, vertices.mean(axis=0) - R @ np.median(points, axis=0))
        how = Icp(point_to_plane, GemanMcClure(0.03), tolerance=1e-4)
        ends.append(how.align(points, tree, start))
    best = min(ends, key=lambda end: end.cost)
    return best.R, best.t


def side_by_side(points: Array, pixels: Array, focal: float) -> float:
    lengths = [sum(np.sqrt(((at[:2] - at[2:]) ** 2).sum(1))) for at in (points, pixels)]
    return focal / (lengths[1] / lengths[0])


def by_residuals(off: Array, confidence: Array, sigma: float, scale: float) -> float:
    shrunk = scale * off / np.hypot(scale, off)  # its square levels off at scale^2
    return float(np.linalg.norm(confidence[:, None] * shrunk / sigma) ** 2 / 2)


def hinge_by_hinge(pose: Array) -> float:
    elbows, knees = np.exp(pose[18:20, 1] * [1, -1]), np.exp(-pose[4:6, 0])
    return float(elbows @ elbows + knees @ knees) / 2


def by_scipys_densities(
    x: Array, shares: Array, means: Array, covariances: Array
) -> tuple[float, float]:
    logs = np.log(shares) + [
        scipy.stats.multivariate_normal(mean, C).logpdf(x)
        for mean, C in zip(means, covariances, strict=True)
    ]
    return -max(logs), -float(np.logaddexp.reduce(logs))


def by_casadis_slope(distance: float, r1: float, r2: float) -> float:
    d = cs.SX.sym("d")
    term = cs.exp(-(d**2) / ((0.3 * r1) ** 2 + (0.3 * r2) ** 2))
    return float(cs.Function("slope", [d], [cs.gradient(term, d)])(distance))


def from_two_starts(pixels: Array, confidence: Array, focal: float, centre: Array) -> Array:
    body = load_body("default")
    K = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])
    shot = photograph("one", 2 * centre, np.column_stack([pixels, confidence]), {"K": K})
    observed = Observations(tuple(body.landmark_names("coco")), (shot,))
    setup = image_fit(observed, body, "", hypotheses=2)
    assert setup.strategy is not None
    found = setup.strategy(None).solve(setup.problem, setup.start).values
    return body.joints(found["pose"], found["betas"], found["trans"])


WAYS = {
    7: {
        "damped_step": by_normal_equations,
        "gain": over_the_promise,
        "cauchy_point": searched_along,
        "dogleg_step": halved,
        "damping_for": by_bisection,
        "fit": by_scipy,
    },
    11: {
        "effort_until": one_by_one,
        "profile": by_counting,
        "wilson": by_stats,
        "target": lambda start, best, tau: tau * start + (1 - tau) * best,
        "turned_round": lambda: [[2, 5, 9], [3, 4, 7], [8, 7, 1], [9, 6, 2], [5, 4, 1]],
    },
    12: {
        "deviations": by_inverse,
        "interval": sorted_out,
        "next_point": by_ratio,
        "draw": by_halves,
    },
    15: {
        "closest_on_triangle": by_nnls,
        "icp_step": by_brute_force,
        "distance_gradient": by_casadi,
        "robust_weight": lambda d, sigma, scale: (sigma + d**2 * sigma / scale**2) ** -2.0,
        "coupling_residual": by_a_matrix,
        "align": by_point_to_plane,
    },
    16: {
        "torso_depth": side_by_side,
        "keypoint_cost": by_residuals,
        "bending_cost": hinge_by_hinge,
        "mixture_costs": by_scipys_densities,
        "sphere_slope": by_casadis_slope,
        "fitted_joints": from_two_starts,
    },
}


@pytest.mark.parametrize("number", WAYS)
def test_right_answers_by_other_ways_pass(number: int) -> None:
    all_pass(number, WAYS[number])
