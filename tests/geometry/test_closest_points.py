"""What is read off between a mesh's vertices."""

import numpy as np
import pytest

from workbench.geometry.closest_points import read_off

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def test_what_is_linear_is_read_off_exactly_on_a_flat_mesh() -> None:
    points = np.array([[0.2, 0.7, 0.0], [0.9, 0.1, 0.0]])
    assert read_off(SQUARE, FACES, points) @ SQUARE == pytest.approx(points)


def test_a_point_above_a_mesh_or_beside_it_is_read_off_where_the_mesh_is_closest() -> None:
    points = np.array([[0.2, 0.7, 0.5], [2.0, 0.5, 0.0]])
    rows = read_off(SQUARE, FACES, points)
    assert rows @ SQUARE == pytest.approx(np.array([[0.2, 0.7, 0], [1, 0.5, 0]]))
    assert rows.sum(axis=1) == pytest.approx(1)


def test_a_point_at_a_vertex_follows_it_alone() -> None:
    row = read_off(SQUARE, FACES, np.array([[1 - 1e-6, 1e-6, 0.0]])).toarray()[0]
    assert row.tolist() == [0, 1, 0, 0]
