"""Kernels of norms: a point is an outlier or is none, whichever way the axes point."""

from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.bodies_made_up import random_body
from workbench import Block, Camera, Problem, Residual, residuals
from workbench.errors import BadResidual
from workbench.residuals import Kernel, geman_mcclure, huber, of_norms, quadratic

ROBUST: dict[str, Kernel] = {"geman-mcclure": geman_mcclure, "huber": huber(0.7)}
ALL = ROBUST | {"quadratic": quadratic}
EACH = pytest.mark.parametrize("kernel", ALL.values(), ids=list(ALL))
EACH_ROBUST = pytest.mark.parametrize("kernel", ROBUST.values(), ids=list(ROBUST))
SEEN = np.random.default_rng(0).normal(size=(7, 3))  # m
AT = SEEN + np.linspace(0.1, 2.0, 7)[:, None] * np.random.default_rng(1).normal(size=(7, 3))
SIGMA = 0.8  # m: some of them are outliers and some are not
POINTS = Block("points", (7, 3), "m")
K = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]


def cost(kernel: Kernel, at: np.ndarray, seen: np.ndarray = SEEN, **further: Any) -> float:
    term = Residual(
        "points",
        cs.vec(POINTS.symbol - cs.DM(seen.T)),
        SIGMA,
        "m",
        kernel,
        rows_per_point=3,
        **further,
    )
    return Problem([term], "points").linearize({"points": at}).cost


def rho(kernel: Kernel, s: np.ndarray) -> np.ndarray:
    """rho(s) of numbers, by the factor that a kernel is."""
    x = cs.MX.sym("x", len(s))
    return np.asarray(cs.Function("rho", [x], [kernel(x) ** 2 * x])(s)).ravel()


@EACH
def test_the_cost_is_half_of_rho_of_the_squared_distances(kernel: Kernel) -> None:
    s = np.sum((AT - SEEN) ** 2, axis=1) / SIGMA**2
    assert s.min() < 0.7**2 < s.max() or kernel is quadratic  # both sides of Huber's border
    assert cost(of_norms(kernel), AT) == pytest.approx(0.5 * rho(kernel, s).sum(), rel=1e-13)
    trust = np.random.default_rng(2).uniform(0.0, 2.0, 7)
    weighed = cost(of_norms(kernel), AT, weights=trust)
    assert weighed == pytest.approx(0.5 * trust @ rho(kernel, s), rel=1e-13)


@EACH_ROBUST
def test_a_kernel_of_norms_does_not_know_the_axes(kernel: Kernel) -> None:
    R = Rotation.from_rotvec([0.4, -0.9, 0.6]).as_matrix()
    norms, rows = of_norms(kernel), kernel
    assert cost(norms, AT @ R.T, SEEN @ R.T) == pytest.approx(cost(norms, AT), rel=1e-13)
    assert abs(cost(rows, AT @ R.T, SEEN @ R.T) / cost(rows, AT) - 1) > 1e-3


@EACH
def test_with_one_coordinate_off_both_are_the_same(kernel: Kernel) -> None:
    at = SEEN.copy()
    at[np.arange(7), np.arange(7) % 3] += np.linspace(-2.0, 2.0, 7)
    assert cost(of_norms(kernel), at) == pytest.approx(cost(kernel, at), rel=1e-14)


def test_squares_stay_squares() -> None:
    term = residuals.vertices(POINTS.symbol, SEEN, sigma=SIGMA)
    other = residuals.vertices(POINTS.symbol, SEEN, sigma=SIGMA, kernel=of_norms(quadratic))
    here, there = (Problem([r], "points").linearize({"points": AT}) for r in (term, other))
    np.testing.assert_array_equal(there.residual, here.residual)
    np.testing.assert_array_equal(there.jacobian, here.jacobian)


@EACH_ROBUST
def test_gauss_newton_sees_three_directions_of_every_point(kernel: Kernel) -> None:
    """By the product rule: g across the residual, and the slope of |r| g(|r|^2) along it."""
    problem = Problem(
        [Residual("p", cs.vec(POINTS.symbol), 1.0, "m", of_norms(kernel), rows_per_point=3)],
        "points",
    )
    at = np.random.default_rng(1).normal(size=(7, 3))
    at[0] = 0.0  # where |r| has no derivative
    J = problem.linearize({"points": at}).jacobian
    x = cs.MX.sym("x")
    g = cs.Function("g", [x], [kernel(x**2), cs.gradient(kernel(x**2) * x, x)])
    for i, r in enumerate(at):
        own = J[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        across, along = (float(v) for v in g(np.linalg.norm(r)))
        n = r / (np.linalg.norm(r) or 1.0)
        expected = across * np.eye(3) + (along - across) * np.outer(n, n)
        np.testing.assert_allclose(own, expected, rtol=1e-12, atol=1e-14)
        assert np.linalg.matrix_rank(own) == 3
        J[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = 0.0
    assert not J.any()  # points do not know each other
    np.testing.assert_array_equal(problem.linearize({"points": 0 * at}).jacobian, np.eye(21))


@pytest.mark.parametrize("share", [0.2, 0.4])
def test_wrong_points_move_the_place_of_a_body_hardly(share: float) -> None:
    """All wrong points lie to one side; the mean, which squares find, is off by their share."""
    rng = np.random.default_rng(3)
    N, place = 200, Block("place", (3,), "m")
    seen = 0.01 * rng.standard_normal((N, 3))
    wrong = rng.permutation(N) < share * N
    seen[wrong] += np.array([3.0, 2.0, -1.0])
    found = {}
    for name, kernel in (ALL | {"geman-mcclure": geman_mcclure, "huber": huber()}).items():
        term = residuals.vertices(
            cs.repmat(place.symbol, 1, N), seen, sigma=0.1, kernel=of_norms(kernel)
        )
        problem, x = Problem([term], "place"), np.zeros(3)
        for _ in range(100):
            x = x + problem.linearize({"place": x}).step()
        found[name] = float(np.linalg.norm(x))
    assert found["quadratic"] == pytest.approx(share * np.sqrt(14), rel=0.02)
    # Huber: wrong points pull with share N k / s at the most, right ones back with (1 - share) N x
    # / s^2, from their own mean, which is off by 0.01 sqrt(3 / 120) = 0.0016 m at the most or so
    assert found["huber"] < 0.1 * 1.345 * share / (1 - share) + 0.004
    assert found["geman-mcclure"] < 0.01


def test_a_point_that_is_wrong_in_x_is_not_believed_in_y() -> None:
    """Per coordinate the small error in y pulls as hard as if x were right."""
    at = np.zeros((7, 3))
    seen = np.tile([50.0, 0.05, 0.0], (7, 1))
    pull = {}
    for name, kernel in (("norms", of_norms(geman_mcclure)), ("rows", geman_mcclure)):
        term = residuals.vertices(POINTS.symbol, seen, sigma=SIGMA, kernel=kernel)
        pull[name] = abs(Problem([term], "points").linearize({"points": at}).gradient[1])
    assert pull["norms"] < 1e-6 * pull["rows"]


def test_keypoints_and_edges_keep_one_weight_for_each_point() -> None:
    camera, points = Camera(), Block("points", (4, 3), "m")
    rng = np.random.default_rng(0)
    at = {"points": 0.3 * rng.normal(size=(4, 3))} | camera.values(K=K, t=(0, 0, 3.0))
    off = 8.0 * rng.normal(size=(4, 2))  # px
    seen, trust = camera.pixels(at["points"], at) - off, np.array([1.0, 0.5, 0.0, 2.0])
    term = residuals.keypoints(
        points.symbol, camera, seen, trust, sigma=5.0, kernel=of_norms(geman_mcclure)
    )
    s = np.sum(off**2, axis=1) / 25
    found = Problem([term], "points").linearize(at).cost
    assert found == pytest.approx(0.5 * trust @ (s / (1 + s)), rel=1e-10)
    pairs = [[0, 1], [2, 3], [1, 3]]
    edges = residuals.edges(
        points.symbol,
        np.zeros((4, 3)),
        pairs,
        sigma=0.1,
        confidence=trust[:3],
        kernel=of_norms(geman_mcclure),
    )
    lengths = np.array([at["points"][a] - at["points"][b] for a, b in pairs])
    s = np.sum(lengths**2, axis=1) / 0.01
    assert Problem([edges], "points").linearize(at).cost == pytest.approx(
        0.5 * trust[:3] @ (s / (1 + s)), rel=1e-12
    )


@EACH
def test_a_sigma_of_each_point_is_that_of_its_coordinates(kernel: Kernel) -> None:
    each = np.linspace(0.1, 2.0, 7)
    at = {"points": np.random.default_rng(1).normal(size=(7, 3))}
    made = [
        residuals.vertices(POINTS.symbol, SEEN, sigma=sigma, kernel=of_norms(kernel))
        for sigma in (each, np.repeat(each, 3))
    ]
    one, other = (Problem([term], "points").linearize(at) for term in made)
    np.testing.assert_array_equal(one.residual, other.residual)
    assert made[0].size == 21


def test_the_fast_path_agrees_with_the_whole_graph() -> None:
    body = random_body(n_vertices=40, n_joints=4, n_betas=2)
    symbols = [block.symbol for block in body.blocks()]
    rng = np.random.default_rng(0)
    seen = body.template + 0.2 * rng.normal(size=(40, 3))
    term = residuals.vertices(body.points(*symbols), seen, sigma=0.1, kernel=of_norms(huber()))
    problem = Problem([term], ("pose", "betas", "trans"))
    x = 0.3 * rng.normal(size=problem.free.size)
    values = problem.free.unpack(x)
    exact = np.asarray(problem.derivative(x, np.zeros(0))[1])
    here = problem.linearize(values)
    # both are sums of the same few hundred products of numbers of order one, over sigma = 0.1
    np.testing.assert_allclose(here.jacobian, exact, rtol=0, atol=1e-11)
    X = x + 0.1 * rng.normal(size=(5, x.size))
    one_by_one = [problem.linearize(problem.free.unpack(row)).cost for row in X]
    np.testing.assert_allclose(problem.costs(x, np.zeros(0))(X), one_by_one, rtol=1e-12)


@pytest.mark.parametrize(
    ("further", "text"),
    [
        ({"rows_per_point": 1}, "each of its rows stands alone; say rows_per_point=3"),
        ({"rows_per_point": 4}, "21 rows, which are no points of 4 rows each"),
        ({"rows_per_point": 0}, "21 rows, which are no points of 0 rows each"),
        ({"rows_per_point": 3.0}, r"21 rows, which are no points of 3\.0 rows each"),
        (
            {"weights": np.ones(21)},
            r"one weight or 7 of them, not an array of shape \(21,\); its "
            "kernel is one of norms, and a point has one weight",
        ),
        ({"weights": cs.MX.sym("w", 21)}, "a point has one weight"),
        ({"sigma": np.ones(3)}, r"row \(21\) or point \(7\)"),
    ],
)
def test_points_that_are_none_are_refused(further: dict[str, Any], text: str) -> None:
    given = {"sigma": 1.0, "kernel": of_norms(huber()), "rows_per_point": 3} | further
    with pytest.raises(BadResidual, match=text):
        Residual("points", cs.vec(POINTS.symbol), **given)


@pytest.mark.parametrize("kernel", [2.0, "huber", of_norms(huber())])
def test_only_kernels_of_numbers_have_norms(kernel: Any) -> None:
    with pytest.raises(BadResidual, match="of_norms takes a kernel of single numbers"):
        of_norms(kernel)
