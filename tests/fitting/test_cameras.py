"""Calibrations of cameras as their tools write them, and photographs that need them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from workbench.errors import BadArgument, BadFile
from workbench.fitting.files.cameras import read_calibration
from workbench.fitting.files.keypoints import (
    read_observations,
)


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


def test_pose2sim_calibration_is_read(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(TOML)
    cameras = read_calibration(tmp_path / "c.toml")
    assert list(cameras) == ["left"]
    np.testing.assert_allclose(cameras["left"]["R"], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)
    assert cameras["left"]["size"] == (1088, 1920)
    assert cameras["left"]["distortion"].tolist() == [-0.04, 0.1, 0.0, 0.001]


def test_broken_calibration_names_camera_and_key(tmp_path: Path) -> None:
    good = {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 1]}
    with pytest.raises(BadFile, match="camera 'b' lacks R"):
        read_calibration(
            written(tmp_path / "c.json", {"a": good, "b": {"K": good["K"], "t": good["t"]}})
        )
    with pytest.raises(BadFile, match=r"camera 'a': a camera takes .*\(2,\)"):
        read_calibration(written(tmp_path / "d.json", {"a": good | {"t": [0, 1]}}))


def test_bad_camera_numbers_are_refused(tmp_path: Path) -> None:
    for change, said in [
        ({"R": [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "determinant is -1"),
        ({"R": [[0] * 3] * 3}, "R must be a rotation"),
        ({"R": [[1e308, 1, 0], [0, 1, 0], [0, 0, 1]]}, "R must be a rotation"),
        ({"R": "abc"}, "R of camera 'a' must be numbers, not 'abc'"),
        ({"t": None}, "lacks t"),
        ({"size": 3}, "size must be numbers, not 3"),
        ({"size": [0, 5]}, r"the size \[0, 5\]"),
        ({"K": [[0, 0, 1], [0, 1, 1], [0, 0, 1]]}, "focal lengths are above zero"),
        ({"K": [[-5, 0, 1], [0, 1, 1], [0, 0, 1]]}, "focal lengths are above zero"),
        ({"K": [[5, 0, 1], [0, 1, 1], [0, 0, 2]]}, "lower rows of K"),
        ({"distortion": [float("nan")]}, "finite"),
        ({"distortion": [1] * 8}, "up to five distortion coefficients"),
    ]:
        good = {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 1]}
        with pytest.raises(BadFile, match=said):
            read_calibration(written(tmp_path / "c.json", {"a": good | change}))


def test_files_without_calibration_are_refused(tmp_path: Path) -> None:
    for data in [3, [1], {}, {"a": 3}, {"a": {"K": 1}}, None]:
        with pytest.raises(BadFile, match=r"holds no cameras|must be numbers"):
            read_calibration(written(tmp_path / "c.json", data))


def test_broken_toml_is_refused(tmp_path: Path) -> None:
    for text in ["[a", "x = ", "\xff", "[a]\nmatrix = 1979-05-27"]:
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


def test_several_files_need_as_many_cameras(tmp_path: Path) -> None:
    file = written(tmp_path / "a.json", {"people": [{"pose_keypoints_2d": person(25)}]})
    with pytest.raises(BadFile, match="2 files of keypoints need as many calibrated cameras"):
        read_observations([file, file], size=(640, 480))


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
    with pytest.raises(BadFile, match="camera 'left' lacks K.* and has name, .*, matrices"):
        read_calibration(tmp_path / "c.toml")
    (tmp_path / "d.toml").write_text(TOML.replace("fisheye = false", "skew = 3"))
    keypoints = written(tmp_path / "a.json", openpose())
    (note,) = read_observations([keypoints], calibration=tmp_path / "d.toml").notes
    assert note == "d.toml: of camera 'left', not read are skew"
