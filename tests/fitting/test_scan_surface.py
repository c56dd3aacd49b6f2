"""Normals, areas and boundaries of scans against surfaces that are known."""

import numpy as np
import pytest
import trimesh

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.fitting import Scan, loose_points
from workbench.fitting.scans.scan import areas_of_faces
from workbench.fitting.scans.surface import (
    areas_of_neighbours,
    boundary,
    normals_of_neighbours,
    towards,
)
from workbench.geometry.solids import vertex_normals


def on_a_sphere(n: int, seed: int = 0) -> Array:
    found = np.random.default_rng(seed).normal(size=(n, 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def test_normals_of_a_sphere_are_its_points() -> None:
    points = on_a_sphere(5000)
    from_outside = np.sign((normals_of_neighbours(points) * points).sum(axis=1))
    normals = from_outside[:, None] * normals_of_neighbours(points)
    off = np.degrees(np.arccos((normals * points).sum(axis=1).clip(-1, 1)))
    assert (np.median(off) < 2) & (off.max() < 10)
    np.testing.assert_allclose(-normals, towards(normals, points, np.zeros(3)), atol=0)
    mesh = trimesh.creation.icosphere(subdivisions=4)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    np.testing.assert_allclose(vertex_normals(vertices, faces), vertices, atol=8e-3)
    areas = areas_of_faces(vertices, faces)
    np.testing.assert_allclose(areas.sum(), mesh.area, rtol=1e-12)
    np.testing.assert_allclose(areas @ vertices[:, 2] ** 2, 4 * np.pi / 3, rtol=5e-3)


def test_weighted_sums_are_integrals_at_any_density() -> None:
    """Of z + 1 and of z^2 over the unit sphere, sampled three times as densely at the top."""
    n = 8000
    points = on_a_sphere(3 * n, seed=1)
    keep = np.random.default_rng(2).random(len(points)) < (2 + points[:, 2]) / 3
    points = points[keep]
    w = areas_of_neighbours(points)
    sums = w.sum(), w @ (points[:, 2] + 1), 3 * w @ points[:, 2] ** 2
    assert sums == pytest.approx([4 * np.pi] * 3, rel=3 / np.sqrt(n))
    plain = 4 * np.pi * (points[:, 2] + 1).mean()
    assert plain > 1.1 * 4 * np.pi  # without weights the dense side counts too much


def test_boundary_of_a_hemisphere_is_its_rim() -> None:
    points = on_a_sphere(12000, seed=3)
    points = points[points[:, 2] > 0]
    found = boundary(Scan(points))
    near = points[:, 2] < 0.01
    assert found[near].mean() > 0.6
    assert found[points[:, 2] > 0.1].mean() < 0.001
    wide = boundary(Scan(points), width=0.2)
    assert wide[points[:, 2] < 0.15].mean() > 0.99
    assert not wide[points[:, 2] > 0.35].any()


def test_boundary_of_a_mesh_has_edges_of_one_face() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=3)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    assert not boundary(Scan(vertices, faces=faces)).any()
    half = faces[(vertices[faces][:, :, 2] > -1e-9).all(axis=1)]
    found = boundary(Scan(vertices, faces=half))
    edges = np.sort(half[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    alone = edges[trimesh.grouping.group_rows(edges, require_count=1)]
    np.testing.assert_array_equal(np.flatnonzero(found), np.unique(alone))
    assert 0 < found.sum() < 0.2 * len(vertices)
    with pytest.raises(BadArgument, match="width of a boundary"):
        boundary(Scan(vertices), width=-1)


GRID = np.stack(np.meshgrid(*[np.arange(20.0)] * 2, [0.0]), axis=-1).reshape(-1, 3)
UP = np.tile([0.0, 0.0, 1.0], (len(GRID), 1))


def test_points_beside_a_surface_are_loose() -> None:
    away = np.random.default_rng(0).uniform(3, 30, (20, 3))
    points = np.vstack([GRID, away])
    found = loose_points(Scan(points))
    np.testing.assert_array_equal(found, np.arange(len(points)) >= len(GRID))
    order = np.random.default_rng(1).permutation(len(points))  # nor is it a matter of the unit
    np.testing.assert_array_equal(loose_points(Scan(0.001 * points[order])), found[order])


def test_points_that_face_another_way_are_loose() -> None:
    points, normals = np.vstack([GRID, [[9.5, 9.5, 0.0]]]), np.vstack([UP, [[1.0, 0.0, 0.0]]])
    assert not loose_points(Scan(points)).any()
    assert np.flatnonzero(loose_points(Scan(points, normals))).tolist() == [len(GRID)]
