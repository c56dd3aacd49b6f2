"""What MediaPipe finds is read by name, and what is not read is named."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.fitting.mediapipe_made import dots, mediapipe_results
from tests.fitting.test_keypoint_files import person, written
from workbench.bodies import HAND_POINTS
from workbench.errors import BadFile, UnknownName
from workbench.fitting import KEYPOINT_SCHEMAS, read_clip, read_keypoints, read_observations
from workbench.fitting.detector_layouts import HANDS, MEDIAPIPE_33, OPENPOSE_18
from workbench.fitting.keypoint_files import read_person

SIZE = (640, 480)
RESULTS = mediapipe_results()
LEFT, RIGHT, BODY = dots(21, 1), dots(21, 2), dots(33, 3, visible=True)


def px(points: list[dict[str, float]], i: int, confidence: float = 1.0) -> list[float]:
    return [points[i]["x"] * 640, points[i]["y"] * 480, confidence]


@pytest.mark.parametrize("name", [name for name in RESULTS if name.startswith("hands")])
def test_hands_are_read_by_name_and_side(tmp_path: Path, name: str) -> None:
    found = read_person(written(tmp_path / "a.json", RESULTS[name]), size=SIZE)
    assert found.names == (*HANDS[0], *HANDS[1])
    at = dict(zip(found.names, found.points.tolist(), strict=True))
    # WRIST, THUMB_CMC, INDEX_FINGER_MCP, PINKY_TIP have the numbers 0, 1, 5, 20 of MediaPipe's
    for i, point in ((0, "hand_root"), (1, "thumb1"), (5, "index1"), (20, "pinky_tip")):
        assert at[f"left_{point}"] == px(LEFT, i)
        assert at[f"right_{point}"] == px(RIGHT, i)
    lost = "hand_world_landmarks" in RESULTS[name]
    assert [note.partition("not read are ")[2] for note in found.notes] == (
        ["hand_world_landmarks"] if lost else []
    )


def test_bodies_are_read_and_the_best_seen_is_taken(tmp_path: Path) -> None:
    file = written(tmp_path / "a.json", RESULTS["bodies-of-python"])
    best = [sum(p["visibility"] for p in dots(33, seed, visible=True)) for seed in (3, 4)]
    names, points, size = read_keypoints(file, size=SIZE)
    assert (names, size) == (MEDIAPIPE_33, SIZE)
    seen = dots(33, 3 + int(np.argmax(best)), visible=True)
    assert points[11].tolist() == px(seen, 11, seen[11]["visibility"])
    assert "holds 2 people" in read_person(file, size=SIZE).notes[0]
    assert read_keypoints(file, size=SIZE, person=0)[1][7].tolist() == px(
        BODY, 7, BODY[7]["visibility"]
    )
    with pytest.raises(UnknownName, match=r"there are 0, 1 .*holds 2 people"):
        read_keypoints(file, size=SIZE, person=2)
    file = written(tmp_path / "b.json", RESULTS["bodies-of-javascript"])
    assert read_person(file, size=SIZE).notes == ("b.json: not read are world_landmarks",)


def test_the_holistic_model_has_both_hands_always(tmp_path: Path) -> None:
    found = read_person(written(tmp_path / "a.json", RESULTS["holistic"]), size=SIZE)
    assert len(found.names) == len({*found.names}) == 33 + 42 - 6
    at = dict(zip(found.names, found.points.tolist(), strict=True))
    assert at["right_index1"] == px(RIGHT, 5)  # that of the hand, and not of the body
    assert at["left_index1"] == px(BODY, 19, BODY[19]["visibility"])
    assert at["left_ring1"] == [0, 0, 0]
    assert found.notes == ("a.json: not read are face_landmarks",)


def test_frames_without_hands_are_gaps_of_a_clip(tmp_path: Path) -> None:
    """A hand that is lost in a frame does not change the points of the clip."""
    one, whole = dict(RESULTS["hands-of-python"]), RESULTS["hands-of-python"]
    one |= {"handedness": whole["handedness"][:1], "hand_landmarks": whole["hand_landmarks"][:1]}
    none: dict[str, Any] = {"handedness": [], "hand_landmarks": []}
    for i, said in enumerate((whole, one, none, whole)):
        written(tmp_path / f"frame_{i}.json", said)
    clip = read_clip(tmp_path, fps=30, size=SIZE)
    assert clip.names == (*HANDS[0], *HANDS[1])
    seen = (clip.films[0].confidence > 0).sum(axis=1)
    assert seen.tolist() == [42, 21, 0, 42]


@pytest.mark.parametrize(
    ("said", "says"),
    [
        ({"hand_landmarks": [LEFT]}, "1 hands under hand_landmarks, and 0 entries that say which"),
        (
            {"hand_landmarks": [LEFT], "handedness": [[{"category_name": "Both"}]]},
            "is said to be Both|is said to be 'Both'; a hand is Left or Right",
        ),
        ({"pose_landmarks": [LEFT]}, "has 21 points; MediaPipe's has 33"),
        ({"left_hand_landmarks": [{"x": 0.1}] * 21}, "point 0 must have x and y"),
        ({"left_hand_landmarks": [{"x": "0.1", "y": 1}] * 21}, "must hold numbers"),
        ({"left_hand_landmarks": [{"x": 1e9, "y": 1}] * 21}, "as fractions of the image"),
        ({"pose_landmarks": [[{"x": 0, "y": 1, "visibility": -1}] * 33]}, "not from 0 to 1"),
        ({"pose_landmarks": "33"}, "must be a list of at most"),
        ({"pose_landmarks": []}, "found no hand and no body"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, said: dict[str, Any], says: str) -> None:
    with pytest.raises(BadFile, match=says):
        read_keypoints(written(tmp_path / "a.json", said), size=SIZE)


def test_the_size_of_the_image_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"fractions of an image.* give --size WIDTHxHEIGHT"):
        read_keypoints(written(tmp_path / "a.json", RESULTS["holistic"]))


def test_two_hands_of_one_side_are_told(tmp_path: Path) -> None:
    said = dict(RESULTS["hands-of-javascript"])
    said["handedness"] = [said["handedness"][0]] * 2
    (note,) = read_person(written(tmp_path / "a.json", said), size=SIZE).notes
    assert "holds 2 left hands; the first is read" in note


def test_a_hand_of_no_side_and_alphapose_by_bodies(tmp_path: Path) -> None:
    alone = {"annotations": [{"keypoints": person(21)}]}
    assert read_keypoints(written(tmp_path / "a.json", alone))[0] == HAND_POINTS
    cmu = {"version": 0.1, "bodies": [{"joints": person(18, at=7)}, {"joints": person(18)}]}
    file = written(tmp_path / "b.json", cmu)
    names, points, _ = read_keypoints(file, person=0)
    assert names == OPENPOSE_18
    assert points[0, 0] == 7
    assert "holds 2 people" in read_observations([file], size=SIZE).notes[0]
    wrong = {"bodies": [{"joints": person(15)}]}
    with pytest.raises(BadFile, match="15 keypoints per person; alphapose JSON has 17 or 18"):
        read_keypoints(written(tmp_path / "c.json", wrong))
    for i in range(2):
        (tmp_path / "clip").mkdir(exist_ok=True)
        (tmp_path / "clip" / f"f{i}.json").write_text(json.dumps(cmu))
    clip = read_clip(tmp_path / "clip", fps=30, size=SIZE)
    assert (clip.films[0].confidence > 0).all()


def test_the_table_of_schemas_has_as_many_names_as_it_says() -> None:
    for schema, names in KEYPOINT_SCHEMAS.items():
        said = (
            "25"
            if schema.endswith("BODY_25")
            else "".join(c if c.isdigit() else " " for c in schema)
        )
        assert len(names) == len({*names}) == int(said.split()[0]), schema
