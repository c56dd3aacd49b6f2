"""The closed-form start of a fit to a mesh: what it finds exactly, and what is solved from it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_body
from workbench.errors import NonFiniteValue, ShapeMismatch, UnknownName
from workbench.experiments import Setup, find
from workbench.experiments.correspondences import known_correspondences
from workbench.fitting.mesh_start import STARTS, from_correspondences
from workbench.geometry.rotation import matrix_from_vector
from workbench.solvers import SOLVERS, solve

BENT = (0.3, 0.6, 1.0, 1.5)  # rad


@pytest.fixture(scope="module")
def setup() -> Setup:
    return known_correspondences("small")


def person(body: SkinnedBody, seed: int, pose_sigma: float) -> np.ndarray:
    """The vertices of `known_correspondences` with this seed."""
    rng = np.random.default_rng(seed)
    pose = pose_sigma * rng.standard_normal((body.n_joints, 3))
    return body.vertices(pose, rng.standard_normal(body.n_betas))


@pytest.mark.parametrize("seed", range(3))
def test_a_body_that_is_only_moved_is_found_exactly(seed: int) -> None:
    body = load_body("small")
    rng = np.random.default_rng(seed)
    pose = np.zeros((24, 3))
    pose[0] = 1.5 * rng.standard_normal(3)
    trans = rng.standard_normal(3)
    found = from_correspondences(body, body.vertices(pose, None, trans))
    turn = matrix_from_vector(found["pose"][0])
    np.testing.assert_allclose(turn, matrix_from_vector(pose[0]), atol=1e-12)
    np.testing.assert_allclose(found["pose"][1:], 0, atol=1e-12)
    np.testing.assert_allclose(found["betas"], 0, atol=1e-10)
    np.testing.assert_allclose(found["trans"], trans, atol=1e-12)


def test_parts_that_are_rigid_are_found_exactly_in_any_bind_pose() -> None:
    """With one joint to each vertex, and no blend shapes, Procrustes knows all there is."""
    rng = np.random.default_rng(0)
    body = random_body(1, n_vertices=60, n_joints=5, n_betas=2)
    weights = np.eye(5)[np.arange(60) % 5]
    rigid = replace(
        body,
        weights=weights,
        posedirs=0 * body.posedirs,
        shapedirs=0 * body.shapedirs,
        bound_in=rng.standard_normal((5, 3)),
    )
    pose, trans = rng.uniform(-1, 1, (5, 3)), rng.standard_normal(3)
    found = from_correspondences(rigid, rigid.vertices(pose, None, trans))
    np.testing.assert_allclose(found["pose"], pose, atol=1e-10)
    np.testing.assert_allclose(found["trans"], trans, atol=1e-10)


def test_a_joint_that_moves_no_vertex_stays_as_at_rest() -> None:
    body = random_body(1, n_vertices=60, n_joints=5, n_betas=2)
    weights = np.eye(5)[np.arange(60) % 4]  # none for the last
    resting = np.random.default_rng(1).standard_normal((5, 3))
    blind = replace(body, weights=weights, bound_in=resting)
    found = from_correspondences(blind, blind.vertices())
    assert np.isfinite(found["pose"]).all()
    np.testing.assert_allclose(
        matrix_from_vector(found["pose"][4]), matrix_from_vector(resting[4]), atol=1e-10
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_turned_and_moved_mesh_only_turns_the_root_and_moves_trans(seed: int) -> None:
    body = load_body("small")
    mesh = person(body, seed, 0.6)
    here = from_correspondences(body, mesh)
    R, t = matrix_from_vector([0.5, -1.0, 2.0]), np.array([1.0, 2.0, -3.0])
    there = from_correspondences(body, mesh @ R.T + t)
    np.testing.assert_allclose(there["pose"][1:], here["pose"][1:], atol=1e-9)
    np.testing.assert_allclose(there["betas"], here["betas"], atol=1e-8)
    moved = body.vertices(**here) @ R.T + t
    np.testing.assert_allclose(body.vertices(**there), moved, atol=1e-9)


@pytest.mark.parametrize("pose_sigma", BENT)
def test_it_is_a_few_centimetres_off_and_betas_stay_sensible(pose_sigma: float) -> None:
    body = load_body("small")
    for seed in range(10):
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


@pytest.mark.parametrize("pose_sigma", BENT)
def test_sixty_persons_of_sixty_are_recovered_from_it(setup: Setup, pose_sigma: float) -> None:
    assert [seed for seed in range(60) if not solved(setup, seed, pose_sigma)] == []


def test_the_experiment_takes_a_start_by_name() -> None:
    chosen = {"body": "small", "pose_sigma": "1.5", "seed": "7"}
    begun = {
        name: find("known-correspondences", chosen | {"start": name}).setup() for name in STARTS
    }
    costs = {name: one.problem.linearize(one.start).cost for name, one in begun.items()}
    assert costs["procrustes"] < costs["placed"] < costs["zero"]
    assert (begun["zero"].start["pose"] == 0).all()
    known = begun["procrustes"].known
    assert known is not None
    assert known.values is not None
    at_truth = begun["procrustes"].start | known.values
    assert begun["procrustes"].problem.linearize(at_truth).cost < 1e-18
    assert known.cost == 0
    with pytest.raises(UnknownName, match="'near'; there are placed, procrustes, zero"):
        find("known-correspondences", chosen | {"start": "near"}).setup()
    assert find("known-correspondences", chosen | {"noise": "0.001"}).setup().known is None


def test_another_mesh_is_refused() -> None:
    body = load_body("small")
    mesh = body.vertices()
    with pytest.raises(ShapeMismatch, match=r"has shape \(369, 3\), but was given \(100, 3\)"):
        from_correspondences(body, mesh[:100])
    mesh[3, 1] = np.nan
    with pytest.raises(NonFiniteValue, match=r"observed.*\[3, y\]"):
        from_correspondences(body, mesh)


@pytest.mark.parametrize(("pose_sigma", "at_least"), [(0.3, 60), (0.6, 60), (1.0, 58)])
def test_of_sixty_persons_so_many_are_recovered_from_zero(
    setup: Setup, pose_sigma: float, at_least: int
) -> None:
    body = setup.body
    assert body is not None
    found = 0
    for seed in range(60):
        mesh = person(body, seed, pose_sigma)
        solution = solve(setup.problem, setup.start | {"observed": mesh})
        found += bool(np.abs(body.vertices(**solution.values) - mesh).max() < 1e-6)
    assert found >= at_least
