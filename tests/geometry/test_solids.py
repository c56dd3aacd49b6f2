"""Ways through a surface, and closest places, of shapes that are known."""

import numpy as np
import pytest
import trimesh

from workbench.geometry.solids import ray_crossings
from workbench.geometry.surface_tree import barycentric_weights


def test_ray_crossings_are_chords_of_a_ball() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4)
    eye = np.array([0.013, 0.021, 5.0])
    points = np.array([[0, 0, 0], [0, 0, -2], [0, 0, 2], [3, 0, 0], [0.5, 0, -0.5], [1.1, 0, -2]])
    exits, inside = ray_crossings(eye, points, np.array(ball.vertices), np.array(ball.faces))
    way = points - eye
    # |eye + t way| = 1: two values of t, of which those between 0 and 1 count
    a, b, c = (way**2).sum(axis=1), way @ eye, eye @ eye - 1
    root = np.sqrt(np.maximum(b**2 - a * c, 0))
    first, last = (-b - root) / a, (-b + root) / a
    chord = np.clip(last, 0, 1) - np.clip(first, 0, 1)
    np.testing.assert_allclose(inside, chord * np.sqrt(a), atol=0.01)
    np.testing.assert_array_equal(exits, (root > 0) & (last < 1) & (last > 0))
    assert list(exits) == [0, 1, 0, 0, 0, 1]


SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def test_read_off_is_exact_on_a_flat_mesh() -> None:
    points = np.array([[0.2, 0.7, 0.0], [0.9, 0.1, 0.0]])
    assert barycentric_weights(SQUARE, FACES, points) @ SQUARE == pytest.approx(points)


def test_read_off_takes_the_closest_place() -> None:
    points = np.array([[0.2, 0.7, 0.5], [2.0, 0.5, 0.0]])
    rows = barycentric_weights(SQUARE, FACES, points)
    assert rows @ SQUARE == pytest.approx(np.array([[0.2, 0.7, 0], [1, 0.5, 0]]))
    assert rows.sum(axis=1) == pytest.approx(1)


def test_read_off_at_a_vertex_follows_it_alone() -> None:
    row = barycentric_weights(SQUARE, FACES, np.array([[1 - 1e-6, 1e-6, 0.0]])).toarray()[0]
    assert row.tolist() == [0, 1, 0, 0]
