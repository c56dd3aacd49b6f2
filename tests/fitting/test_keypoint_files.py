"""Keypoints and calibrations, as detectors and calibration tools write them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from workbench.bodies.catalogue import load_body
from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.fitting.calibration_files import read_calibration
from workbench.fitting.detector_layouts import OPENPOSE_25
from workbench.fitting.keypoint_files import (
    read_keypoints,
    read_observations,
)
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.observations import COCO, BadObservation, Observations, photograph


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


def test_openpose_body_25_is_read_by_name(tmp_path: Path) -> None:
    data = {"version": 1.3, "people": [{"pose_keypoints_2d": person(25)}]}
    names, points, size = read_keypoints(written(tmp_path / "a.json", data))
    assert names == OPENPOSE_25
    assert len(set(names)) == 25
    assert points[names.index("left_ankle")].tolist() == [114.0, 128.0, 0.9]
    assert size is None


def test_of_several_people_the_best_seen_is_taken_unless_one_is_named(tmp_path: Path) -> None:
    people = [
        {"pose_keypoints_2d": person(25, confidence=c, at=a)} for c, a in ((0.3, 0), (0.8, 7))
    ]
    file = written(tmp_path / "a.json", {"people": people})
    assert read_keypoints(file)[1][0, 0] == 7
    assert read_keypoints(file, person=0)[1][0, 0] == 0
    with pytest.raises(UnknownName, match="no person is called '2'; there are 0, 1 "):
        read_keypoints(file, person=2)


def test_the_size_is_that_of_the_image_with_the_chosen_person(tmp_path: Path) -> None:
    data = {
        "images": [{"id": i, "width": 100 * i, "height": 50} for i in (1, 2)],
        "annotations": [
            {"image_id": i, "keypoints": person(17, confidence=0.3 * i)} for i in (1, 2)
        ],
    }
    file = written(tmp_path / "a.json", data)
    assert read_keypoints(file)[2] == (200, 50)
    assert read_keypoints(file, person=0)[2] == (100, 50)


def test_coco_annotations_bring_the_size_of_their_image(tmp_path: Path) -> None:
    data = {
        "images": [{"id": 4, "width": 640, "height": 480}],
        "annotations": [{"image_id": 4, "keypoints": person(17, confidence=2)}],
    }
    names, points, size = read_keypoints(written(tmp_path / "a.json", data))
    assert names == COCO
    assert size == (640, 480)
    assert set(points[:, 2]) == {1.0}  # visibility 2 is no confidence of 2


def test_coco_results_are_a_plain_list(tmp_path: Path) -> None:
    data = [{"image_id": 1, "keypoints": person(17), "score": 0.5}]
    assert read_keypoints(written(tmp_path / "a.json", data))[1].shape == (17, 3)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"people": []}, "no person's keypoints"),
        ({"people": [{"pose_keypoints_2d": person(19)}]}, "19 keypoints per person.*25 or 18"),
        ([], "no person's keypoints"),
        ({"something": 1}, "no person's keypoints"),
        (3, "annotations must be a list of objects, not 3"),
        ([1, 2], r"annotations\[0\] must be an object, not 1"),
        ({"people": 3}, "people must be a list of objects, not 3"),
        ({"people": ["x"]}, r"people\[0\] must be an object, not 'x'"),
        ({"annotations": 3}, "annotations must be a list"),
        ({"annotations": [{"keypoints": "abc"}]}, "keypoints must be numbers, not 'abc'"),
        ({"annotations": [{"keypoints": None}]}, "keypoints must be numbers, not None"),
        ({"annotations": [{"keypoints": [[1], [2, 3]]}]}, "keypoints must be numbers"),
        ({"annotations": [{"keypoints": [10**400] * 51}]}, "keypoints must be numbers"),
        ({"annotations": [{"keypoints": [1, 2]}]}, "but 2 numbers are not a multiple of three"),
        ({"annotations": [{"keypoints": person(17, confidence=-1)}]}, "0 has confidence -1"),
        ({"annotations": [{"keypoints": person(17, at=float("nan"))}]}, r"nose at \[nan, nan\]"),
        ({"annotations": [{"keypoints": person(17, at=1e300)}]}, r"has nose at \[1e\+300"),
        ({"images": [3], "annotations": [{"keypoints": person(17)}]}, r"images\[0\] must be an"),
        (
            {
                "images": [{"id": 1, "width": 0, "height": 5}],
                "annotations": [{"image_id": 1, "keypoints": person(17)}],
            },
            r"the size \[0, 5\]",
        ),
        (
            {
                "images": [{"id": 1, "width": "x"}],
                "annotations": [{"image_id": 1, "keypoints": person(17)}],
            },
            "size must be numbers",
        ),
    ],
)
def test_what_holds_no_keypoints_is_refused(tmp_path: Path, data: Any, said: str) -> None:
    with pytest.raises(BadFile, match=said):
        read_keypoints(written(tmp_path / "a.json", data))


def test_junk_is_no_json(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(b"\xff\x00")
    with pytest.raises(BadFile, match="cannot be read as JSON"):
        read_keypoints(tmp_path / "a.json")
    with pytest.raises(BadFile, match="cannot be read as JSON"):
        read_keypoints(tmp_path / "missing.json")


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


def test_a_pose2sim_calibration_is_read(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(TOML)
    cameras = read_calibration(tmp_path / "c.toml")
    assert list(cameras) == ["left"]
    np.testing.assert_allclose(cameras["left"]["R"], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)
    assert cameras["left"]["size"] == (1088, 1920)
    assert cameras["left"]["distortion"].tolist() == [-0.04, 0.1, 0.0, 0.001]


def test_a_broken_calibration_says_which_camera_and_what(tmp_path: Path) -> None:
    good = {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 1]}
    with pytest.raises(BadFile, match="camera 'b' lacks R"):
        read_calibration(
            written(tmp_path / "c.json", {"a": good, "b": {"K": good["K"], "t": good["t"]}})
        )
    with pytest.raises(BadFile, match=r"camera 'a': a camera takes .*\(2,\)"):
        read_calibration(written(tmp_path / "d.json", {"a": good | {"t": [0, 1]}}))


@pytest.mark.parametrize(
    ("change", "said"),
    [
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
    ],
)
def test_numbers_that_are_no_camera_are_refused(
    tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    good = {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 1]}
    with pytest.raises(BadFile, match=said):
        read_calibration(written(tmp_path / "c.json", {"a": good | change}))


@pytest.mark.parametrize("data", [3, [1], {}, {"a": 3}, {"a": {"K": 1}}, None])
def test_what_is_no_calibration_is_refused(tmp_path: Path, data: Any) -> None:
    with pytest.raises(BadFile, match=r"holds no cameras|lacks"):
        read_calibration(written(tmp_path / "c.json", data))


@pytest.mark.parametrize("text", ["[a", "x = ", "\xff", "[a]\nmatrix = 1979-05-27"])
def test_broken_toml_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "c.toml").write_bytes(text.encode("latin1"))
    with pytest.raises(BadFile):
        read_calibration(tmp_path / "c.toml")
    (tmp_path / "d.toml").write_text(TOML + TOML.replace("cam_a", "cam_b").replace("metad", "d"))
    with pytest.raises(BadFile, match="two cameras of one name"):
        read_calibration(tmp_path / "d.toml")


def test_an_image_without_a_size_is_asked_for_one(tmp_path: Path) -> None:
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


def test_one_file_and_two_cameras_do_not_match(tmp_path: Path) -> None:
    file = written(tmp_path / "a.json", {"people": [{"pose_keypoints_2d": person(25)}]})
    good = {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 1]}
    cameras = written(tmp_path / "c.json", {"a": good, "b": good})
    with pytest.raises(BadFile, match="one file needs as many calibrated cameras, but there are 2"):
        read_observations([file], calibration=cameras, size=(640, 480))


@pytest.mark.parametrize("focal", [0.0, -5.0, float("nan"), float("inf")])
def test_a_focal_length_is_above_zero(focal: float) -> None:
    with pytest.raises(BadArgument, match="px above 0"):
        read_observations(["a.json"], size=(640, 480), focal=focal)


def test_keypoints_in_one_place_tell_none_for_the_body(tmp_path: Path) -> None:
    file = written(tmp_path / "a.json", {"people": [{"pose_keypoints_2d": [5.0, 5.0, 1.0] * 25}]})
    with pytest.raises(BadObservation, match="coincide"):
        keypoint_fit(read_observations([file], size=(640, 480)), load_body("small"), "where?")


def test_a_keypoint_without_a_place_is_named() -> None:
    points = np.ones((3, 3))
    points[1, 0] = np.nan
    with pytest.raises(BadObservation, match="front: keypoint 1 is"):
        photograph("front", (640, 480), points)
    points[1, 2] = 0  # not seen: its place does not matter
    assert photograph("front", (640, 480), points).confidence[1] == 0


def test_keypoints_are_put_in_the_bodys_order() -> None:
    seen = read_back(("left_knee", "nose"))
    ordered = seen.ordered(("nose", "tail", "left_knee"))
    assert ordered.photographs[0].pixels.tolist() == [[1.0, 11.0], [0.0, 0.0], [0.0, 10.0]]
    assert ordered.photographs[0].confidence.tolist() == [1.0, 0.0, 1.0]
    with pytest.raises(BadObservation, match="none of the observed keypoints"):
        seen.ordered(("tail",))


def read_back(names: tuple[str, ...]) -> Any:

    points = np.column_stack([np.arange(2), 10 + np.arange(2), np.ones(2)])
    return Observations(names, (photograph("front", (640, 480), points),))
