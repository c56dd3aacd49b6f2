"""Keypoints of people in files of detectors, and the cameras that saw them.

Detectors differ in the order and the names of their points, which are data in `layouts`. Whatever a
file holds and no fit reads (keypoints without a landmark, other people, keys of a calibration) is
named in a sentence among the `notes` of a `Setup`. AlphaPose (Fang et al., 2022) and COCO write all
images of a clip into one file: a list of people with the name of their image, or an object with an
entry for each image.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadArgument, BadFile, shown, some
from workbench.fitting.files.cameras import in_degrees, numbers_in, read_calibration, size_in
from workbench.fitting.files.layouts import (
    BODIES_FILES,
    COCO_FILES,
    OPENPOSE,
    DetectedPerson,
    KeypointLayout,
    no_such_person,
)
from workbench.fitting.files.mediapipe import is_mediapipe, mediapipe_people, mediapipe_person
from workbench.fitting.observations import Observations, Photograph, pinhole
from workbench.reading.facts import json_in

PEOPLE = {"people", "bodies"}  # what an entry of an image holds, as OpenPose and AlphaPose call it
MOST_PEOPLE = 300_000  # of one file; the largest of COCO holds 262,465
UNSEEN = np.zeros((0, 3))
FARTHEST = 1e7  # px: no detector reports a keypoint farther out


def number_in(name: Any) -> int | None:
    """The last number in the name of an image or of a file, or the number that it is."""
    if type(name) is int and 0 <= name < 10**12:
        return name
    digits = re.findall(r"\d{1,12}", Path(name).stem) if isinstance(name, str) else []
    return int(digits[-1]) if digits else None


def by_image(path: Path, data: Any) -> dict[int, Any]:
    """What the file says of each image, by the number in the image's name, in order.

    Each entry has the form of a file on one image. Raises BadFile if the file does not say which
    image a person is in.
    """
    found: dict[int, Any] = {}
    if isinstance(data, list) and data:
        for i, one in enumerate(data):
            name = one.get("image_id") if isinstance(one, dict) else None
            found.setdefault(_number(path, f"[{i}]", name), []).append(one)
    elif isinstance(data, dict) and isinstance(data.get("annotations"), list):
        return _annotated(path, data)
    elif (
        isinstance(data, dict)
        and data
        and all(isinstance(one, dict) and one.keys() & PEOPLE for one in data.values())
    ):
        for name, one in data.items():
            number = _number(path, "an entry", name)
            if number in found:
                raise BadFile(f"{path}: two images have the number {number}, in {shown(name)} too")
            found[number] = one
    else:
        raise BadFile(
            f"{path} does not say which image a person is in; give a file of AlphaPose or COCO "
            "with an `image_id` for each person, or a folder with a file for each frame"
        )
    return dict(sorted(found.items()))


def _annotated(path: Path, data: dict[str, Any]) -> dict[int, Any]:
    """The annotations of each image of COCO's form, numbered by file names if all have numbers."""
    images = data.get("images", [])
    if not isinstance(images, list) or not all(isinstance(one, dict) for one in images):
        raise BadFile(f"{path}: images must be a list of objects, not {shown(images)}")
    known = {str(one.get("id")): one for one in images}
    numbers = {name: number_in(one.get("file_name")) for name, one in known.items()}
    named = None not in numbers.values() and len({*numbers.values()}) == len(numbers)
    found: dict[int, Any] = {}
    for i, one in enumerate(data["annotations"]):
        name = one.get("image_id") if isinstance(one, dict) else None
        own = known.get(str(name))
        number = numbers[str(name)] if named and own is not None else None
        if number is None:
            number = _number(path, f"annotations[{i}]", name)
        empty = {"images": [] if own is None else [own], "annotations": []}
        found.setdefault(number, empty)["annotations"].append(one)
    return dict(sorted(found.items()))


def _number(path: Path, where: str, name: Any) -> int:
    number = number_in(name)
    if number is None:
        raise BadFile(
            f"{path}: {where} is of image {shown(name)}, and the name of a frame's image holds its "
            "number, such as frame_012.jpg"
        )
    return number


NOBODY: list[float] = []  # the keypoints of an entry without a person; files may hold many


def read_keypoints(
    path: str | Path, *, size: tuple[int, int] | None = None, person: int | None = None
) -> tuple[tuple[str, ...], Array, tuple[int, int] | None]:
    """Read names, keypoints (M, 3) as u, v, confidence, and the image's size if it is given.

    `KEYPOINT_SCHEMAS` lists the schemas. COCO JSON (annotations or results, as AlphaPose writes
    too) has 17 keypoints, 23 with feet, Halpe's 26 or 136, MediaPipe's 33 in px, COCO-WholeBody's
    133 in one list or in parts, or the 21 of a hand whose side it does not say; OpenPose JSON has
    BODY_25, BODY_135 or COCO-18, hands and face; AlphaPose's files with `bodies` have COCO-18. JSON
    of MediaPipe's own results has hands of 21 points and bodies of 33. Of several people the one
    with the largest sum of confidences is taken, or number `person`, counted from 0.

    Raises BadFile or UnknownName.
    """
    found = read_person(path, size=size, person=person)
    return found.names, found.points, found.size


def read_person(
    path: str | Path, *, size: tuple[int, int] | None = None, person: int | None = None
) -> DetectedPerson:
    """Read one person of a file as `read_keypoints` does, with notes on what else it holds.

    Raises BadFile or UnknownName.
    """
    return person_of(path, json_in(path), size, person)


def person_of(
    path: str | Path, data: Any, size: tuple[int, int] | None, person: int | None
) -> DetectedPerson:
    """One person of what a file, or its part on one image, holds; see `read_person`."""
    if is_mediapipe(data):
        return mediapipe_person(path, data, size, person)
    kind, entries = _entries(path, data)
    if len(entries) > MOST_PEOPLE:
        raise BadFile(
            f"{path} holds {len(entries):,} people, and at most {MOST_PEOPLE:,} are read; give a "
            "file with fewer"
        )
    people = [
        _person(path, where, given) if (given := one.get(kind.main, NOBODY)) != NOBODY else UNSEEN
        for where, one in entries
    ]
    if not any(len(one) for one in people):
        raise BadFile(
            f"{path} holds no person's keypoints; give COCO JSON (annotations with `keypoints`) "
            "or OpenPose JSON (`people` with `pose_keypoints_2d`)"
        )
    if person is not None and not 0 <= person < len(people):
        raise no_such_person(path, person, len(people))
    best = max(
        range(len(people)),
        key=lambda i: trusted(people[i])[:, 2].sum() if len(people[i]) else -1.0,
    )
    number = best if person is None else person
    where, given = entries[number]
    if len(people[number]) not in kind.bodies:
        counts = " or ".join(map(str, kind.bodies))
        raise BadFile(
            f"{path} has {len(people[number])} keypoints per person; {kind.name} JSON has {counts}"
        )
    body = kind.bodies[len(people[number])]
    names, chosen, notes = _with_parts(path, where, given, kind, (body, people[number]))
    scores, chosen = chosen[:, 2], trusted(chosen)
    if (scores > 1).any() and not {*scores[np.isfinite(scores)]} <= {0.0, 1.0, 2.0}:
        notes.append(
            f"{Path(path).name}: confidences of up to {np.nanmax(scores):g} are scores, of which "
            "those above 1 count as 1"
        )
    lost = ~(np.abs(chosen[:, :2]) < FARTHEST).all(axis=1) & (chosen[:, 2] > 0)
    if lost.any():
        row = int(np.argmax(lost))
        raise BadFile(
            f"{path}: {where} has {names[row]} at {chosen[row, :2].tolist()} with confidence "
            f"{chosen[row, 2]:g}; give px, or confidence 0 if it was not seen"
        )
    count = sum(len(one) > 0 for one in people)
    if person is None and count > 1:
        notes.append(
            f"{Path(path).name} holds {count} people; the one seen best, number {number} counted "
            "from 0, is read, and --person takes another"
        )
    if size is None and kind is COCO_FILES:
        size = _image_size(path, data, given.get("image_id"))
    return DetectedPerson(names, chosen, size, body, tuple(notes))


def people_of(path: str | Path, data: Any) -> list[int]:
    """The numbers of the people in it who have keypoints, as `person_of` takes them.

    Raises BadFile.
    """
    if is_mediapipe(data):
        return list(range(mediapipe_people(path, data)))
    kind, entries = _entries(path, data)
    return [i for i, (_, one) in enumerate(entries) if one.get(kind.main)]


def _entries(
    path: str | Path, data: Any
) -> tuple[KeypointLayout, list[tuple[str, dict[str, Any]]]]:
    """The layout of a file, and its people, each with its place in the file."""
    for key, kind in (("people", OPENPOSE), ("bodies", BODIES_FILES)):
        if isinstance(data, dict) and key in data:
            return kind, _objects(path, key, data[key])
    if isinstance(data, dict):
        data = data.get("annotations", [data])
    entries = _objects(path, "annotations", data)
    return COCO_FILES, [entry for entry in entries if "keypoints" in entry[1]]


def _with_parts(
    path: str | Path,
    where: str,
    given: dict[str, Any],
    kind: KeypointLayout,
    main: tuple[tuple[str, ...], Array],
) -> tuple[tuple[str, ...], Array, list[str]]:
    """Names and points of body, feet, hands and face, and a note on the points not read."""
    names, points, unread = list(main[0]), [main[1]], []
    for key, counts in kind.parts.items():
        if not given.get(key):
            continue
        part = _person(path, f"{where}: {key}", given[key])
        known = counts.get(len(part), ())
        if not known or set(known) & set(names):
            unread.append(f"{key} ({len(part)} points)")
            continue
        names += known
        points.append(part)
    unread += [
        key
        for key, value in given.items()
        if key not in (kind.main, *kind.parts) and value and _is_of_points(key)
    ]
    note = f"{Path(path).name}: not read are {some(unread)}"
    return tuple(names), np.concatenate(points), [note] if unread else []


def _is_of_points(key: str) -> bool:
    """Whether a key such as `pose_keypoints_3d` holds points, and not a number about points."""
    about = key.startswith("num_") or key.endswith("_valid")
    return ("keypoints" in key or "kpts" in key) and not about


def _objects(path: str | Path, what: str, found: Any) -> list[tuple[str, dict[str, Any]]]:
    """The objects of a list, each with its place in the file: `people[3]`."""
    if not isinstance(found, list):
        raise BadFile(f"{path}: {what} must be a list of objects, not {shown(found)}")
    for i, one in enumerate(found):
        if not isinstance(one, dict):
            raise BadFile(f"{path}: {what}[{i}] must be an object, not {shown(one)}")
    return [(f"{what}[{i}]", one) for i, one in enumerate(found)]


def _person(path: str | Path, where: str, given: Any) -> Array:
    """Keypoints (M, 3) as u, v, confidence; (0, 3) for a person without keypoints."""
    numbers = numbers_in(path, f"{where}: keypoints", given)
    if numbers.size % 3:
        raise BadFile(
            f"{path}: {where}: keypoints must be three numbers each, u, v and confidence, but "
            f"{numbers.size} numbers are not a multiple of three"
        )
    return numbers.reshape(-1, 3)


def trusted(points: Array) -> Array:
    """Keypoints (M, 3) with confidences from 0 to 1, as SPIN's weights c^2 take them.

    COCO's flags 0, 1, 2 and the scores of some detectors are above 1, and count as 1: a score says
    nothing about px, and must not make a sigma smaller. What is negative or not a number was not
    seen.
    """
    seen = np.isfinite(points).all(axis=1) & (points[:, 2] > 0)
    confidence = np.where(seen, np.minimum(points[:, 2], 1.0), 0.0)
    return np.column_stack([np.where(seen[:, None], points[:, :2], 0.0), confidence])


def _image_size(path: str | Path, data: Any, wanted: Any) -> tuple[int, int] | None:
    images = data.get("images", []) if isinstance(data, dict) else []
    if isinstance(wanted, list | dict):  # which could be too deep to be compared
        raise BadFile(f"{path}: image_id must be a number or a text, not {shown(wanted)}")
    for where, image in _objects(path, "images", images):
        if image.get("id") == wanted and "width" in image:
            return size_in(path, where, [image["width"], image.get("height")])
    return None


def calibration_of(
    camera: Mapping[str, Any], focal: float | None, size: tuple[int, int]
) -> tuple[Array | None, ...]:
    """K, R, t and distortion of a calibrated camera, each None if unknown; K from a given focal."""
    K = camera.get("K")
    K = pinhole(focal, *size) if K is None and focal is not None else K
    return K, *(camera.get(key) for key in ("R", "t", "distortion"))


def read_observations(
    paths: Sequence[str | Path],
    *,
    calibration: str | Path | None = None,
    size: tuple[int, int] | None = None,
    focal: float | None = None,
    person: int | None = None,
) -> Observations:
    """Read one photograph per file; the cameras of several are the calibration's, in its order.

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
    named: list[tuple[str, dict[str, Any]]] = list(cameras.items()) or [("camera", {})]
    photographs: list[Photograph] = []
    read: list[DetectedPerson] = []
    for path, (_, camera) in zip(paths, named, strict=True):
        found = read_person(path, size=size or camera.get("size"), person=person)
        if found.size is None:
            raise BadFile(
                f"{path} does not say how large the image is; give --size WIDTHxHEIGHT in px"
            )
        read.append(found)
    if len({one.body for one in read}) > 1:
        raise BadFile("the files list different keypoints; give files of one detector")
    names = tuple(dict.fromkeys(name for one in read for name in one.names))
    for found, (name, camera) in zip(read, named, strict=True):
        assert found.size is not None
        points = np.zeros((len(names), 3))  # hands that one file lacks have confidence 0 there
        points[[names.index(known) for known in found.names]] = found.points
        calibrated = calibration_of(camera, focal, found.size)
        photographs.append(Photograph(name, found.size, points[:, :2], points[:, 2], *calibrated))
    unread = [
        f"{Path(calibration).name}: of camera {shown(name)}, not read are {some(camera['unread'])}"
        for name, camera in cameras.items()
        if calibration is not None and camera["unread"]
    ]
    unread += in_degrees(calibration, cameras)
    return Observations(
        names, tuple(photographs), (*(note for one in read for note in one.notes), *unread)
    )
