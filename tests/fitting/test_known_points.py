"""Fits to known points: meshes with known correspondences, and hands."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import workbench as wb
from builder.hands.sets import HandPoses
from tests.tiers import few
from workbench.bodies import SkinnedBody, pose_space
from workbench.bodies.catalogue import load_body, load_skinned
from workbench.errors import BadBody, BadFile, NonFiniteValue, ShapeMismatch
from workbench.experiments import Setup
from workbench.experiments.body_fits import known_correspondences
from workbench.fitting import BadObservation, hand_problem, hand_start, pose_prior
from workbench.fitting.body_priors import BESIDE_SPACE, pose_gaussian
from workbench.fitting.hands import points_of
from workbench.fitting.known_points import from_correspondences, own_mesh
from workbench.geometry.meshes import read_mesh, read_registered, write_mesh
from workbench.geometry.rotation import matrix_from_vector
from workbench.solvers import SOLVERS

BENT = (0.3, 0.6, 1.0, 1.5)  # rad


@pytest.fixture(scope="module")
def setup() -> Setup:
    return known_correspondences("small")


def person(body: SkinnedBody, seed: int, pose_sigma: float) -> np.ndarray:
    """The vertices of `known_correspondences` with this seed."""
    rng = np.random.default_rng(seed)
    pose = pose_sigma * rng.standard_normal((body.n_joints, 3))
    return body.vertices(pose, rng.standard_normal(body.n_betas))


def test_start_of_a_moved_body_is_exact() -> None:
    body, pose, trans = load_body("small"), np.zeros((24, 3)), np.array([0.3, -1.0, 2.0])
    pose[0] = [0.5, 2.0, -1.0]
    found = from_correspondences(body, body.vertices(pose, None, trans))
    turn = matrix_from_vector(found["pose"][0])
    np.testing.assert_allclose(turn, matrix_from_vector(pose[0]), atol=1e-12)
    np.testing.assert_allclose(found["pose"][1:], 0, atol=1e-12)
    np.testing.assert_allclose(found["betas"], 0, atol=1e-10)
    np.testing.assert_allclose(found["trans"], trans, atol=1e-12)


def test_start_is_equivariant_under_rigid_motions() -> None:
    body = load_body("small")
    mesh = person(body, 0, 0.6)
    here = from_correspondences(body, mesh)
    R, t = matrix_from_vector([0.5, -1.0, 2.0]), np.array([1.0, 2.0, -3.0])
    there = from_correspondences(body, mesh @ R.T + t)
    np.testing.assert_allclose(there["pose"][1:], here["pose"][1:], atol=1e-9)
    np.testing.assert_allclose(there["betas"], here["betas"], atol=1e-8)
    moved = body.vertices(**here) @ R.T + t
    np.testing.assert_allclose(body.vertices(**there), moved, atol=1e-9)


@pytest.mark.parametrize("pose_sigma", few(BENT, 1))
def test_start_is_near_and_has_sensible_betas(pose_sigma: float) -> None:
    body = load_body("small")
    for seed in range(4):
        mesh = person(body, seed, pose_sigma)
        found = from_correspondences(body, mesh)
        off = np.sqrt(np.mean(np.sum((body.vertices(**found) - mesh) ** 2, axis=1)))
        rest = np.sqrt(np.mean(np.sum((body.vertices() - mesh) ** 2, axis=1)))
        assert off < 0.08 < 0.15 < rest  # m
        assert np.abs(found["betas"]).max() < 5
        assert (np.linalg.norm(found["pose"], axis=1) <= np.pi + 1e-12).all()


def solved(setup: Setup, seed: int, pose_sigma: float) -> bool:
    body = setup.body
    assert body is not None
    mesh = person(body, seed, pose_sigma)
    start = setup.start | from_correspondences(body, mesh) | {"observed": mesh}
    solution = SOLVERS["levenberg-marquardt"].solve(setup.problem, start)
    return solution.converged and np.abs(body.vertices(**solution.values) - mesh).max() < 1e-6


@pytest.mark.parametrize(
    ("count", "pose_sigma"),
    [(2, 1.0), *(pytest.param(20, sigma, marks=pytest.mark.thorough) for sigma in BENT)],
)
def test_meshes_are_recovered_from_the_closed_form_start(
    setup: Setup, count: int, pose_sigma: float
) -> None:
    assert [seed for seed in range(count) if not solved(setup, seed, pose_sigma)] == []


def test_meshes_of_other_vertices_are_refused() -> None:
    body = load_body("small")
    mesh = body.vertices()
    with pytest.raises(ShapeMismatch, match=r"has shape \(369, 3\), but was given \(100, 3\)"):
        from_correspondences(body, mesh[:100])
    mesh[3, 1] = np.nan
    with pytest.raises(NonFiniteValue, match=r"observed.*\[3, y\]"):
        from_correspondences(body, mesh)


def test_stl_has_lost_its_vertex_order(tmp_path: Path) -> None:
    """A soup of as many corners as the body has vertices would be fitted vertex by vertex."""
    body = load_body("small")
    N = body.n_vertices
    assert N % 3 == 0
    write_mesh(tmp_path / "a.stl", body.template, body.faces[: N // 3])
    assert len(read_mesh(tmp_path / "a.stl").vertices) == N
    for read in (read_registered, lambda path: own_mesh(path, body, 0.002)):
        with pytest.raises(BadFile, match=r"which vertex is which is lost; give the mesh as \.glb"):
            read(tmp_path / "a.stl")


def test_faces_of_another_mesh_are_noted(tmp_path: Path) -> None:
    body = load_body("small")
    turned = np.roll(body.faces[::-1], 1, axis=1)  # the same faces, written otherwise
    write_mesh(tmp_path / "a.ply", body.template, turned)
    assert own_mesh(tmp_path / "a.ply", body, 0.002).notes == ()
    other = body.faces.copy()
    other[0] = other[0][[0, 2, 1]]
    write_mesh(tmp_path / "b.ply", body.template, other)
    setup: Setup = own_mesh(tmp_path / "b.ply", body, 0.002)
    assert "could not be checked" in setup.notes[0]


def test_vertices_without_faces_are_fitted(tmp_path: Path) -> None:
    body = load_skinned("small")
    lines = [f"v {x} {y} {z}" for x, y, z in body.template]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    setup = own_mesh(tmp_path / "a.obj", body, 0.002)
    assert "could not be checked" in setup.notes[0]
    (tmp_path / "a.obj").write_text("\n".join(lines[1:]))
    with pytest.raises(BadFile, match=r"368 vertices.*`workbench register` takes a scan"):
        own_mesh(tmp_path / "a.obj", body, 0.002)


HAND = load_skinned("hand")
NOISE = 0.002  # m
OF_HAND = ("pose", "betas", "trans")


def drawn(count: int, seed: int) -> list[wb.Values]:
    """Hands in poses that nothing was learned from, turned any way."""
    rng = np.random.default_rng(seed)
    poses = HandPoses(HAND.joints(), HAND.landmark("tips")).draw(count, rng)
    poses[:, 0] = Rotation.random(count, random_state=rng).as_rotvec()
    return [
        {"pose": pose, "betas": rng.standard_normal(10), "trans": rng.standard_normal(3)}
        for pose in poses
    ]


def hand_surface(values: wb.Values) -> np.ndarray:
    return HAND.vertices(*(values[name] for name in OF_HAND))


def test_noisy_points_find_a_hand_within_millimetres() -> None:
    problem, rng = hand_problem(HAND), np.random.default_rng(8)
    medians, means = [], []
    for truth in drawn(4, 7):
        seen = points_of(HAND, truth) + NOISE * rng.standard_normal((21, 3))
        solution = wb.solve(problem, hand_start(HAND, seen))
        assert solution.converged
        off = 1e3 * np.linalg.norm(hand_surface(solution.values) - hand_surface(truth), axis=1)
        medians.append(np.median(off))
        means.append(off.mean())
    assert np.median(medians) < 2.3  # 2 in the mean over 100 hands
    assert max(means) < 6


def test_joints_alone_find_a_hand() -> None:
    (truth,) = drawn(1, 9)
    start = hand_start(HAND, HAND.joints(*(truth[name] for name in OF_HAND)))
    assert start["seen"].sum() == 16
    found = wb.solve(hand_problem(HAND), start).values
    off = 1e3 * np.linalg.norm(points_of(HAND, found) - points_of(HAND, truth), axis=1)
    assert np.median(off) < 1
    away = 1e3 * np.linalg.norm(hand_surface(found) - hand_surface(truth), axis=1)
    assert np.median(away) < 2


def test_unseen_points_of_a_hand_do_not_count() -> None:
    seen = points_of(HAND, drawn(1, 11)[0])
    seen[5] = np.nan
    start, problem = hand_start(HAND, seen), hand_problem(HAND)
    assert start["seen"][5] == 0
    moved = start | {"observed": np.nan_to_num(seen, nan=7.0)}
    np.testing.assert_allclose(problem.linearize(start).cost, problem.linearize(moved).cost)


def test_bad_hand_points_are_refused() -> None:
    with pytest.raises(BadObservation, match=r"\(21, 3\) in the order"):
        hand_start(HAND, np.zeros((20, 3)))
    few = np.full((21, 3), np.nan)
    few[:2] = 0.0
    with pytest.raises(BadObservation, match="2 points of a hand are known"):
        hand_start(HAND, few)
    with pytest.raises(BadBody, match="'small' is no hand"):
        hand_problem(load_skinned("small"))


def test_hand_prior_is_that_of_its_pose_space() -> None:
    mean, covariance = pose_gaussian(HAND)
    space = pose_space(HAND)
    np.testing.assert_allclose(mean, space.mean)
    sizes = np.sqrt(np.linalg.eigvalsh(covariance)[::-1][:10] - BESIDE_SPACE**2)
    np.testing.assert_allclose(sizes, space.deviations[:10], rtol=1e-3)
    problem = wb.Problem([pose_prior(HAND)], ("pose",))
    along = space.poses(HAND, np.concatenate([space.deviations[:1], np.zeros(44)]))
    cost = problem.linearize({"pose": along}).cost
    expected = 0.5 * space.deviations[0] ** 2 / (space.deviations[0] ** 2 + BESIDE_SPACE**2)
    assert cost == pytest.approx(expected, rel=1e-3)
