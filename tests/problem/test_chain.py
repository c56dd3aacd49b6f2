"""The chain rule gives what the whole graph gives, whatever is free and wherever we stand."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body, smpl_like_body
from tests.tiers import few
from workbench import residuals
from workbench.bodies import SkinnedBody
from workbench.bodies.forward import posed_points
from workbench.residuals import geman_mcclure, huber


def pose_at(where: str, joints: int, rng: np.random.Generator) -> np.ndarray:
    axes = rng.standard_normal((joints, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angle = {"zero": 0.0, "near zero": 1e-7, "pi": np.pi, "anywhere": 0.7}[where]
    return angle * axes


def assert_same(problem: wb.Problem, values: wb.Values) -> None:
    x, fixed = problem.split(values)
    here = problem.linearize_at(x, fixed)  # points and slopes together, where that can be
    alone = problem.residual(x, fixed)
    np.testing.assert_allclose(alone, here.residual, rtol=0, atol=1e-12 * np.abs(alone).max())
    problem.residual(x + 1.0, fixed)
    problem.residual(x, fixed)
    after = problem.linearize_at(x, fixed)  # the points being known
    largest = np.abs(after.jacobian).max()
    np.testing.assert_allclose(after.jacobian, here.jacobian, rtol=0, atol=1e-12 * largest)
    r, J = (np.asarray(part) for part in problem.derivative(x, fixed))
    np.testing.assert_allclose(here.residual, r.ravel(), rtol=1e-11, atol=1e-11 * np.abs(r).max())
    np.testing.assert_allclose(here.jacobian, J, rtol=1e-11, atol=1e-11 * np.abs(J).max())
    cost, gradient = problem.cost_and_gradient(x, fixed)
    np.testing.assert_allclose(cost, here.cost, rtol=1e-12)
    np.testing.assert_allclose(gradient, J.T @ r.ravel(), rtol=0, atol=1e-11 * abs(gradient).max())


@pytest.fixture(scope="module", params=few([(24, 10), (5, 0), (1, 3)], 2), ids=str)
def body(request: pytest.FixtureRequest) -> SkinnedBody:
    K, B = request.param
    if K == 24:
        return smpl_like_body(530, B)
    return random_body(1, n_vertices=530, n_joints=K, n_betas=B)


CHOICES = [("trans", "pose", "betas"), ("pose", "observed"), ("betas", "trans")]
PLACES = [
    pytest.param(where, free)
    for free in CHOICES
    for where in ("anywhere", "near zero", "pi", "zero")
]


@pytest.mark.parametrize("worth_compiling", [1, 10**9], ids=["compiled, if it can be", "NumPy"])
@pytest.mark.parametrize(("where", "free"), few(PLACES, 2), ids=str)
def test_chain_rule_of_vertices_matches_the_graph(
    body: SkinnedBody,
    free: tuple[str, ...],
    where: str,
    worth_compiling: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(posed_points, "WORTH_COMPILING", worth_compiling)
    rng = np.random.default_rng(0)
    pose, betas, trans = (block.symbol for block in body.blocks())
    observed = wb.Block("observed", (body.n_vertices, 3), "m")
    points = body.points(pose, betas, trans)
    terms = [residuals.vertices(points, observed.symbol, sigma=0.003)]
    if "betas" in free and body.n_betas:
        terms.append(residuals.gaussian(betas, covariance=2.0))
    if "betas" in free and not body.n_betas:
        free = tuple(name for name in free if name != "betas")
    values = {
        "pose": pose_at(where, body.n_joints, rng),
        "betas": rng.standard_normal(body.n_betas),
        "trans": rng.standard_normal(3),
        "observed": rng.standard_normal((body.n_vertices, 3)),
    }
    assert_same(wb.Problem(terms, free), values)


@pytest.mark.parametrize("where", few(("anywhere", "near zero", "pi", "zero"), 2))
@pytest.mark.parametrize("kernel", few([geman_mcclure, residuals.quadratic, huber()], 1))
def test_chain_rule_of_landmarks_matches_the_graph(where: str, kernel: residuals.Kernel) -> None:
    body = wb.load_body("small")
    rng = np.random.default_rng(1)
    pose, betas, trans = (block.symbol for block in body.blocks())
    points = body.landmark_points("coco", pose, betas, trans)
    camera = wb.Camera("c/")
    place, pixels = wb.Block("place", (23, 3), "m"), wb.Block("pixels", (23, 2), "px")
    sure = wb.Block("sure", (23,))
    terms = [
        residuals.landmarks(points, place.symbol, sigma=0.01, kernel=kernel),
        residuals.keypoints(points, camera, pixels.symbol, sure.symbol, sigma=5.0, kernel=kernel),
        residuals.gaussian(pose[:, 1:], covariance=0.3),
    ]
    values = {
        "pose": pose_at(where, 24, rng),
        "betas": rng.standard_normal(10),
        "trans": np.array([0.1, 0.2, 4.0]),
        "place": rng.standard_normal((23, 3)),
        "pixels": 500 + 300 * rng.standard_normal((23, 2)),
        "sure": rng.random(23),
        **camera.values(
            K=[[900, 0, 500], [0, 910, 510], [0, 0, 1]], distortion=[0.1, -0.05, 0.01, -0.01, 0.02]
        ),
    }
    free = ("c/focal", "pose", "trans", "c/distortion", "betas", "c/rotation")
    assert_same(wb.Problem(terms, free), values)


def test_chain_rule_of_two_people_of_one_shape() -> None:
    body = smpl_like_body(300, 10, 2)
    rng = np.random.default_rng(2)
    betas = body.blocks()[1]
    terms = []
    for name in ("a/", "b/"):
        pose, _, trans = body.blocks(name)
        points = body.points(pose.symbol, betas.symbol, trans.symbol, vertices=range(0, 300, 3))
        observed = wb.Block(name + "observed", (100, 3), "m")
        terms.append(residuals.vertices(points, observed.symbol, sigma=0.01))
    values = {"betas": rng.standard_normal(10)}
    for name in ("a/", "b/"):
        values |= {
            name + "pose": 0.5 * rng.standard_normal((24, 3)),
            name + "trans": rng.standard_normal(3),
            name + "observed": rng.standard_normal((100, 3)),
        }
    assert_same(wb.Problem(terms, ("b/trans", "a/pose", "betas")), values)


def test_chain_rule_of_free_arrays() -> None:
    plain = random_body(4, n_vertices=40, n_joints=4, n_betas=2)
    trained = plain.freed("weights")
    rng = np.random.default_rng(4)
    terms = []
    for name, body in (("plain/", plain), ("trained/", trained)):
        points = body.points(*(block.symbol for block in body.blocks(name)))
        target = wb.Block(name + "observed", (40, 3), "m")
        terms.append(residuals.vertices(points, target.symbol, sigma=0.1))
    values = plain.start("plain/") | trained.start("trained/")
    values |= {f"{name}/observed": rng.standard_normal((40, 3)) for name in ("plain", "trained")}
    values |= {f"{name}/pose": rng.standard_normal((4, 3)) for name in ("plain", "trained")}
    assert_same(wb.Problem(terms, ("plain/pose", "trained/betas", "weights")), values)


def test_results_are_not_overwritten_later() -> None:
    body = smpl_like_body(30, 10, 5)
    points = body.points(*(block.symbol for block in body.blocks()))
    observed = wb.Block("observed", (30, 3), "m")
    problem = wb.Problem(
        [residuals.vertices(points, observed.symbol, sigma=0.1)], ("pose", "betas", "trans")
    )
    x, fixed = problem.split(body.start() | {"observed": body.template + 0.1})
    first = problem.linearize_at(x, fixed)
    kept = first.residual.copy(), first.jacobian.copy()
    other = problem.linearize_at(x + 0.3, fixed)
    x += 1.0  # the caller's own array, changed in place
    again = problem.linearize_at(x - 1.0, fixed)
    np.testing.assert_array_equal(first.residual, kept[0])
    np.testing.assert_array_equal(first.jacobian, kept[1])
    np.testing.assert_allclose(again.jacobian, kept[1], atol=1e-9)
    assert not np.allclose(other.jacobian, first.jacobian)


def test_threads_may_share_a_body() -> None:
    body = wb.load_body("small")
    poses = 0.3 * np.random.default_rng(6).standard_normal((40, 24, 3))
    alone = [body.vertices(pose) for pose in poses]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(body.vertices, poses))
    np.testing.assert_array_equal(together, alone)


def test_fixed_numbers_may_change() -> None:
    """The values of fixed blocks are kept from call to call, whatever becomes of the array."""
    body = random_body(3, n_vertices=5, n_joints=3, n_betas=2)
    points = body.points(*(block.symbol for block in body.blocks()))
    problem = wb.Problem([residuals.vertices(points, body.template, sigma=1.0)], ["pose", "trans"])
    x, fixed = np.linspace(-1, 1, problem.free.size), np.array([1.0, -2.0])

    def by(betas: list[float]) -> np.ndarray:
        pose, trans = problem.free.unpack(x).values()
        return (body.vertices(pose, np.array(betas), trans) - body.template).ravel()

    np.testing.assert_allclose(problem.residual(x, fixed), by([1.0, -2.0]), atol=1e-13)
    x[0] += 0.5  # at another place with the same fixed numbers, and then in place with others
    np.testing.assert_allclose(problem.residual(x, fixed), by([1.0, -2.0]), atol=1e-13)
    fixed[1] = 3.0
    again = np.array([1.0, -2.0])  # what was kept is a copy, which the line above did not change
    x[0] += 0.5
    np.testing.assert_allclose(problem.residual(x, again), by([1.0, -2.0]), atol=1e-13)
    np.testing.assert_allclose(problem.linearize_at(x, fixed).residual, by([1.0, 3.0]), atol=1e-13)


def test_chain_rule_of_one_symbol_in_two_roles() -> None:
    body = random_body(7, n_betas=3)
    pose, both, _ = (block.symbol for block in body.blocks())
    observed = wb.Block("observed", (body.n_vertices, 3), "m")
    points = body.points(pose, both, both)
    problem = wb.Problem(
        [residuals.vertices(points, observed.symbol, sigma=0.1)], ("pose", "betas")
    )
    values = body.start() | {"observed": body.template + 0.1, "betas": np.array([0.1, 0.2, 0.3])}
    assert_same(problem, values)
