"""Keypoints from files that detectors write, with their cameras."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.experiments.calibration_files import read_calibration
from workbench.experiments.observations import COCO, FEET, Observations, Photograph
from workbench.experiments.reading import json_in, numbers_in, size_in

Array = NDArray[np.float64]

_LIMBS = ("shoulder", "elbow", "wrist")
_ARMS = tuple(f"{side}_{part}" for side in ("right", "left") for part in _LIMBS)
OPENPOSE_25 = (
    "nose", "neck", *_ARMS, "mid_hip", "right_hip", "right_knee", "right_ankle", "left_hip",
    "left_knee", "left_ankle", "right_eye", "left_eye", "right_ear", "left_ear",
    "left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe",
    "right_heel",
)  # fmt: skip
OPENPOSE_18 = (
    "nose", "neck", *_ARMS, "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee",
    "left_ankle", "right_eye", "left_eye", "right_ear", "left_ear",
)  # fmt: skip
FARTHEST = 1e7  # px: no detector means a place farther out
BY_COUNT = {"openpose": {25: OPENPOSE_25, 18: OPENPOSE_18}, "coco": {17: COCO, 23: COCO + FEET}}


def read_keypoints(
    path: str | Path, *, size: tuple[int, int] | None = None, person: int | None = None
) -> tuple[tuple[str, ...], Array, tuple[int, int] | None]:
    """The names, the (M, 3) keypoints u, v, confidence, and the image's size if the file tells it.

    COCO (annotations or results; 17 keypoints, or 23 with feet) or OpenPose (BODY_25 or COCO-18)
    JSON. Of several people the one seen best is taken, or number `person`, counted from 0.
    Raises BadFile or UnknownName.
    """
    data = json_in(path)
    kind = "openpose" if isinstance(data, dict) and "people" in data else "coco"
    entries = _openpose(path, data) if kind == "openpose" else _coco(path, data)
    people = [_person(path, where, numbers) for where, numbers, _ in entries]
    if not any(len(one) for one in people):
        raise BadFile(
            f"{path} holds no person's keypoints; give COCO JSON (annotations with `keypoints`) "
            "or OpenPose JSON (`people` with `pose_keypoints_2d`)"
        )
    if person is not None and not 0 <= person < len(people):
        raise UnknownName("person", str(person), hint=f"0 to {len(people) - 1} in {path}")
    best = max(range(len(people)), key=lambda i: people[i][:, 2].sum() if len(people[i]) else -1.0)
    number = best if person is None else person
    chosen, (where, _, image) = people[number], entries[number]
    known = BY_COUNT[kind]
    if len(chosen) not in known:
        counts = " or ".join(map(str, known))
        raise BadFile(f"{path} has {len(chosen)} keypoints per person; {kind} JSON has {counts}")
    names = known[len(chosen)]
    lost = ~(np.abs(chosen[:, :2]) < FARTHEST).all(axis=1) & (chosen[:, 2] > 0)
    if lost.any():
        row = int(np.argmax(lost))
        raise BadFile(
            f"{path}: {where} has {names[row]} at {chosen[row, :2].tolist()} with confidence "
            f"{chosen[row, 2]:g}; give px, or confidence 0 if it was not seen"
        )
    if kind == "coco" and set(np.unique(chosen[:, 2])) <= {0.0, 1.0, 2.0}:
        chosen = np.column_stack([chosen[:, :2], chosen[:, 2] > 0])  # a visibility flag, 0 1 2
    return names, chosen, size or (_image_size(path, data, image) if kind == "coco" else None)


Entry = tuple[str, Any, Any]  # where it is in the file, the flat list of numbers, the image's id


def _openpose(path: str | Path, data: dict[str, Any]) -> list[Entry]:
    people = _objects(path, "people", data["people"])
    return [(where, one.get("pose_keypoints_2d", []), None) for where, one in people]


def _coco(path: str | Path, data: Any) -> list[Entry]:
    if isinstance(data, dict):
        data = data.get("annotations", [data])
    annotations = _objects(path, "annotations", data)
    return [
        (where, one["keypoints"], one.get("image_id"))
        for where, one in annotations
        if "keypoints" in one
    ]


def _objects(path: str | Path, what: str, found: Any) -> list[tuple[str, dict[str, Any]]]:
    """The objects of a list, each with where it is: `people[3]`."""
    if not isinstance(found, list):
        raise BadFile(f"{path}: {what} must be a list of objects, not {found!r:.60}")
    for i, one in enumerate(found):
        if not isinstance(one, dict):
            raise BadFile(f"{path}: {what}[{i}] must be an object, not {one!r:.60}")
    return [(f"{what}[{i}]", one) for i, one in enumerate(found)]


def _person(path: str | Path, where: str, given: Any) -> Array:
    """(M, 3): u, v, confidence; (0, 3) of a person without keypoints."""
    numbers = numbers_in(path, f"{where}: keypoints", given)
    if numbers.size % 3:
        raise BadFile(
            f"{path}: {where}: keypoints must be u, v, confidence of each, but are "
            f"{numbers.size} numbers"
        )
    points = numbers.reshape(-1, 3)
    unsure = ~(np.isfinite(points[:, 2]) & (points[:, 2] >= 0))
    if unsure.any():
        row = int(np.argmax(unsure))
        raise BadFile(
            f"{path}: {where}: keypoint {row} has confidence {points[row, 2]:g}; it must be a "
            "number from 0 (not seen) to 1"
        )
    return points


def _image_size(path: str | Path, data: Any, wanted: Any) -> tuple[int, int] | None:
    images = data.get("images", []) if isinstance(data, dict) else []
    for where, image in _objects(path, "images", images):
        if image.get("id") == wanted and "width" in image:
            return size_in(path, where, [image["width"], image.get("height")])
    return None


def read_observations(
    paths: Sequence[str | Path],
    *,
    calibration: str | Path | None = None,
    size: tuple[int, int] | None = None,
    focal: float | None = None,
    person: int | None = None,
) -> Observations:
    """One photograph per file; with several, the cameras are the calibration's, in its order.

    Raises BadFile, UnknownName, BadArgument or BadObservation.
    """
    if focal is not None and not 0 < focal < np.inf:
        raise BadArgument(f"a focal length is a number of px above 0, not {focal:g}")
    if size is not None and min(size) < 1:
        raise BadArgument(f"an image is at least 1 px wide and high, not {size[0]}x{size[1]}")
    cameras = read_calibration(calibration) if calibration is not None else {}
    if len(cameras) != len(paths) and (cameras or len(paths) > 1):
        many = f"{len(paths)} files of keypoints need" if len(paths) > 1 else "one file needs"
        raise BadFile(
            f"{many} as many calibrated cameras, but there are "
            f"{len(cameras)}; give --cameras FILE with one camera per file, in the same order"
        )
    photographs, all_names = [], []
    named: list[str | None] = list(cameras) if cameras else [None]
    for path, name in zip(paths, named, strict=True):
        camera = cameras.get(name, {}) if name is not None else {}
        names, points, found = read_keypoints(path, size=size or camera.get("size"), person=person)
        if found is None:
            raise BadFile(f"{path} does not tell the image's size; give --size WIDTHxHEIGHT in px")
        K = camera.get("K")
        if K is None and focal is not None:
            K = np.array([[focal, 0, found[0] / 2], [0, focal, found[1] / 2], [0, 0, 1]])
        photographs.append(
            Photograph(
                name or "camera", found, points[:, :2], points[:, 2],
                K, camera.get("R"), camera.get("t"), camera.get("distortion"),
            )
        )  # fmt: skip
        all_names.append(names)
    if len(set(all_names)) > 1:
        raise BadFile("the files list different keypoints; give files of one detector")
    return Observations(all_names[0], tuple(photographs))
