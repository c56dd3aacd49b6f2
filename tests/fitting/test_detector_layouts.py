"""The schemas of detectors: names in the published order, and what a body lacks of them."""

import json
from pathlib import Path

import numpy as np
import pytest

from workbench import load_body
from workbench.fitting import read_keypoints, read_observations
from workbench.fitting.detector_layouts import (
    COCO_FILES,
    HALPE_26,
    HALPE_136,
    MEDIAPIPE_33,
    OPENPOSE,
    OPENPOSE_135,
)
from workbench.fitting.keypoints import unused

# Some numbers and names as the detectors' documents give them.
KNOWN = (
    (HALPE_26, {0: "nose", 17: "head_top", 18: "neck", 19: "mid_hip", 20: "left_big_toe"}),
    (HALPE_26, {21: "right_big_toe", 22: "left_small_toe", 25: "right_heel"}),
    (HALPE_136, {26: "face_0", 93: "face_67", 94: "left_hand_root", 115: "right_hand_root"}),
    (OPENPOSE_135, {1: "left_eye", 17: "neck", 18: "head_top", 19: "left_big_toe"}),
    (OPENPOSE_135, {24: "right_heel", 25: "left_thumb1", 44: "left_pinky_tip", 65: "face_0"}),
    (MEDIAPIPE_33, {1: "left_eye_inner", 5: "right_eye", 7: "left_ear", 9: "left_mouth"}),
    (MEDIAPIPE_33, {11: "left_shoulder", 16: "right_wrist", 17: "left_pinky1", 22: "right_thumb2"}),
    (MEDIAPIPE_33, {24: "right_hip", 28: "right_ankle", 29: "left_heel", 32: "right_foot_index"}),
)


@pytest.mark.parametrize(("names", "known"), KNOWN)
def test_points_are_where_the_detector_puts_them(
    names: tuple[str, ...], known: dict[int, str]
) -> None:
    assert {i: names[i] for i in known} == known


@pytest.mark.parametrize("layout", [COCO_FILES, OPENPOSE])
def test_every_schema_has_as_many_different_names_as_it_says(layout: object) -> None:
    assert layout in (COCO_FILES, OPENPOSE)
    for count, names in layout.bodies.items():  # type: ignore[attr-defined]
        assert len(names) == len({*names}) == count


def file_of(folder: Path, count: int) -> Path:
    rng = np.random.default_rng(count)
    flat = np.column_stack([rng.uniform(0, 400, (count, 2)), np.full(count, 0.9)]).ravel()
    entry = {"image_id": "a.jpg", "category_id": 1, "keypoints": flat.tolist(), "score": 2.5}
    path = folder / "alphapose-results.json"
    path.write_text(json.dumps([entry]))
    return path


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (26, "head_top, mid_hip, neck"),
        (136, "21 of the left hand, 21 of the right hand, 68 of the face, head_top, mid_hip, neck"),
        (
            33,
            "3 of the left hand, 3 of the right hand, left_eye_inner, left_eye_outer, "
            "left_foot_index, left_mouth, right_eye_inner, right_eye_outer, right_foot_index, "
            "right_mouth",
        ),
    ],
)
def test_what_the_body_lacks_is_named(tmp_path: Path, count: int, said: str) -> None:
    path = file_of(tmp_path, count)
    names, points, _ = read_keypoints(path)
    assert len(names) == len(points) == count
    (note,) = unused(read_observations([path], size=(400, 400)), load_body("small"))
    named = note.rpartition("do not include the others: ")[2]
    assert sorted(named.split(", ")) == sorted(said.split(", "))
