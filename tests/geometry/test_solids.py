"""Closest places of shapes that are known."""

import numpy as np
import pytest

from workbench.geometry.surface_tree import barycentric_weights

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
