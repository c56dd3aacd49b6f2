"""Calibrations of cameras as their tools write them, and photographs that need them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from workbench.arrays import Array
from workbench.errors import BadArgument, BadFile
from workbench.fitting import read_clip
from workbench.fitting.files.cameras import notes_on, read_calibration
from workbench.fitting.files.keypoints import read_observations
from workbench.geometry.camera import Camera
from workbench.geometry.rotation import vector_from_matrix


def written(path: Path, data: Any) -> Path:
    path.write_text(json.dumps(data))
    return path


def person(count: int, *, confidence: float = 0.9, at: float = 100.0) -> list[float]:
    return (
        np.column_stack(
            [at + np.arange(count), at + 2 * np.arange(count), np.full(count, confidence)]
        )
        .ravel()
        .tolist()
    )


TOML = """
[cam_a]
name = "left"
size = [1088.0, 1920.0]
matrix = [[1600.0, 0.0, 540.0], [0.0, 1600.0, 950.0], [0.0, 0.0, 1.0]]
distortions = [-0.04, 0.1, 0.0, 0.001]
rotation = [0.0, 1.5707963267948966, 0.0]
translation = [0.1, 0.2, 3.0]
fisheye = false

[metadata]
adjusted = false
"""


def test_bad_camera_numbers_are_refused(tmp_path: Path) -> None:
    for change, said in [
        ({"R": [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "determinant is -1"),
        ({"R": [[1e308, 1, 0], [0, 1, 0], [0, 0, 1]]}, "R must be a rotation"),
        ({"R": "abc"}, "R of camera 'a' must be numbers, not 'abc'"),
        ({"K": [[0, 0, 1], [0, 1, 1], [0, 0, 1]]}, "focal lengths above zero"),
        ({"distortion": [1] * 8}, "up to five distortion coefficients"),
    ]:
        good = {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 1]}
        with pytest.raises(BadFile, match=said):
            read_calibration(written(tmp_path / "c.json", {"a": good | change}))


def test_files_without_calibration_are_refused(tmp_path: Path) -> None:
    for data in [3, {}, {"a": {"K": 1}}]:
        with pytest.raises(BadFile, match=r"holds no cameras|must be numbers"):
            read_calibration(written(tmp_path / "c.json", data))


def test_broken_toml_is_refused(tmp_path: Path) -> None:
    for text in ["[a", "\xff"]:
        (tmp_path / "c.toml").write_bytes(text.encode("latin1"))
        with pytest.raises(BadFile):
            read_calibration(tmp_path / "c.toml")
        (tmp_path / "d.toml").write_text(
            TOML + TOML.replace("cam_a", "cam_b").replace("metad", "d")
        )
        with pytest.raises(BadFile, match="two cameras of one name"):
            read_calibration(tmp_path / "d.toml")


def test_image_needs_a_size(tmp_path: Path) -> None:
    file = written(tmp_path / "a.json", {"people": [{"pose_keypoints_2d": person(25)}]})
    with pytest.raises(BadFile, match="--size WIDTHxHEIGHT"):
        read_observations([file])
    assert read_observations([file], size=(640, 480)).photographs[0].K is None
    known = read_observations([file], size=(640, 480), focal=800.0).photographs[0].K
    assert known is not None
    assert known[0].tolist() == [800.0, 0.0, 320.0]


def test_one_file_refuses_two_cameras(tmp_path: Path) -> None:
    file = written(tmp_path / "k.json", {"people": [{"pose_keypoints_2d": person(25)}]})
    good = {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 1]}
    cameras = written(tmp_path / "c.json", {"a": good, "b": good})
    with pytest.raises(BadFile, match="one file needs as many calibrated cameras, but there are 2"):
        read_observations([file], calibration=cameras, size=(640, 480))


def test_focal_length_is_positive() -> None:
    for focal in [0.0, -5.0, float("nan"), float("inf")]:
        with pytest.raises(BadArgument, match="px above 0"):
            read_observations(["a.json"], size=(640, 480), focal=focal)


def openpose(**parts: list[float]) -> dict[str, Any]:
    return {"people": [{"pose_keypoints_2d": person(25), **parts}]}


def test_fisheye_cameras_are_refused(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(TOML.replace("fisheye = false", "fisheye = true"))
    with pytest.raises(BadFile, match="camera 'left' is a fisheye"):
        read_calibration(tmp_path / "c.toml")


def test_incomplete_cameras_are_refused(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(TOML.replace("matrix =", "matrices ="))
    with pytest.raises(BadFile, match=r"camera 'left' lacks K.* and has name, .*, matrices"):
        read_calibration(tmp_path / "c.toml")
    (tmp_path / "d.toml").write_text(TOML.replace("fisheye = false", "skew = 3"))
    keypoints = written(tmp_path / "a.json", openpose())
    (note,) = read_observations([keypoints], calibration=tmp_path / "d.toml").notes
    assert note == "d.toml: of camera 'left', not read are skew"


K = np.array([[1100.0, 0, 640.5], [0, 1120, 350.25], [0, 0, 1]])
BENT = np.array([-0.2, 0.05, 0.001, -0.002, 0.01])  # k1 k2 p1 p2 k3
PLACES = np.random.default_rng(2).uniform(-1, 1, (30, 3))
VIEWS: dict[str, tuple[Array, Array]] = {}
for _name, _angle in (("c0", 0.4), ("c1", -1.9)):
    _turn = np.array(
        [[np.cos(_angle), 0, -np.sin(_angle)], [0, 1, 0], [np.sin(_angle), 0, np.cos(_angle)]]
    )
    VIEWS[_name] = np.diag([1.0, -1, -1]) @ _turn, np.array([0.1, 0.3 * _angle, 4.0])


def pixels(name: str, bent: Array = BENT) -> Array:
    """Where a camera sees the places, by OpenCV's formula."""
    R, t = VIEWS[name]
    x, y, z = R @ PLACES.T + t[:, None]
    x, y = x / z, y / z
    r2 = x**2 + y**2
    radial = 1 + bent[0] * r2 + bent[1] * r2**2 + bent[4] * r2**3
    u = x * radial + 2 * bent[2] * x * y + bent[3] * (r2 + 2 * x**2)
    v = y * radial + bent[2] * (r2 + 2 * y**2) + 2 * bent[3] * x * y
    return np.column_stack([K[0, 0] * u + K[0, 2], K[1, 1] * v + K[1, 2]])


def all_of(**made: Any) -> dict[str, dict[str, Any]]:
    """Entries of each camera; functions of R and t make some of them."""
    found = {}
    for name, (R, t) in VIEWS.items():
        entries = {key: one(R, t) if callable(one) else one for key, one in made.items()}
        found[name] = {
            key: one.tolist() if isinstance(one, np.ndarray) else one
            for key, one in entries.items()
        }
    return found


def world_to_camera(R: Array, t: Array) -> Array:
    return np.vstack([np.column_stack([R, t]), [0, 0, 0, 1]])


def pose(R: Array, t: Array) -> Array:
    return np.linalg.inv(world_to_camera(R, t))


def upright(R: Array, t: Array) -> Array:
    """OpenGL's pose of the camera."""
    return pose(R, t) @ np.diag([1, -1, -1, 1])


LENS = {"K": K, "dist": BENT}
USUAL = all_of(**LENS, R=lambda R, t: R, t=lambda R, t: t)


def matrix(numbers: Any, rows: int, cols: int) -> str:
    """A matrix of OpenCV's FileStorage in YAML."""
    data = ", ".join(map(repr, np.ravel(numbers).tolist()))
    head = f"!!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n"
    return f"{head}   data: [ {data} ]\n"


def easymocap(kind: str) -> str:
    text = '%YAML:1.0\r\n---\r\nnames:\r\n  - "c0"\r\n  - "c1"\r\n'
    for name, (R, t) in VIEWS.items():
        if kind == "intri":
            text += f"K_{name}: {matrix(K, 3, 3)}dist_{name}: {matrix(BENT, 1, 5)}"
            text += f"H_{name}: 720\nW_{name}: 1280\n"
        else:
            vector = vector_from_matrix(R)
            text += f"R_{name}: {matrix(vector, 3, 1)}Rot_{name}: {matrix(R, 3, 3)}"
            text += f"T_{name}: {matrix(t, 3, 1)}"
    return text


def tables(rest: str = "") -> str:
    """TOML as Anipose and Pose2Sim write it."""
    text = ""
    for i, (name, one) in enumerate(USUAL.items()):
        vector = vector_from_matrix(np.array(one["R"])).tolist()
        text += f'[cam_{i}]\nname = "{name}"\nsize = [1280, 720]\nmatrix = {one["K"]}\n'
        text += f"distortions = {one['dist']}\nrotation = {vector}\ntranslation = {one['t']}\n"
        text += rest + "\n"
    return text + "[metadata]\nadjusted = false\nerror = 0.3\n"


def colmap() -> dict[str, str]:
    k = " ".join(map(repr, [*K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), *BENT[:4].tolist()]))
    cameras = f"# Camera list\n1 OPENCV 1280 720 {k}\n"
    images = "# Image list\n"
    for i, (name, (R, t)) in enumerate(VIEWS.items()):
        vector = vector_from_matrix(R)
        angle = float(np.linalg.norm(vector))
        half = np.sin(angle / 2) * vector / angle
        w = float(np.cos(angle / 2))
        numbers = " ".join(map(repr, [w, *half.tolist(), *t.tolist()]))
        images += f"{i + 1} {numbers} 1 {name}.jpg\n1.5 2.5 -1 7.0 8.0 3\n"
    return {"cameras.txt": cameras, "images.txt": images}


def stored(two: bool, form: str = "yml") -> str:
    """OpenCV's FileStorage, of a stereo pair that sees from the first camera, or of one camera."""
    if form == "xml":
        data = " ".join(map(repr, K.ravel().tolist()))
        k = " ".join(map(repr, BENT.tolist()))
        head = "<rows>{}</rows><cols>{}</cols><dt>d</dt><data>{}</data>"
        return (
            '<?xml version="1.0"?>\n<opencv_storage>\n<image_width>1280</image_width>\n'
            "<image_height>720</image_height>\n"
            f'<Camera_Matrix type_id="opencv-matrix">{head.format(3, 3, data)}</Camera_Matrix>\n'
            f'<Distortion_Coefficients type_id="opencv-matrix">{head.format(5, 1, k)}'
            "</Distortion_Coefficients>\n</opencv_storage>\n"
        )
    (R, t), (S, s) = VIEWS.values()
    text = "%YAML:1.0\n---\n"
    if not two:
        text += (
            'calibration_time: "Tue 1 Jan 2019 10:00:00"\nimage_width: 1280\nimage_height: 720\n'
        )
        text += f"camera_matrix: {matrix(K, 3, 3)}"
        return text + f"distortion_coefficients: {matrix([*BENT, 0, 0, 0], 1, 8)}"
    for i in (1, 2):
        text += f"M{i}: {matrix(K, 3, 3)}D{i}: {matrix(BENT, 1, 5)}"
    relative = world_to_camera(S, s) @ pose(R, t)
    return text + f"R: {matrix(relative[:3, :3], 3, 3)}T: {matrix(relative[:3, 3], 3, 1)}"


PANOPTIC = {
    "calibDataSource": "160422_calib_norm",
    "cameras": [
        {"name": name, "type": "hd", "resolution": [1280, 720], "panel": 0, "node": i}
        | {"K": one["K"], "distCoef": one["dist"], "R": one["R"]}
        | {"t": [[100 * x] for x in one["t"]]}
        for i, (name, one) in enumerate(USUAL.items())
    ],
}
BY_POSE = {
    "fl_x": K[0, 0],
    "fl_y": K[1, 1],
    "cx": K[0, 2],
    "cy": K[1, 2],
    "w": 1280,
    "h": 720,
    **dict(zip(("k1", "k2", "p1", "p2", "k3"), BENT.tolist(), strict=True)),
    "camera_model": "OPENCV",
    "frames": [{"file_path": name} | one for name, one in all_of(transform_matrix=upright).items()],
}
APART = {
    name: {"intrinsics": {"K": one["K"], "dist": one["dist"]}, "extrinsics": one}
    for name, one in all_of(rvec=lambda R, t: vector_from_matrix(R), tvec=lambda R, t: t).items()
    for one in [one | {"K": K.tolist(), "dist": BENT.tolist()}]
}
CALIBRATIONS: dict[str, dict[str, Any]] = {  # files, of which the first is read
    "by name": {"c.json": USUAL},
    "a list": {"c.json": [{"name": name, **one} for name, one in USUAL.items()]},
    "a list under cameras": {"c.json": {"cameras": [{"name": n, **c} for n, c in USUAL.items()]}},
    "CMU Panoptic": {"calibration_160422.json": PANOPTIC},
    "EasyMocap": {"intri.yml": easymocap("intri"), "extri.yml": easymocap("extri")},
    "EasyMocap by the other": {"extri.yml": easymocap("extri"), "intri.yml": easymocap("intri")},
    "EasyMocap with flat names": {
        "intri.yml": easymocap("intri").replace('\r\n  - "c0"\r\n  - "c1"', " [ c0, 'c1' ]"),
        "extri.yml": easymocap("extri").replace("\r\n", "\n"),
    },
    "4 x 4": {"c.json": all_of(**LENS, extrinsics=world_to_camera)},
    "3 x 4": {"c.json": all_of(**LENS, RT=lambda R, t: world_to_camera(R, t)[:3])},
    "T of 4 x 4": {"c.json": all_of(**LENS, T=world_to_camera)},
    "T and dist": {"c.json": all_of(**LENS, R=lambda R, t: R, T=lambda R, t: t[:, None])},
    "camera to world": {"c.json": all_of(**LENS, cam2world=pose)},
    "NeRF's transforms": {"transforms.json": BY_POSE},
    "rows of numbers": {
        "c.json": all_of(K=K.ravel(), dist=BENT, R=lambda R, t: R.ravel(), t=lambda R, t: t)
    },
    "16 numbers": {"c.json": all_of(**LENS, extrinsic=lambda R, t: world_to_camera(R, t).ravel())},
    "row vectors": {"c.json": all_of(**LENS, viewmatrix=lambda R, t: world_to_camera(R, t).T)},
    "intrinsics apart": {"c.json": APART},
    "fx fy cx cy": {
        "c.json": all_of(intrinsics=K[[0, 1, 0, 1], [0, 1, 2, 2]], dist=BENT, w2c=world_to_camera)
    },
    "Pose2Sim 0.10": {"Calib.toml": tables("fisheye = false")},
    "Anipose 1.1": {"calibration.toml": tables()},
}


def sees(camera: dict[str, Any], places: Array = PLACES) -> Array:
    """The pixels of places by a camera that was read."""
    known = {k: camera[k] for k in ("K", "R", "t", "distortion") if camera[k] is not None}
    return Camera().pixels(places, Camera().values(**known))


def put(folder: Path, files: dict[str, Any]) -> Path:
    for name, content in files.items():
        text = content if isinstance(content, str) else json.dumps(content)
        (folder / name).write_text(text, newline="")
    return folder / next(iter(files))


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_published_calibrations_project_alike(tmp_path: Path, name: str) -> None:
    cameras = read_calibration(put(tmp_path, CALIBRATIONS[name]))
    assert list(cameras) == ["c0", "c1"]
    for view, camera in cameras.items():
        np.testing.assert_allclose(sees(camera), pixels(view), atol=1e-6)
        if name in ("Pose2Sim 0.10", "CMU Panoptic", "EasyMocap", "NeRF's transforms"):
            assert camera["size"] == (1280, 720)
    notes = notes_on("c", cameras)
    cm = ["c: translations are taken to be in cm, as CMU Panoptic has them"]
    assert [n for n in notes if "not read" not in n] == (cm if name == "CMU Panoptic" else [])


def test_colmap_text_is_read(tmp_path: Path) -> None:
    put(tmp_path, colmap())
    for path in (tmp_path, tmp_path / "cameras.txt", tmp_path / "images.txt"):
        cameras = read_calibration(path)
        assert list(cameras) == ["c0", "c1"]
        for view, camera in cameras.items():
            np.testing.assert_allclose(
                sees(camera), pixels(view, BENT * [1, 1, 1, 1, 0]), atol=1e-6
            )
            assert camera["size"] == (1280, 720)
    (tmp_path / "cameras.txt").write_text("1 OPENCV_FISHEYE 9 9 1 1 1 1 0 0 0 0")
    with pytest.raises(BadFile, match="has the model 'OPENCV_FISHEYE', which is not read; there"):
        read_calibration(tmp_path)


def test_file_storage_of_opencv_is_read(tmp_path: Path) -> None:
    pair = read_calibration(put(tmp_path, {"stereo.yml": stored(two=True)}))
    R, t = VIEWS["c0"]
    for view, camera in zip(VIEWS, pair.values(), strict=True):
        np.testing.assert_allclose(sees(camera, PLACES @ R.T + t), pixels(view), atol=1e-6)
    both = {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d", "data": K.ravel().tolist()}
    one = {"camera_matrix": both, "distortion_coefficients": BENT.tolist(), "image_width": 1280}
    files = {
        "a.yml": stored(two=False),
        "b.xml": stored(two=False, form="xml"),
        "c.json": one | {"image_height": 720},
    }
    for name, content in files.items():
        (camera,) = read_calibration(put(tmp_path, {name: content})).values()
        np.testing.assert_array_equal(camera["K"], K)
        np.testing.assert_array_equal(camera["distortion"], BENT)
        assert (camera["R"], camera["t"], camera["size"]) == (None, None, (1280, 720))
    keypoints = written(tmp_path / "k.json", openpose())
    seen = read_observations([keypoints], calibration=tmp_path / "a.yml").photographs[0]
    assert seen.size == (1280, 720)
    np.testing.assert_array_equal(seen.K, K)


def test_poses_of_cameras_are_inverted_when_said(tmp_path: Path) -> None:
    made = all_of(**LENS, R=lambda R, t: R.T, t=lambda R, t: -R.T @ t)
    path = put(tmp_path, {"c.json": made})
    for view, camera in read_calibration(path, camera_to_world=True).items():
        np.testing.assert_allclose(sees(camera), pixels(view), atol=1e-6)
    files = [written(tmp_path / f"{i}.json", openpose()) for i in range(2)]
    given: dict[str, Any] = {"calibration": path, "size": (1280, 720), "camera_to_world": True}
    for photo, (R, t) in zip(
        read_observations(files, **given).photographs, VIEWS.values(), strict=True
    ):
        np.testing.assert_allclose(photo.R, R, atol=1e-12)
        np.testing.assert_allclose(photo.t, t, atol=1e-12)
    for name in VIEWS:
        (tmp_path / "clip" / name).mkdir(parents=True)
        written(tmp_path / "clip" / name / "1.json", openpose())
    film = read_clip(tmp_path / "clip", fps=30, **given).films[1]
    np.testing.assert_allclose(film.t, VIEWS["c1"][1], atol=1e-12)


def test_cameras_go_with_files_of_their_names(tmp_path: Path) -> None:
    path = put(tmp_path, {"cameras.json": {"c9": USUAL["c0"]} | USUAL})
    files = [written(tmp_path / f"{name}_000007.json", openpose()) for name in ("c1", "c0")]
    seen = read_observations(files, calibration=path, size=(1280, 720))
    assert [photo.name for photo in seen.photographs] == ["c1", "c0"]
    assert seen.notes == ("cameras.json: cameras are taken by the names of the files: c1, c0",)
    with pytest.raises(BadFile, match=r"2 files of keypoints need .* but there are 3"):
        read_observations([files[0], files[0]], calibration=path, size=(1280, 720))


def test_refused_calibrations_name_what_they_hold(tmp_path: Path) -> None:
    for name, content, said in [
        ("a.json", {"people": []}, r"no cameras \(it has the keys people\)"),
        ("intri.yml", easymocap("intri"), "camera 'c0' lacks R, t; .* and has K, distortion"),
        (
            "a.yml",
            "camera_matrix:\n  rows: 1\n  cols: 2\n  data: [1, x]\n",
            "_matrix must be numbers",
        ),
        ("a.xml", "<!DOCTYPE a><a/>", "declares entities"),
        ("cameras.txt", "1 PINHOLE 9 9 1", "images.txt cannot be read"),
    ]:
        with pytest.raises(BadFile, match=said):
            read_calibration(put(tmp_path, {name: content}))
