"""Closest places on a surface: as an exhaustive search finds them, in both ways to compute them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh

import workbench as wb
from tests.tiers import few
from workbench.arrays import Array, Index
from workbench.errors import BadArgument, BadMesh
from workbench.geometry.surface_search import IN_NUMPY, SearchBackend
from workbench.geometry.surface_tree import ClosestPoints, SurfaceTree, compiled

CUBE = trimesh.creation.box()  # of side 1, around the origin


def in_numpy() -> SearchBackend:
    return IN_NUMPY


def in_c() -> SearchBackend:
    way = compiled()
    if way is None:
        pytest.skip("no C compiler on the PATH")
    return way


BOTH = pytest.mark.parametrize("way", [in_numpy, in_c])
Ways = Callable[[], SearchBackend]


def soup(rng: np.random.Generator) -> tuple[Array, Index]:
    """Triangles of all kinds: large, small, thin, lines, points, the same again, turned over."""
    vertices = rng.normal(size=(90, 3))
    vertices[40:60] = vertices[:20] + 1e-3 * rng.normal(size=(20, 3))
    vertices[60:70] = (vertices[:10] + vertices[10:20]) / 2
    vertices[70:80] = vertices[:10]
    faces = rng.integers(90, size=(110, 3))
    first = np.arange(10)
    lines = np.stack([first, first + 10, first + 60], axis=1)
    points = np.stack([first, first + 70, first], axis=1)
    again, over = faces[:15, [1, 2, 0]], faces[15:30, ::-1]
    return vertices, np.concatenate([again, lines, faces, points, over, lines[:, [2, 0, 1]]])


def test_closest_places_of_a_trimesh() -> None:
    points = np.random.default_rng(0).uniform(-2, 2, (40, 3))
    points = points[np.abs(points).max(axis=1) > 0.5]  # outside
    found = wb.closest(points, CUBE)
    np.testing.assert_allclose(found.points, points.clip(-0.5, 0.5), atol=1e-12)
    near = wb.closest(points, CUBE, within=0.3).faces >= 0
    np.testing.assert_array_equal(near, found.distances <= 0.3)


def blob() -> tuple[Array, Index]:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    v = np.array(mesh.vertices)
    return v * (1 + 0.3 * np.sin(5 * v[:, :1]) * np.cos(4 * v[:, 1:2])), np.array(mesh.faces)


def everywhere(rng: np.random.Generator, vertices: Array, faces: Index, count: int) -> Array:
    """Points far off, near, exactly on the surface, and at vertices."""
    face = rng.integers(len(faces), size=count)
    on = np.einsum("ik,ikj->ij", rng.dirichlet([0.7] * 3, count), vertices[faces[face]])
    size = np.repeat([0, 1e-9, 1e-3, 0.1, 3.0], -(-count // 5))[:count, None]
    on += size * rng.normal(size=on.shape)
    on[:20] = vertices[faces[face[:20], 0]]
    return on


def oracle(vertices: Array, faces: Index, points: Array, counts: Array | None = None) -> Array:
    """The distance of every point from the nearest of all triangles that count for it, (M,)."""
    best = np.full(len(points), np.inf)
    for f, corners in enumerate(vertices[faces]):
        here = np.full(len(points), np.inf)
        for a, b in zip(corners, np.roll(corners, 1, axis=0), strict=True):
            t = (points - a) @ (b - a) / max((b - a) @ (b - a), 1e-200)
            away = points - a - np.clip(t, 0, 1)[:, None] * (b - a)
            here = np.minimum(here, np.linalg.norm(away, axis=1))
        edges = (corners[1:] - corners[0]).T
        inside = (points - corners[0]) @ np.linalg.pinv(edges).T
        off = np.linalg.norm(points - corners[0] - inside @ edges.T, axis=1)
        right = (inside >= 0).all(axis=1) & (inside.sum(axis=1) <= 1)
        here = np.where(right, np.minimum(here, off), here)
        best = np.minimum(best, here if counts is None else np.where(counts[:, f], here, np.inf))
    return best


def unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 1e-12)


def normals_of(vertices: Array, faces: Index) -> Array:
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return unit(np.cross(b - a, c - a))


def assert_consistent(found: ClosestPoints, vertices: Array, faces: Index, points: Array) -> None:
    there = found.faces >= 0
    assert (found.shares >= 0).all()
    np.testing.assert_allclose(found.shares.sum(axis=1), there, atol=1e-15)
    places = np.einsum("ik,ikj->ij", found.shares, vertices[faces[found.faces]])
    np.testing.assert_allclose(found.points, np.where(there[:, None], places, points), atol=1e-15)
    away = np.linalg.norm(points - found.points, axis=1)
    np.testing.assert_allclose(np.abs(found.distances[there]), away[there], atol=1e-14)


@BOTH
@pytest.mark.parametrize("facing", few([None, 0.5, 0.0, -0.3], 2))
def test_distances_are_those_of_an_exhaustive_search(way: Ways, facing: float | None) -> None:
    """All of them; or those within 0.2 m of triangles that face the point's normal."""
    rng, within = np.random.default_rng(1), 0.2
    vertices, faces = soup(rng)
    points, tree = everywhere(rng, vertices, faces, 2000), SurfaceTree(vertices, faces, way)
    if facing is None:
        found, expected = tree.closest(points), oracle(vertices, faces, points)
    else:
        normals = unit(rng.normal(size=points.shape))
        found = tree.closest(points, within, normals, facing)
        counts = normals @ normals_of(vertices, faces).T >= facing
        expected = np.minimum(oracle(vertices, faces, points, counts), within)
        there = found.faces >= 0
        assert 200 < there.sum() < 1980
        assert counts[there, found.faces[there]].all()
        np.testing.assert_array_equal(found.points[~there], points[~there])
        np.testing.assert_array_equal(found.distances[~there], within)
        assert not found.normals[~there].any()
    np.testing.assert_allclose(np.abs(found.distances), expected, rtol=0, atol=1e-12)
    assert_consistent(found, vertices, faces, points)


@pytest.mark.parametrize("faces_count", few([9, 129, 1, 2, 7, 8, 16, 17, 64, 65, 600], 2))
def test_numpy_and_c_agree_to_the_last_bit(faces_count: int) -> None:
    rng = np.random.default_rng(faces_count)
    vertices = rng.normal(size=(5 + faces_count // 3, 3)) * [1, 2, 0.1]
    faces = rng.integers(len(vertices), size=(faces_count, 3))
    points = everywhere(rng, vertices, faces, 500)
    normals = unit(rng.normal(size=points.shape))
    for gate in ((), (0.3,), (np.inf, normals), (0.5, normals, 0.1)):
        one, other = (
            SurfaceTree(vertices, faces, w).closest(points, *gate) for w in (in_numpy, in_c)
        )
        for name in ("faces", "shares", "points", "distances", "normals"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@BOTH
def test_first_of_equally_close_triangles_is_taken(way: Ways) -> None:
    rng = np.random.default_rng(2)
    vertices, faces = blob()
    again = np.concatenate([faces, faces[::-1, [2, 0, 1]], faces[:, ::-1]])
    points = 1.5 * rng.normal(size=(500, 3))
    once, thrice = (SurfaceTree(vertices, f, way).closest(points) for f in (faces, again))
    np.testing.assert_array_equal(once.faces, thrice.faces)
    np.testing.assert_array_equal(once.points, thrice.points)
    around = [np.flatnonzero((faces == v).any(axis=1)).min() for v in range(len(vertices))]
    at_vertices = SurfaceTree(vertices, faces, way).closest(vertices)
    np.testing.assert_array_equal(at_vertices.faces, around)
    outwards = vertices + 1e-3 * unit(vertices)
    at_vertex = (SurfaceTree(vertices, faces, way).closest(outwards).shares == 1).any(axis=1)
    found = SurfaceTree(vertices, faces, way).closest(outwards[at_vertex]).faces
    np.testing.assert_array_equal(found, np.array(around)[at_vertex])


# Signs and normals.


def winding(vertices: Array, faces: Index, points: Array) -> Array:
    """How often a closed surface runs around each point (van Oosterom and Strackee, 1983)."""
    found = np.zeros(len(points))
    for corners in vertices[faces]:
        a, b, c = (corner - points for corner in corners)
        x, y, z = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        over = np.einsum("ij,ij->i", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a)))
        found += 2 * np.arctan2(over, x * y * z + ab * z + bc * x + ca * y)
    return found / (4 * np.pi)


@BOTH
def test_distances_are_negative_inside(way: Ways) -> None:
    rng = np.random.default_rng(4)
    vertices, faces = blob()
    low, high = vertices.min(axis=0) - 0.3, vertices.max(axis=0) + 0.3
    near = everywhere(rng, vertices, faces, 3000)
    points = np.concatenate([rng.uniform(low, high, (3000, 3)), near])
    found = SurfaceTree(vertices, faces, way).closest(points)
    clear = np.abs(found.distances) > 1e-10
    inside = winding(vertices, faces, points) > 0.5
    assert 200 < (inside & clear).sum() < clear.sum() - 200
    np.testing.assert_array_equal(found.distances[clear] < 0, inside[clear])
    assert (found.shares[clear] == 0).any(axis=1).sum() > 1000  # the cases that normals decide
    turned = SurfaceTree(vertices, faces[:, ::-1], way).closest(points)
    np.testing.assert_allclose(turned.distances[clear], -found.distances[clear], atol=1e-15)


@BOTH
def test_normals_of_a_cube(way: Ways) -> None:
    tree = SurfaceTree(CUBE, find_backend=way)  # as trimesh has it
    points = np.array([[1.0, 1, 1], [1, 1, 0.1], [1, 0.2, 0.1], [0.4, 0.1, 0.1], [-1, -1, 1]])
    found = tree.closest(points)
    expected = unit(np.array([[1.0, 1, 1], [1, 1, 0], [1, 0, 0], [1, 0, 0], [-1, -1, 1]]))
    np.testing.assert_allclose(found.normals, expected, atol=1e-15)
    distances = [np.sqrt(0.75), np.sqrt(0.5), 0.5, -0.1, np.sqrt(0.75)]
    np.testing.assert_allclose(found.distances, distances, atol=1e-15)


@BOTH
def test_normals_choose_the_side_of_a_thin_sheet(way: Ways) -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    vertices = np.concatenate([square, square - [0, 0, 0.001]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [6, 5, 4], [7, 6, 4]])
    tree, points = SurfaceTree(vertices, faces, way), np.array([[0.6, 0.2, 0.1], [0.2, 0.6, 0.1]])
    assert tree.closest(points).faces.tolist() == [0, 1]
    down = np.array([[0, 0, -1.0]] * 2)
    assert tree.closest(points, normals=down).faces.tolist() == [2, 3]
    assert tree.closest(points, 0.1, down).faces.tolist() == [-1, -1]


# What must not matter.


@BOTH
@pytest.mark.parametrize("shape", few([blob, lambda: soup(np.random.default_rng(5))], 1))
def test_moved_tree_is_as_new(way: Ways, shape: Callable[[], tuple[Array, Index]]) -> None:
    rng = np.random.default_rng(6)
    vertices, faces = shape()
    tree = SurfaceTree(vertices, faces, way)
    for elsewhere in (vertices * [0.2, 1, 3] + 0.1, rng.normal(size=vertices.shape)):
        points = everywhere(rng, elsewhere, faces, 1000)
        normals = unit(rng.normal(size=points.shape))
        refitted, rebuilt = tree.moved(elsewhere), SurfaceTree(elsewhere, faces, way)
        for gate in ((), (0.1, normals)):
            one, other = refitted.closest(points, *gate), rebuilt.closest(points, *gate)
            for name in ("faces", "shares", "points", "distances", "normals"):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    back = tree.moved(elsewhere).moved(vertices).closest(points)
    np.testing.assert_array_equal(back.distances, tree.closest(points).distances)


# Bad input.


def test_meshes_without_a_surface_are_refused() -> None:
    for vertices, faces, says in (
        (np.eye(3), np.zeros((0, 3), int), "without faces"),
        (np.eye(3), [[0, 1, 3]], "there are 3 vertices"),
        (np.eye(3), [[0, 1, -1]], "face 0"),
        (np.eye(3), [[0.0, 1.0, 2.0]], "must be whole numbers"),
        (np.eye(3) * np.nan, [[0, 1, 2]], "vertex 0 is"),
        (np.eye(3) * 1e80, [[0, 1, 2]], "farther than"),
        (np.eye(2), [[0, 1, 1]], "vertices have shape"),
    ):
        with pytest.raises(BadMesh, match=says):
            SurfaceTree(vertices, np.asarray(faces))
    tree = SurfaceTree(np.eye(3), np.array([[0, 1, 2]]))
    with pytest.raises(BadMesh, match="4 vertices cannot take the place of 3"):
        tree.moved(np.zeros((4, 3)))
    with pytest.raises(BadMesh, match="vertex 1 is"):
        tree.moved(np.diag([1, np.inf, 1]))


def test_closest_rejects_bad_arguments() -> None:
    tree = SurfaceTree(np.eye(3), np.array([[0, 1, 2]]))
    bad: list[tuple[tuple[Any, ...], str]] = [
        (([1.0, 2, 3],), "points have shape"),
        ((np.diag([1, np.nan, 1]),), "row 1 of points"),
        ((np.eye(3), -1.0), "within is"),
        ((np.eye(3), np.nan), "within is"),
        ((np.eye(3), 1.0, np.ones((2, 3))), "3 points, but 2 normals"),
        ((np.eye(3), 1.0, np.eye(3), np.nan), "must be a cosine"),
    ]
    for arguments, says in bad:
        with pytest.raises(BadArgument, match=says):
            tree.closest(*arguments)


def test_no_points_have_no_places_and_gates_include_their_end() -> None:
    tree = SurfaceTree(np.eye(3), np.array([[0, 1, 2]]))
    found = tree.closest(np.zeros((0, 3)))
    assert found.points.shape == found.shares.shape == found.normals.shape == (0, 3)
    assert tree.closest(np.eye(3), within=0).faces.tolist() == [0, 0, 0]
    assert tree.closest(np.array([[3.0, 0, 0]]), within=2).distances.tolist() == [2]
    assert tree.closest(np.array([[3.0, 0, 0]]), within=1.999).faces.tolist() == [-1]
