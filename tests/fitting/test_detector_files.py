"""Keypoints as detectors write them: OpenPose, COCO, AlphaPose, MediaPipe."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.bodies.random_bodies import entries
from tests.fitting.mediapipe_made import dots, mediapipe_results
from tests.fitting.test_cameras import openpose, person, written
from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import HAND_POINTS
from workbench.bodies.files.joint_names import HANDS as HAND_JOINTS
from workbench.bodies.files.layouts import body_from
from workbench.errors import BadFile, UnknownName
from workbench.fitting import read_clip, read_keypoints, read_observations
from workbench.fitting.files.keypoints import read_person
from workbench.fitting.files.layouts import (
    HALPE_26,
    HALPE_136,
    HANDS,
    MEDIAPIPE_33,
    OPENPOSE_18,
    OPENPOSE_25,
    OPENPOSE_135,
    SAPIENS_308,
    WHOLE_BODY,
)
from workbench.fitting.keypoints import keypoint_fit, unused
from workbench.fitting.observations import COCO, FEET, BadObservation, Observations, photograph


def test_coco_annotations_bring_the_size_of_their_image(tmp_path: Path) -> None:
    data = {
        "images": [{"id": 4, "width": 640, "height": 480}],
        "annotations": [{"image_id": 4, "keypoints": person(17, confidence=2)}],
    }
    names, points, size = read_keypoints(written(tmp_path / "a.json", data))
    assert names == COCO
    assert size == (640, 480)
    assert set(points[:, 2]) == {1.0}  # visibility 2 is no confidence of 2
    results = [{"image_id": 1, "keypoints": person(17), "score": 0.5}]  # a plain list
    assert read_keypoints(written(tmp_path / "a.json", results))[1].shape == (17, 3)


def test_damaged_keypoint_files_are_refused(tmp_path: Path) -> None:
    for data, said in [
        ({"people": [{"pose_keypoints_2d": person(19)}]}, "19 keypoints per person.*17, 18, 21"),
        ({"something": 1}, "no person's keypoints; it has the keys something"),
        ([{"bbox": [1, 2, 3, 4], "score": 1}], "it has the keys bbox, score"),
        (["a"], r"annotations\[0\] must be an object, not 'a'"),
        ({"annotations": [{"keypoints": "abc"}]}, "keypoints must be numbers, not 'abc'"),
        ({"annotations": [{"keypoints": [10**400] * 51}]}, "keypoints must be numbers"),
        ({"annotations": [{"keypoints": [1, 2]}]}, "but 2 numbers are not a multiple of three"),
        ({"images": [3], "annotations": [{"keypoints": person(17)}]}, r"images\[0\] must be an"),
        (
            {
                "images": [{"id": 1, "width": 0, "height": 5}],
                "annotations": [{"image_id": 1, "keypoints": person(17)}],
            },
            r"the size \[0, 5\]",
        ),
    ]:
        with pytest.raises(BadFile, match=said):
            read_keypoints(written(tmp_path / "a.json", data))


def test_keypoints_are_ordered_as_the_body() -> None:
    seen = read_back(("left_knee", "nose"))
    ordered = seen.ordered(("nose", "tail", "left_knee"))
    assert ordered.photographs[0].pixels.tolist() == [[1.0, 11.0], [0.0, 0.0], [0.0, 10.0]]
    assert ordered.photographs[0].confidence.tolist() == [1.0, 0.0, 1.0]
    with pytest.raises(BadObservation, match="none of the observed keypoints"):
        seen.ordered(("tail",))


def read_back(names: tuple[str, ...]) -> Observations:
    points = np.column_stack([np.arange(2), 10 + np.arange(2), np.ones(2)])
    return Observations(names, (photograph("front", (640, 480), points),))


SIZE = (640, 480)


def whole_body(**parts: Any) -> dict[str, Any]:
    image = {"id": 1, "width": SIZE[0], "height": SIZE[1]}
    return {"images": [image], "annotations": [{"image_id": 1, "keypoints": person(17), **parts}]}


def test_hands_of_openpose_are_read_by_name(tmp_path: Path) -> None:
    hands = {
        f"hand_{side}_keypoints_2d": person(21, at=at)
        for side, at in (("left", 300.0), ("right", 500.0))
    }
    names, points, _ = read_keypoints(written(tmp_path / "a.json", openpose(**hands)))
    assert names[25:] == HANDS[0] + HANDS[1]
    assert len(set(names)) == 25 + 42
    assert points[names.index("left_index1")].tolist() == [305.0, 310.0, 0.9]
    assert points[names.index("right_pinky_tip")].tolist() == [520.0, 540.0, 0.9]
    assert {n for n in names if n in HAND_JOINTS} == set(HAND_JOINTS)  # as SMPL-H calls them


def test_coco_wholebody_is_read_in_parts_or_one_list(tmp_path: Path) -> None:
    parts = {
        "foot_kpts": person(6, at=200.0),
        "lefthand_kpts": person(21, at=300.0),
        "righthand_kpts": person(21, at=400.0),
        "face_kpts": person(68, at=500.0),
        "lefthand_valid": True,
        "face_box": [1, 2, 3, 4],
    }
    file = written(tmp_path / "a.json", whole_body(**parts))
    names, points, size = read_keypoints(file)
    assert size == SIZE
    assert set(names) == set(WHOLE_BODY)
    assert names[17:23] == FEET
    assert points[names.index("left_heel"), 0] == 202.0
    assert points[names.index("right_thumb1"), 0] == 401.0
    assert read_observations([file]).notes == ()
    one = whole_body(keypoints=person(133))
    names, points, _ = read_keypoints(written(tmp_path / "b.json", one))
    assert names == WHOLE_BODY
    assert points[names.index("right_pinky_tip"), 0] == 100.0 + 132


def test_points_that_are_not_read_are_noted(tmp_path: Path) -> None:
    more = {
        "hand_left_keypoints_3d": [1.0] * 84,
        "hand_right_keypoints_2d": person(20),
        "face_keypoints_2d": [],
        "person_id": [-1],
    }
    file = written(tmp_path / "a.json", openpose(**more))
    (note,) = read_observations([file], size=SIZE).notes
    assert note == (
        "a.json: not read are hand_right_keypoints_2d (20 points), hand_left_keypoints_3d"
    )


def test_other_people_are_noted(tmp_path: Path) -> None:
    people = [{"pose_keypoints_2d": person(25, confidence=c)} for c in (0.3, 0.8)]
    file = written(tmp_path / "a.json", {"people": [*people, {"pose_keypoints_2d": []}]})
    (note,) = read_observations([file], size=SIZE).notes
    assert note.startswith("a.json holds 2 people; the largest, number 1 counted from 0")
    assert read_observations([file], size=SIZE, person=0).notes == ()


def test_fingers_are_fitted_by_bodies_that_have_them(
    tmp_path: Path,
) -> None:
    hands = {f"hand_{side}_keypoints_2d": person(21) for side in ("left", "right")}
    seen = read_observations([written(tmp_path / "a.json", openpose(**hands))], size=SIZE)
    (said,) = unused(seen, load_body("small"))
    assert said == (
        "Of 67 observed keypoints, 23 are fitted; the landmarks 'coco' of the body 'small' do not "
        "include the others: 21 of the left hand, 21 of the right hand, neck, mid_hip"
    )
    smpl_h = body_from(entries(K=52), "with fingers", "b")
    (said,) = unused(seen, smpl_h)
    assert "6 of the left hand, 6 of the right hand" in said  # its root and five tips
    fitted = keypoint_fit(seen, smpl_h, "which?").views[0]
    names = smpl_h.landmark_names(fitted.landmarks)
    assert {n for n, c in zip(names, fitted.confidence, strict=True) if c} >= set(HAND_JOINTS)


RESULTS = mediapipe_results()
LEFT, RIGHT, BODY = dots(21, 1), dots(21, 2), dots(33, 3, visible=True)


def px(points: list[dict[str, float]], i: int, confidence: float = 1.0) -> list[float]:
    return [points[i]["x"] * 640, points[i]["y"] * 480, confidence]


@pytest.mark.parametrize("name", ["hands-of-python", "hands-as-messages"])
def test_mediapipe_hands_are_read_by_name_and_side(tmp_path: Path, name: str) -> None:
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


def test_mediapipe_bodies_are_read(tmp_path: Path) -> None:
    file = written(tmp_path / "a.json", RESULTS["bodies-of-python"])
    boxes = [
        np.ptp([[p["x"], p["y"]] for p in dots(33, seed, visible=True) if p["visibility"] > 0.2], 0)
        for seed in (3, 4)
    ]
    best = np.linalg.norm(boxes, axis=1)
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


def test_mediapipe_holistic_has_both_hands(tmp_path: Path) -> None:
    found = read_person(written(tmp_path / "a.json", RESULTS["holistic"]), size=SIZE)
    assert len(found.names) == len({*found.names}) == 33 + 42 - 6
    at = dict(zip(found.names, found.points.tolist(), strict=True))
    assert at["right_index1"] == px(RIGHT, 5)  # that of the hand, and not of the body
    assert at["left_index1"] == px(BODY, 19, BODY[19]["visibility"])
    assert at["left_ring1"] == [0, 0, 0]
    assert found.notes == ("a.json: not read are face_landmarks",)


def test_mediapipe_frames_without_hands_are_gaps(tmp_path: Path) -> None:
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


def test_damaged_mediapipe_files_are_refused(tmp_path: Path) -> None:
    for said, says in [
        ({"hand_landmarks": [LEFT]}, "1 hands under hand_landmarks, and 0 entries that say which"),
        (
            {"hand_landmarks": [LEFT], "handedness": [[{"category_name": "Both"}]]},
            "is said to be Both|is said to be 'Both'; a hand is Left or Right",
        ),
        ({"pose_landmarks": [LEFT]}, "has 21 points; MediaPipe's has 33"),
        ({"pose_landmarks": 5}, "pose_landmarks must be a list of at most 1000, not 5"),
        ({"left_hand_landmarks": [{"x": "a", "y": 1}] * 21}, "must be numbers"),
    ]:
        with pytest.raises(BadFile, match=says):
            read_keypoints(written(tmp_path / "a.json", said), size=SIZE)


def test_mediapipe_hands_of_one_side_are_noted(tmp_path: Path) -> None:
    said = dict(RESULTS["hands-of-javascript"])
    said["handedness"] = [said["handedness"][0]] * 2
    (note,) = read_person(written(tmp_path / "a.json", said), size=SIZE).notes
    assert "holds 2 left hands; the first is read" in note


def test_alphapose_bodies_and_single_hands_are_read(tmp_path: Path) -> None:
    alone = {"annotations": [{"keypoints": person(21)}]}
    assert read_keypoints(written(tmp_path / "a.json", alone))[0] == HAND_POINTS
    cmu = {"version": 0.1, "bodies": [{"joints": person(18, at=7)}, {"joints": person(18)}]}
    file = written(tmp_path / "b.json", cmu)
    names, points, _ = read_keypoints(file, person=0)
    assert names == OPENPOSE_18
    assert points[0, 0] == 7
    assert "holds 2 people" in read_observations([file], size=SIZE).notes[0]


# Some numbers and names as the detectors' documents give them.
KNOWN = (
    (COCO, {0: "nose", 1: "left_eye", 4: "right_ear", 5: "left_shoulder", 16: "right_ankle"}),
    (OPENPOSE_25, {0: "nose", 1: "neck", 2: "right_shoulder", 7: "left_wrist", 8: "mid_hip"}),
    (OPENPOSE_25, {19: "left_big_toe", 20: "left_small_toe", 21: "left_heel", 24: "right_heel"}),
    (HALPE_26, {0: "nose", 17: "head_top", 18: "neck", 19: "mid_hip", 20: "left_big_toe"}),
    (HALPE_136, {26: "face_0", 93: "face_67", 94: "left_hand_root", 115: "right_hand_root"}),
    (OPENPOSE_135, {1: "left_eye", 17: "neck", 18: "head_top", 19: "left_big_toe"}),
    (MEDIAPIPE_33, {11: "left_shoulder", 16: "right_wrist", 17: "left_pinky1", 22: "right_thumb2"}),
    (SAPIENS_308, {5: "left_shoulder", 9: "left_hip", 15: "left_big_toe", 20: "right_heel"}),
    (SAPIENS_308, {41: "right_wrist", 62: "left_wrist", 63: "left_olecranon", 69: "neck"}),
)


def test_layouts_have_the_published_order() -> None:
    for names, known in KNOWN:
        assert {i: names[i] for i in known} == known


def seen_by(names: tuple[str, ...]) -> Array:
    """Points (M, 3) of a person in an image of 640 x 480 px."""
    rng = np.random.default_rng(len(names))
    return np.column_stack([rng.uniform(50, 450, (len(names), 2)), rng.uniform(0.3, 1, len(names))])


def by_person(names: tuple[str, ...], places: str = "keypoints", sure: str = "") -> dict[str, Any]:
    """One person with columns u, v and a list of confidences beside them, or in them."""
    points = seen_by(names)
    if not sure:
        return {places: points.tolist()}
    return {places: points[:, :2].tolist(), sure: points[:, 2].tolist()}


def columns(points: Array) -> dict[str, list[float]]:
    return dict(zip(("x", "y", "visible"), points.T.tolist(), strict=True))


def objects(names: tuple[str, ...], **keys: str) -> list[dict[str, Any]]:
    """A list of objects; `keys` say what name and confidence are called."""
    return [
        {"x": u, "y": v, keys["sure"]: c, keys["name"]: name}
        for name, (u, v, c) in zip(names, seen_by(names).tolist(), strict=True)
    ]


MMPOSE = {
    "keypoints": seen_by(COCO)[:, :2].tolist(),
    "keypoint_scores": seen_by(COCO)[:, 2].tolist(),
}
COCO_25 = (*COCO[:5], "neck", *COCO[5:11], "mid_hip", *COCO[11:], *FEET)  # of easy_ViTPose
GOLIATH = {i: name for i, name in enumerate(SAPIENS_308)} | {21: "right_thumb4", 70: "glabella"}
READ: dict[str, tuple[tuple[str, ...], Any]] = {  # the names of the points, and the file
    "MMPose 1.3, an image": (COCO, {"meta_info": {}, "instance_info": [MMPOSE | {"bbox": [[1]]}]}),
    "MMPose 1.3, a video": (COCO, {"instance_info": [{"frame_id": 1, "instances": [MMPOSE]}]}),
    "MMPose 1.3, the inferencer": (COCO, [MMPOSE]),
    "MMPose 0.29": (COCO, [by_person(COCO)]),
    "MMPose with names": (
        COCO[::-1],
        {
            "meta_info": {"keypoint_id2name": dict(enumerate(COCO[::-1]))},
            "instance_info": [by_person(COCO[::-1], sure="keypoint_scores")],
        },
    ),
    "Sapiens": (SAPIENS_308, {"instance_info": [by_person(SAPIENS_308, sure="keypoint_scores")]}),
    "Sapiens with Goliath's names": (
        SAPIENS_308,
        {
            "meta_info": {"keypoint_id2name": GOLIATH},
            "instance_info": [by_person(SAPIENS_308, sure="keypoint_scores")],
        },
    ),
    "Ultralytics 8.3": (
        COCO,
        [{"name": "person", "class": 0, "confidence": 0.9, "keypoints": columns(seen_by(COCO))}],
    ),
    "Ultralytics, normalized": (
        COCO,
        [{"name": "person", "keypoints": columns(seen_by(COCO) / [640, 480, 1])}],
    ),
    "EasyMocap": (
        OPENPOSE_25,
        {
            "filename": "images/1/000000.jpg",
            "height": 480,
            "width": 640,
            "annots": [{"bbox": [1, 2, 3, 4, 1], "personID": 0, **by_person(OPENPOSE_25)}],
        },
    ),
    "OpenPose 1.7": (
        OPENPOSE_25,
        {"version": 1.3, "people": [{"pose_keypoints_2d": seen_by(OPENPOSE_25).ravel().tolist()}]},
    ),
    "AlphaPose, an entry for each image": (
        OPENPOSE_18,
        {"7.jpg": {"people": [{"pose_keypoints_2d": seen_by(OPENPOSE_18).ravel().tolist()}]}},
    ),
    "OpenPose 1.0": (
        OPENPOSE_18,
        {"people": [{"pose_keypoints": seen_by(OPENPOSE_18).ravel().tolist()}]},
    ),
    "DWPose in ComfyUI": (
        OPENPOSE_18,
        [
            {
                "people": [{"pose_keypoints_2d": seen_by(OPENPOSE_18).ravel().tolist()}],
                "canvas_width": 640,
                "canvas_height": 480,
            }
        ],
    ),
    "easy_ViTPose": (
        COCO_25,
        {
            "keypoints": [{"3": seen_by(COCO_25)[:, [1, 0, 2]].tolist()}],
            "skeleton": {str(i): name for i, name in enumerate(COCO_25)},
        },
    ),
    "ViTPose of transformers": (COCO, [[by_person(COCO, sure="scores") | {"labels": [0]}]]),
    "MoveNet of TensorFlow.js": (
        COCO,
        [{"score": 0.8, "keypoints": objects(COCO, name="name", sure="score")}],
    ),
    "PoseNet": (
        COCO,
        [
            {
                "keypoints": [
                    {"part": n.replace("_e", "E"), "position": {"x": u, "y": v}, "score": c}
                    for n, (u, v, c) in zip(COCO, seen_by(COCO).tolist(), strict=True)
                ]
            }
        ],
    ),
    "Roboflow": (
        COCO,
        {
            "image": {"width": 640, "height": 480},
            "predictions": [{"keypoints": objects(COCO, name="class", sure="confidence")}],
        },
    ),
    "COCO with names of its own": (
        COCO[::-1],
        {
            "categories": [{"keypoints": [*COCO[::-1]]}],
            "annotations": [{"keypoints": seen_by(COCO).ravel().tolist()}],
        },
    ),
    "points by name": (FEET, dict(zip(FEET, seen_by(FEET).tolist(), strict=True))),
    "objects by name": (
        FEET,
        {
            "".join(
                word.title() for word in name.replace("left", "L").replace("right", "R").split("_")
            ): {"x": u, "y": v, "confidence": c}
            for name, (u, v, c) in zip(FEET, seen_by(FEET).tolist(), strict=True)
        },
    ),
    "people in lists": (COCO, [seen_by(COCO).tolist()]),
    "a list with depths": (MEDIAPIPE_33, np.insert(seen_by(MEDIAPIPE_33), 2, -0.1, 1).tolist()),
    **{
        f"a list of {len(names)}": (names, seen_by(names).tolist())
        for names in (HALPE_26, WHOLE_BODY)
    },
    "numbers of 25": (OPENPOSE_25, seen_by(OPENPOSE_25).ravel().tolist()),
}


@pytest.mark.parametrize("name", READ)
def test_published_keypoints_are_read(tmp_path: Path, name: str) -> None:
    names, data = READ[name]
    found = read_person(written(tmp_path / "a.json", data), size=SIZE)
    assert set(found.names) == {*names}
    order = [found.names.index(one) for one in names]
    np.testing.assert_allclose(found.points[order], seen_by(names), rtol=1e-12)
    of_image = ("EasyMocap", "DWPose in ComfyUI", "Roboflow")
    if name in of_image:
        assert read_keypoints(tmp_path / "a.json")[2] == SIZE
    said = ["fractions of the image"] if "normalized" in name else []
    assert [word for note in found.notes for word in said if word in note] == said
    assert len(found.notes) == len(said)


def test_values_that_say_nothing_are_not_seen(tmp_path: Path) -> None:
    points: list[Any] = seen_by(COCO).tolist()
    points[:9] = [
        *([None, 5.0, 0.9], [float("nan"), 5.0, 0.9], [-1.0, -1.0, 0.9], [0.0, 0.0, 0.9]),
        *([200.0, 200.0, -0.02], [200.0, 200.0, None], [1e300, 200.0, 0.9]),
        *(None, []),
    ]
    entry = {
        "keypoints": points,
        "handl2d": "none",
        "face2d": [[1]],
        "handr2d": [[np.nan] * 3] * 21,
    }
    found = read_person(written(tmp_path / "a.json", {"annots": [entry]}), size=SIZE)
    at = dict(zip(found.names, found.points, strict=True))
    assert [name for name in COCO if at[name][2] == 0] == [*COCO[:9]]
    np.testing.assert_array_equal(found.points[9:17], seen_by(COCO)[9:])
    assert (found.points[17:] == 0).all()
    assert found.notes == ("a.json: not read are handl2d, face2d",)
    by_name = dict(zip(COCO, points, strict=True))
    found = read_person(written(tmp_path / "b.json", by_name), size=SIZE)
    np.testing.assert_array_equal(found.points[:, 2] > 0, np.arange(17) > 8)


def test_fractions_need_the_size_of_the_image(tmp_path: Path) -> None:
    parts = (seen_by(OPENPOSE_25) / [640, 480, 1]).ravel().tolist()
    file = written(tmp_path / "a.json", {"people": [{"pose_keypoints_2d": parts}]})
    with pytest.raises(BadFile, match=r"fractions of an image, .* give --size WIDTHxHEIGHT"):
        read_keypoints(file)
    observed = read_observations([file], size=SIZE)
    np.testing.assert_allclose(observed.photographs[0].pixels, seen_by(OPENPOSE_25)[:, :2])
    assert "taken for fractions" in observed.notes[0]


def test_largest_person_is_taken(tmp_path: Path) -> None:
    near, far = seen_by(COCO), seen_by(COCO) * [0.5, 0.5, 1] + [300, 200, 0]
    ghost = seen_by(COCO) * [1.4, 1.4, 0.1]  # of which the detector is not sure
    people = [{"keypoints": one.tolist()} for one in (far, near * [1, 1, 0.8], ghost)]
    file = written(tmp_path / "a.json", people)
    found = read_person(file, size=SIZE)
    np.testing.assert_allclose(found.points, near * [1, 1, 0.8])
    assert found.notes == (
        "a.json holds 3 people; the largest, number 1 counted from 0, is read, and --person takes "
        "another",
    )
    np.testing.assert_allclose(read_keypoints(file, person=0)[1], far)
    with pytest.raises(UnknownName, match=r"there are 0, 1, 2 .*holds 3 people"):
        read_keypoints(file, person=3)


def test_files_of_many_images_want_video(tmp_path: Path) -> None:
    frames = [{"frame_id": i + 1, "instances": [MMPOSE]} for i in range(3)]
    for data in ({"instance_info": frames}, frames, [[MMPOSE]] * 3):
        file = written(tmp_path / "a.json", data)
        with pytest.raises(BadFile, match="the people of 3 images; fit them with --video"):
            read_keypoints(file)
        clip = read_clip(file, fps=30, size=SIZE)
        np.testing.assert_allclose(clip.films[0].pixels, [seen_by(COCO)[:, :2]] * 3)


def test_keypoint_that_is_not_finite_is_refused() -> None:
    points = np.ones((3, 3))
    points[1, 0] = np.nan
    with pytest.raises(BadObservation, match="front: keypoint 1 is"):
        photograph("front", (640, 480), points)
    points[1, 2] = 0  # not seen: its place does not matter
    assert photograph("front", (640, 480), points).confidence[1] == 0
