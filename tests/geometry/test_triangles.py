"""Deformed triangles and the meshes they are stitched into, against closed forms."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadMesh
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.triangles import (
    Stitching,
    edges,
    gradient_derivatives,
    gradients,
)

BODY = wb.load_body("small")
FACES, TEMPLATE = BODY.faces, BODY.template
STITCHING = Stitching(FACES, BODY.n_vertices)
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
PAIR = np.vstack([TETRAHEDRON, TETRAHEDRON + 4])  # two components
TURN = matrix_from_vector([0.4, -2.0, 1.1])


def some_pose(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(scale=0.4, size=(24, 3))


# Frames and gradients.


def test_gradients_of_a_similarity_are_found() -> None:
    moved = 1.7 * TEMPLATE @ TURN.T + [3.0, 2.0, 1.0]
    found = gradients(TEMPLATE, moved, FACES)
    np.testing.assert_allclose(found, np.broadcast_to(1.7 * TURN, found.shape), atol=1e-11)


def test_slopes_of_gradients_are_those_of_differences() -> None:
    directions = BODY.shapedirs[:, :, :3]
    slopes, h = gradient_derivatives(TEMPLATE, directions, FACES), 1e-4
    for b in range(3):
        sides = (
            gradients(TEMPLATE, TEMPLATE + s * h * directions[:, :, b], FACES) for s in (1, -1)
        )
        np.testing.assert_allclose(slopes[..., b], np.subtract(*sides) / (2 * h), atol=1e-6)
    shaped = gradients(TEMPLATE, TEMPLATE + 3 * directions[:, :, 1], FACES)
    e = edges(TEMPLATE, FACES).transpose(0, 2, 1)  # in the plane they hold at any distance
    np.testing.assert_allclose(shaped @ e, (np.eye(3) + 3 * slopes[..., 1]) @ e, atol=1e-12)


def test_face_without_area_is_refused() -> None:
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    with pytest.raises(BadMesh, match=r"face 1 of the template has no area \(1 such faces\)"):
        gradients(flat, flat, np.array([[0, 1, 3], [0, 1, 2]]))


# Stitching.


def test_gradients_reconstruct_a_posed_mesh() -> None:
    posed = BODY.vertices(some_pose(), np.linspace(-2, 2, 10))
    X = gradients(TEMPLATE, posed, FACES)
    found = STITCHING.vertices(np.einsum("fab,fib->fia", X, edges(TEMPLATE, FACES)))
    np.testing.assert_allclose(found, posed - posed.mean(axis=0), atol=1e-10)


def test_stitching_is_the_least_squares_solution() -> None:
    wanted = np.random.default_rng(1).normal(size=(8, 2, 3))
    stitching = Stitching(PAIR, 8)
    assert stitching.n_components == 2
    A = stitching.A.toarray()
    pinned = np.vstack([A, np.repeat(np.eye(2), 4, axis=1) / 4])  # exact: rank 6 + 2
    centroids = np.array([[0.0, 0, 0], [5, 5, 5]])
    expected = np.linalg.lstsq(A, wanted.reshape(16, 3))[0]
    expected += np.repeat(centroids, 4, axis=0)  # the shortest solution has its means at 0
    found = stitching.vertices(wanted, centroids)
    np.testing.assert_allclose(found, expected, atol=1e-13)
    assert np.linalg.matrix_rank(A) == 6
    assert np.linalg.matrix_rank(pinned) == 8


def test_symbols_are_stitched_like_numbers() -> None:
    pulls = np.random.default_rng(2).normal(size=(BODY.n_vertices, 3))
    x = cs.MX.sym("x", *pulls.shape)
    f = cs.Function("f", [x], [STITCHING.solve_symbolic(x)])
    np.testing.assert_allclose(np.asarray(f(pulls)), STITCHING.solve(pulls), atol=1e-11)
    two = Stitching(PAIR, 8)
    x = cs.MX.sym("x", 8, 2)
    f = cs.Function("f", [x], [two.solve_symbolic(x)])
    np.testing.assert_allclose(np.asarray(f(pulls[:8, :2])), two.solve(pulls[:8, :2]), atol=1e-14)


def test_faces_that_are_none_are_refused() -> None:
    for faces in (np.zeros((0, 3), int), np.zeros((2, 4), int), np.array([[0, 1, 4]])):
        with pytest.raises(BadMesh):
            Stitching(faces, 4)


# Its null space, by name.
