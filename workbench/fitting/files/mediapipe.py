"""What MediaPipe finds in JSON: hands of 21 points, bodies of 33, or both.

Programs write MediaPipe's results in three ways: the tasks' results with
the keys of Python (`hand_landmarks`, `handedness`, `pose_landmarks`) or of JavaScript (`landmarks`,
`handedness`), and the messages of the older solutions (`multiHandLandmarks`, `multiHandedness`,
`leftHandLandmarks`), whose lists are under `landmark`. Points are fractions of the image's width
and height there, so that the size of the image must be known.
"""

import re
from pathlib import Path
from typing import Any

from workbench.errors import BadFile, shown, some
from workbench.fitting.files.layouts import HANDS, MEDIAPIPE_33
from workbench.fitting.files.points import points_in
from workbench.fitting.observations import SIDES

UNSEEN = [0.0, 0.0, 0.0]
HANDS_KEYS = ("hand_landmarks", "multi_hand_landmarks")
POSES_KEY = "pose_landmarks"
SIDE_KEYS = ("handedness", "handednesses", "multi_handedness")
EITHER_KEY = "landmarks"  # of JavaScript: hands if there is a handedness, and poses if not
KNOWN_KEYS = {
    *HANDS_KEYS,
    POSES_KEY,
    EITHER_KEY,
    *SIDE_KEYS,
    *(f"{side}_hand_landmarks" for side in SIDES),
}
MOST_LISTED = 1000  # hands or bodies of one image


def is_mediapipe(data: Any) -> bool:
    """Whether the content of a JSON file is a result of MediaPipe."""
    return isinstance(data, dict) and any(_snake(key) in KNOWN_KEYS for key in data)


def mediapipe_people(
    path: str | Path, data: dict[str, Any]
) -> tuple[list[tuple[str, dict[str, Any]]], list[str]]:
    """People by the place in the file, each with the `keypoints` of body and hands by name; notes.

    Points are u, v as fractions of the image and a confidence, 1 for a hand and the visibility for
    a body. Both hands are always there if the file can hold hands, with confidence 0 if they were
    not seen. Where a hand is seen, it replaces the three points that the body has of it. Hands
    without a body are one person. Raises BadFile.
    """
    result = {_snake(key): value for key, value in data.items()}
    hands, bodies = _hands(path, result), _bodies(path, result)
    unread = sorted(
        key
        for key, value in result.items()
        if key not in KNOWN_KEYS and value and isinstance(value, list | dict)
    )
    notes = [f"{Path(path).name}: not read are {some(unread)}"] if unread else []
    looked_for = any("hand_landmarks" in key or "handed" in key for key in result)
    known = dict.fromkeys([*HANDS[0], *HANDS[1]], UNSEEN) if looked_for else {}
    seen: dict[str, list[float]] = {}
    for side, own in zip(SIDES, HANDS, strict=True):
        several = [points for where, points in hands if where == side]
        if len(several) > 1:
            notes.append(
                f"{Path(path).name} holds {len(several)} {side} hands; the first is read. "
                "MediaPipe takes a hand for the other one in an image that is mirrored"
            )
        seen |= dict(zip(own, several[0], strict=True)) if several else {}
    if len(bodies) > 1 and looked_for:
        notes.append(f"{Path(path).name} does not say whose the hands are; they go with any body")
    named = [dict(zip(MEDIAPIPE_33, body, strict=True)) for body in bodies]
    people = [known | body | seen for body in named or ([{}] if hands else [])]
    return [(f"{POSES_KEY}[{i}]", {"keypoints": person}) for i, person in enumerate(people)], notes


def _snake(key: Any) -> str:
    """The key as Python would write it: `handLandmarks` -> `hand_landmarks`."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", str(key)[:60]).lower()


def _hands(path: str | Path, result: dict[str, Any]) -> list[tuple[str, list[list[float]]]]:
    """Each hand with its side."""
    hands = []
    for side in SIDES:
        if entry := result.get(f"{side}_hand_landmarks"):
            points = _landmarks(entry)
            hands.append((side, _points_of(path, f"{side}_hand_landmarks", points, 21)))
    sides = next((result[key] for key in SIDE_KEYS if result.get(key)), None)
    keys = [key for key in (*HANDS_KEYS, *((EITHER_KEY,) if sides else ())) if result.get(key)]
    for key in keys[:1]:
        several = _checked_list(path, key, result[key])
        named = _checked_list(path, "handedness", sides) if sides else []
        if len(named) != len(several):
            raise BadFile(
                f"{path} holds {len(several)} hands under {key}, and {len(named)} entries that say "
                "which is left and which is right; write `handedness` with one for each"
            )
        for i, (hand, label) in enumerate(zip(several, named, strict=True)):
            where = f"{key}[{i}]"
            hands.append((_side(path, where, label), _points_of(path, where, _landmarks(hand), 21)))
    return hands


def _bodies(path: str | Path, result: dict[str, Any]) -> list[list[list[float]]]:
    of_either = not any("handed" in key for key in result)
    key = POSES_KEY if result.get(POSES_KEY) else EITHER_KEY if of_either else ""
    entries = result.get(key)
    if not entries:
        return []
    first = entries[0] if isinstance(entries, list) else None
    if isinstance(entries, dict) or (isinstance(first, dict) and "x" in first):
        entries = [entries]  # the one person of the older solutions, and of the holistic model
    several = _checked_list(path, key, entries)
    return [_points_of(path, f"{key}[{i}]", _landmarks(body), 33) for i, body in enumerate(several)]


def _landmarks(entry: Any) -> Any:
    """The list of points, which messages hold under `landmark`; of several, the first."""
    if isinstance(entry, dict):
        entry = entry.get("landmark", entry.get("landmarks"))
    return entry[0] if isinstance(entry, list) and entry and isinstance(entry[0], list) else entry


def _checked_list(path: str | Path, key: str, value: Any) -> list[Any]:
    if not isinstance(value, list) or len(value) > MOST_LISTED:
        raise BadFile(f"{path}: {key} must be a list of at most {MOST_LISTED}, not {shown(value)}")
    return value


def _side(path: str | Path, where: str, label: Any) -> str:
    """Left or right, by a category of MediaPipe's tasks or a classification of its messages."""
    if isinstance(label, dict):
        label = label.get("classification", [label])
    first = label[0] if isinstance(label, list) and label else label
    if isinstance(first, dict):
        named = {_snake(key): value for key, value in first.items()}
        first = next((named[k] for k in ("category_name", "label") if k in named), None)
    side = first.lower() if isinstance(first, str) else ""
    if side not in SIDES:
        raise BadFile(f"{path}: {where} is said to be {shown(first)}; a hand is Left or Right")
    return side


def _points_of(path: str | Path, where: str, entries: Any, count: int) -> list[list[float]]:
    """As many points as `count`: u and v as fractions of the image, and a confidence."""
    if not isinstance(entries, list) or len(entries) != count:
        many = f"{len(entries)} points" if isinstance(entries, list) else shown(entries)
        raise BadFile(f"{path}: {where} has {many}; MediaPipe's has {count}, each with x and y")
    points: list[list[float]] = points_in(path, where, entries)[1].tolist()
    if count == 21:  # older solutions give hands a visibility of 0
        return [[u, v, 1.0] for u, v, _ in points]
    return points
