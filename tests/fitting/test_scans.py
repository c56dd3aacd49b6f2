"""Scans in every format: what is guessed, repaired and said, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from workbench import load_body
from workbench.arrays import Array
from workbench.errors import BadArgument, BadFile, UnknownName, WorkbenchError
from workbench.fitting import BadScan, Scan
from workbench.fitting.scans.files import ReadScan, read_scan
from workbench.geometry.guesses import UP_TO_Y
from workbench.geometry.meshes import write_mesh
from workbench.geometry.solids import vertex_normals
from workbench.registration import random_surface_points

BODY = load_body("small")
STANDING = BODY.vertices(pose=[[0, 0, 0]] * 16 + [[0, 0, -1.0], [0, 0, 1.0]] + [[0, 0, 0]] * 6)
FACES = BODY.faces
SURFACE = random_surface_points(STANDING, FACES, 4000, np.random.default_rng(0))[0]


def saved(path: Path, points: Array = SURFACE, **others: Any) -> Path:
    if path.suffix == ".npz":
        np.savez(path, points=points, **others)
    elif path.suffix == ".npy":
        np.save(path, points)
    elif path.suffix == ".csv":
        np.savetxt(path, points, delimiter=",", header="x,y,z", comments="", fmt="%.17g")
    else:
        np.savetxt(path, points, fmt="%.17g")
    return path


def said(read: ReadScan, words: str) -> bool:
    return any(words in note for note in read.notes)


def test_points_survive_their_files(tmp_path: Path) -> None:
    for suffix in [".npz", ".npy", ".xyz", ".csv"]:
        read = read_scan(saved(tmp_path / f"scan{suffix}"))
        np.testing.assert_array_equal(read.scan.points, SURFACE)
        assert (read.unit, read.up, read.scan.faces, read.scan.normals) == ("m", "y", None, None)
        assert said(read, "there are no normals")
    commas = (tmp_path / "scan.csv").read_text().replace(",", ";").replace(".", ",")
    (tmp_path / "commas.csv").write_text(commas)
    np.testing.assert_array_equal(read_scan(tmp_path / "commas.csv").scan.points, SURFACE)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_ply_clouds_keep_normals(tmp_path: Path, kind: str) -> None:
    outwards = SURFACE - SURFACE.mean(axis=0)
    rows = np.column_stack([SURFACE, 3 * outwards, np.full((len(SURFACE), 3), 7)])  # and colours
    names = ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue")
    header = f"ply\nformat {kind} 1.0\nelement vertex {len(rows)}\n"
    header += "".join(f"property double {name}\n" for name in names) + "end_header\n"
    text = "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist())
    data = text.encode() if kind == "ascii" else rows.astype("<f8").tobytes()
    (tmp_path / "scan.ply").write_bytes(header.encode() + data)
    scan = read_scan(tmp_path / "scan.ply").scan
    np.testing.assert_array_equal(scan.points, SURFACE)
    assert scan.normals is not None
    lengths = np.linalg.norm(outwards, axis=1, keepdims=True)
    np.testing.assert_allclose(scan.normals, outwards / lengths, atol=1e-12)
    assert scan.faces is None


def test_pcd_clouds_keep_their_viewpoint(tmp_path: Path) -> None:
    """In the axes of the scan; and without one, a note says how to give it."""
    header = "FIELDS x y z rgb\nSIZE 8 8 8 4\nTYPE F F F U\nPOINTS {}\nVIEWPOINT {}\nDATA ascii\n"
    rows = "".join(f"{x!r} {y!r} {z!r} 7\n" for x, y, z in (1000 * SURFACE @ UP_TO_Y["z"]).tolist())
    camera = np.array([0.5, 1.0, 3.0])
    there = " ".join(map(repr, (1000 * camera @ UP_TO_Y["z"]).tolist()))
    for viewpoint in (f"{there} 1 0 0 0", "0 0 0 1 0 0 0"):
        (tmp_path / "scan.pcd").write_text(header.format(len(SURFACE), viewpoint) + rows)
        read = read_scan(tmp_path / "scan.pcd")
        np.testing.assert_allclose(read.scan.points, SURFACE, atol=1e-12)
        assert (read.unit, read.up) == ("mm", "z")
        assert said(read, "not read are the fields rgb")
        assert said(read, "names no viewpoint") == (read.camera_position is None)
        if viewpoint.startswith(there):
            np.testing.assert_allclose(read.camera_position, camera, atol=1e-12)
            assert said(read, "turned to the camera")
    assert read.camera_position is None


def test_meshes_survive_their_files(tmp_path: Path) -> None:
    for suffix in [".ply", ".obj", ".off"]:
        write_mesh(tmp_path / f"scan{suffix}", STANDING, FACES)
        scan = read_scan(tmp_path / f"scan{suffix}").scan
        np.testing.assert_array_equal(scan.points, STANDING)
        np.testing.assert_array_equal(scan.faces, FACES)
        np.testing.assert_allclose(
            np.asarray(scan.normals), vertex_normals(STANDING, FACES), atol=1e-12
        )


@pytest.mark.parametrize("suffix", [".stl", ".glb"])
def test_files_of_trimesh_have_the_same_surface(tmp_path: Path, suffix: str) -> None:
    """A soup is merged: as many points as the mesh has, and no boundary."""
    mesh = trimesh.Trimesh(STANDING, FACES, process=False)
    mesh.export(tmp_path / f"scan{suffix}")
    read = read_scan(tmp_path / f"scan{suffix}")
    scan = read.scan
    assert scan.faces is not None
    assert scan.weights is not None
    assert (scan.n_points, len(scan.faces)) == (len(STANDING), len(FACES))
    np.testing.assert_allclose(scan.weights.sum(), mesh.area, rtol=1e-5)
    corners = [
        np.sort(np.round(points[faces].reshape(-1, 9), 5).sum(axis=1))
        for points, faces in ((scan.points, scan.faces), (STANDING, FACES))
    ]
    np.testing.assert_allclose(*corners, atol=1e-4)
    assert said(read, "merged") == (suffix == ".stl")
    assert said(read, "as the format prescribes") == (suffix == ".glb")


@pytest.mark.parametrize(("unit", "up"), [("m", "y"), ("cm", "z"), ("mm", "-z"), ("in", "x")])
def test_unit_and_axis_are_guessed(tmp_path: Path, unit: str, up: str) -> None:
    """Turned and scaled back, the points are the same; so are guesses that are given."""
    metres = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}[unit]
    path = saved(tmp_path / "scan.npy", SURFACE @ UP_TO_Y[up] / metres)
    guessed, given = read_scan(path), read_scan(path, unit=unit, up=up)
    for read in (guessed, given):
        assert (read.unit, read.up) == (unit, up)
        np.testing.assert_allclose(read.scan.points, SURFACE, atol=1e-12)
    assert said(guessed, f"the unit is taken to be {unit}")
    assert said(guessed, f"{up} is taken to be up")


def test_stretched_arms_are_not_the_height(tmp_path: Path) -> None:
    """A person in the rest pose is as wide as tall."""
    points = random_surface_points(BODY.template, FACES, 4000, np.random.default_rng(0))[0]
    wide = np.ptp(points, axis=0)
    assert wide[0] > 0.9 * wide[1]
    assert read_scan(saved(tmp_path / "scan.npy", points @ UP_TO_Y["z"])).up == "z"


def test_camera_orients_normals(tmp_path: Path) -> None:
    camera = np.array([0.0, 1.0, 3.0])
    points, place = 1000 * SURFACE @ UP_TO_Y["z"], 1000 * camera @ UP_TO_Y["z"]
    stored = saved(tmp_path / "scan.npz", points, camera_position=place)
    plain = saved(tmp_path / "scan.npy", points)
    for read in (read_scan(stored), read_scan(plain, camera_position=place)):
        assert (read.unit, read.up) == ("mm", "z")
        assert read.camera_position is not None
        np.testing.assert_allclose(read.camera_position, camera, atol=1e-12)
        assert read.scan.normals is not None
        towards = ((camera - read.scan.points) * read.scan.normals).sum(axis=1)
        assert (towards >= 0).all()
        assert said(read, "turned to the camera")


def test_normals_in_columns_are_read(tmp_path: Path) -> None:
    outwards = SURFACE - SURFACE.mean(axis=0)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    colours = np.full((len(SURFACE), 3), 200.0)
    both = read_scan(saved(tmp_path / "a.xyz", np.column_stack([SURFACE, outwards, colours])))
    np.testing.assert_allclose(both.scan.normals, outwards, atol=1e-12)
    assert said(both, "columns 7 to 9 are not read")
    assert said(both, "taken for normals")
    colour = read_scan(saved(tmp_path / "b.csv", np.column_stack([SURFACE, colours])))
    assert colour.scan.normals is None
    assert said(colour, "columns 4 to 6 are not read")


def test_several_arrays_must_be_named(tmp_path: Path) -> None:
    path = tmp_path / "people.npz"
    np.savez(path, ann=SURFACE, bob=1000 * SURFACE, bob_normals=SURFACE, floor=np.zeros(4))
    with pytest.raises(
        BadFile, match="several of its arrays may be the points; name one of ann, bob"
    ):
        read_scan(path)
    read = read_scan(path, name="bob")
    assert read.unit == "mm"
    assert said(read, "not read are the arrays ann, floor")
    assert said(read, "normals are those of the file")
    with pytest.raises(BadFile, match="no array 'carl'; arrays of points are ann, bob"):
        read_scan(path, name="carl")
    with pytest.raises(BadFile, match=r"floor is float64 of shape \(4,\), not points"):
        read_scan(path, name="floor")
    with pytest.raises(BadArgument, match="has no arrays with names"):
        read_scan(saved(tmp_path / "scan.npy"), name="bob")


def test_points_left_out_are_noted(tmp_path: Path) -> None:
    nothing = np.full((7, 3), np.nan)
    zeros, twice, far = np.zeros((9, 3)), SURFACE[:11], np.array([[900.0, 0, 0]])
    points = np.concatenate([SURFACE, nothing, zeros, twice, far, [[np.inf, 0, 0]]])
    read = read_scan(saved(tmp_path / "scan.npy", points))
    np.testing.assert_array_equal(read.scan.points, SURFACE)
    assert [note for note in read.notes if "left out" in note or "merged" in note] == [
        "8 points are NaN, infinite or beyond 1e9, and left out",
        "9 points are 0 0 0, as missing ones are, and left out",
        "11 points are in the place of another, and merged with it",
        "1 point is far from all others, and left out",
    ]


def test_faces_follow_points_that_stay(tmp_path: Path) -> None:
    """A point without numbers takes its faces along; one without faces goes alone."""
    points = np.concatenate([[[9.0, 9, 9]], STANDING, STANDING[:1]])
    points[5] = np.nan
    faces = FACES + 1
    np.savez(tmp_path / "scan.npz", vertices=points, faces=faces)
    read = read_scan(tmp_path / "scan.npz")
    assert read.scan.faces is not None
    left = faces[(faces != 5).all(axis=1)]
    np.testing.assert_array_equal(read.scan.points[read.scan.faces], points[left])
    assert read.scan.n_points == len(STANDING) - 1
    assert said(read, "1 point is NaN")
    assert said(read, "2 points are in no face")


def test_damaged_scans_are_refused(tmp_path: Path) -> None:
    mostly_one_place = np.vstack(
        [BODY.vertices(), 600 * np.random.default_rng(1).normal(size=(150, 3))]
    )
    for points, sentence in [
        (np.zeros((0, 3)), "it holds no points"),
        (np.zeros((0, 6)), "it holds no points"),
        (np.ones((500, 3)), "1 different points.*499 points are in the place"),
        (np.full((500, 3), np.nan), "0 different points.*500 points are NaN"),
        (1e6 * SURFACE, "in none of cm, in, m, mm is this the size of a body"),
        (SURFACE[:, :2], r"an array of shape \(4000, 2\), not points \(N, 3\)"),
        (mostly_one_place, "remove what is far away"),
    ]:
        path = saved(tmp_path / "scan.npy", points)
        with pytest.raises(WorkbenchError, match=sentence) as raised:
            read_scan(path)
        assert str(path) in str(raised.value)


def test_bad_scan_arguments_are_refused(tmp_path: Path) -> None:
    path = saved(tmp_path / "scan.npy")
    for options, error, said in [
        ({"unit": "feet"}, UnknownName, "no unit is called 'feet'; there are cm, cmu, in, m, mm"),
        ({"unit": "mm"}, BadScan, r"in mm the scan is 0.001\d+ m long, and no body is"),
        ({"camera_position": [1, 2]}, BadArgument, "three finite numbers"),
        ({"most": 3}, BadArgument, "at least 1,000 points"),
    ]:
        with pytest.raises(error, match=said):
            read_scan(path, **options)
    with pytest.raises(BadFile, match=r"no format of scans is called '\.fbx'; there are \.csv"):
        read_scan(tmp_path / "scan.fbx")
    assert read_scan(path, up="+z").up == "z"


LOW = STANDING[:, 1].min()
LYING = UP_TO_Y["z"]  # on the back: what was in front is up


def square(side: float, noise: float = 0.0, count: int = 20_000) -> Array:
    """Points of a square around the feet."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-side / 2, side / 2, (count, 3)) * [1, 0, 1] + [0, LOW, 0]
    return points + noise * rng.normal(size=points.shape)


WALL = square(2.4, 0.003) @ UP_TO_Y["z"].T + [0, 0.3, LOW + SURFACE[:, 2].min() - 0.3]
BESIDE = {  # planes and the person before them
    "a floor": (square(3.0), SURFACE),
    "a floor and a wall": (np.concatenate([square(2.6, 0.003), WALL]), SURFACE),
    "a floor under who lies": (
        square(2.6) - [0, LOW, 0],
        SURFACE @ LYING.T - [0, (SURFACE @ LYING.T)[:, 1].min(), 0],
    ),
}


@pytest.mark.parametrize("name", BESIDE)
def test_floors_and_walls_are_left_out(tmp_path: Path, name: str) -> None:
    plane, person = BESIDE[name]
    points = np.concatenate([plane, person])
    read = read_scan(saved(tmp_path / "scan.npy", points), unit="m", up="y")
    known = {tuple(one) for one in read.scan.points}
    left = np.array([tuple(one) in known for one in points])
    assert left[: len(plane)].mean() < 0.003
    assert left[len(plane) :].mean() > (0.85 if "lies" in name else 0.97)
    assert said(read, "on a plane beside the rest, a floor or a wall, and left out")
    usual = read_scan(saved(tmp_path / "other.npy", 1000 * points))
    assert usual.unit == "mm"  # by the person, not by the floor
    assert usual.up == "y" or "lies" in name


def test_floor_of_a_mesh_is_left_out(tmp_path: Path) -> None:
    corners = 2 * np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) + [0, LOW, 0]
    both = np.concatenate([FACES, np.array([[0, 2, 1], [0, 3, 2]]) + len(STANDING)])
    write_mesh(tmp_path / "scan.ply", np.concatenate([STANDING, corners]), both)
    read = read_scan(tmp_path / "scan.ply")
    assert said(read, "a floor or a wall")
    assert 0.94 * len(STANDING) < read.scan.n_points <= len(STANDING)
    assert np.ptp(read.scan.points[:, 0]) < 1.9


def test_scans_without_a_floor_lose_nothing(tmp_path: Path) -> None:
    flat = STANDING.copy()  # a back as flat as a board
    flat[:, 2] = np.maximum(flat[:, 2], np.percentile(flat[:, 2], 35))
    of_flat = trimesh.sample.sample_surface(
        trimesh.Trimesh(flat, FACES, process=False), 4000, seed=0
    )
    front = SURFACE[SURFACE[:, 2] > np.median(SURFACE[:, 2])]  # seen by one camera
    for points in (SURFACE, SURFACE @ LYING.T, np.asarray(of_flat[0]), front):
        read = read_scan(saved(tmp_path / "scan.npy", points))
        assert read.scan.n_points == len(points)
    for turn in (np.eye(3), LYING):
        write_mesh(tmp_path / "scan.ply", flat @ turn.T, FACES)
        assert len(np.asarray(read_scan(tmp_path / "scan.ply").scan.faces)) >= len(FACES) - 60


FOUR = np.arange(12.0).reshape(4, 3)
FOUR_NORMALS = np.tile([0.0, 0.6, 0.8], (4, 1))
TWO_FACES = np.array([[0, 1, 2], [2, 1, 3]])
AREAS = np.array([1.0, 2.0, 0.0, 4.0])


def test_a_mesh_is_a_scan_of_its_surface() -> None:
    ball = trimesh.creation.icosphere(3)
    ball = trimesh.Trimesh([*ball.vertices, [9, 9, 9]], ball.faces, process=False)  # one alone
    scan = Scan.of(ball)
    assert Scan.of(scan) is scan
    assert scan.normals is not None
    assert scan.weights is not None
    np.testing.assert_allclose(scan.normals, scan.points, rtol=0, atol=0.03)
    assert scan.n_points == 642
    assert scan.weights.sum() == pytest.approx(ball.area)


def test_bad_scans_are_refused() -> None:
    for arguments, sentence in [
        ({"points": np.zeros((0, 3))}, "this one is empty"),
        ({"points": np.full((2, 3), np.nan)}, r"point 0 is \[nan, nan, nan\]; leave out"),
        ({"normals": 2 * FOUR_NORMALS}, r"normal 0 is .* whose length is not 1; divide"),
        ({"faces": TWO_FACES + 1}, r"face 1 is \[3, 2, 4\], but the points are 0 to 3"),
        ({"weights": -AREAS}, r"weight 3 is -4 m\^2; areas are 0 for points that do not count"),
        ({"weights": 0 * AREAS}, "not 0 for all"),
    ]:
        with pytest.raises(BadScan, match=sentence):
            Scan(**{"points": FOUR} | arguments)
    with pytest.raises(BadScan, match=r"by a mask of shape \(4,\), not by an array of bool"):
        Scan(FOUR).some(np.array([True]))


def test_thinned_scan_keeps_its_area() -> None:
    rng = np.random.default_rng(0)
    points, areas = rng.standard_normal((500, 3)), rng.uniform(0.0, 1.0, 500)
    areas[:100] = 0  # points that do not count are not drawn
    few = Scan(points, weights=areas).thinned(50)
    assert few.weights is not None
    assert few.weights.sum() == pytest.approx(areas.sum())
    numbers = [int(np.flatnonzero((points == p).all(axis=1))[0]) for p in few.points]
    assert min(numbers) >= 100
    assert len(set(numbers)) == len(numbers) == 50
    np.testing.assert_allclose(np.ptp(few.weights / areas[numbers]), 0, atol=1e-9)
