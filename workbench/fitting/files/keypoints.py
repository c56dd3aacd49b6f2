"""Keypoints of people in files of detectors, and the cameras that saw them.

What detectors call their people and points is data here and in `layouts`; howto/formats.md lists
the formats. Whatever a file holds and no fit reads (keypoints without a landmark, other people,
keys of a calibration) is named in a sentence among the `notes` of a `Setup`.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadArgument, BadFile, shown, some
from workbench.fitting.files.cameras import cameras_of, notes_on, size_in
from workbench.fitting.files.layouts import BODIES, KNOWN, PARTS, keypoint_name
from workbench.fitting.files.mediapipe import is_mediapipe, mediapipe_people
from workbench.fitting.files.points import (
    DetectedPerson,
    how_large,
    in_px,
    is_point,
    no_such_person,
    points_in,
    trusted,
)
from workbench.fitting.observations import Observations, Photograph, pinhole
from workbench.reading.facts import json_in

PEOPLE_KEYS = (  # lists of people: of OpenPose, AlphaPose, COCO, EasyMocap, MMPose and Roboflow
    *("people", "bodies", "annotations", "annots", "instances", "instance_info", "predictions"),
)
KEYPOINT_KEYS = ("keypoints", "pose_keypoints_2d", "pose_keypoints", "joints")  # of one person
SCORE_KEYS = ("keypoint_scores", "scores", "keypoints_visible")  # beside keypoints (M, 2)
IMAGE_KEYS = ("image_id", "frame_id", "frame_index", "frame", "filename")  # what an image is called
SIZE_KEYS = (  # keys of an image's width and height
    *(("width", "height"), ("canvas_width", "canvas_height"), ("imageWidth", "imageHeight")),
)
MOST_PEOPLE = 300_000  # of one file; the largest of COCO holds 262,465


def number_in(name: Any) -> int | None:
    """The last number in the name of an image or of a file, or the number that it is."""
    if type(name) is int and 0 <= name < 10**12:
        return name
    digits = re.findall(r"\d{1,12}", Path(name).stem) if isinstance(name, str) else []
    return int(digits[-1]) if digits else None


def _has_people(entry: Any) -> bool:
    return isinstance(entry, dict) and any(isinstance(entry.get(key), list) for key in PEOPLE_KEYS)


def _has_keypoints(entry: Any) -> bool:
    return isinstance(entry, dict) and any(key in entry for key in KEYPOINT_KEYS)


def frames_in(data: Any) -> list[tuple[Any, Any]] | None:
    """What a file says of each image that it holds as a whole, with the image's name or number.

    None if the file has not the form of several images, such as that of MMPose's videos, a list of
    frames with `instances`. Each entry has the form of a file on one image.
    """
    about, frames = {}, data
    if isinstance(data, dict) and data and all(map(_has_people, data.values())):
        return [*data.items()]
    if isinstance(data, dict):
        about = {key: data[key] for key in data if key not in (*PEOPLE_KEYS, "keypoints")}
        frames = data.get("instance_info")
        if isinstance(data.get("skeleton"), dict) and isinstance(data.get("keypoints"), list):
            return [  # of easy_ViTPose: an object of people for each frame, points as v, u
                (i, about | {"people": [{"keypoints": _v_u_exchanged(p)} for p in frame.values()]})
                for i, frame in enumerate(data["keypoints"])
                if isinstance(frame, dict)
            ]
    if not isinstance(frames, list) or not frames:
        return None
    if all(map(_has_people, frames)):
        names = [next((f[key] for key in IMAGE_KEYS if key in f), i) for i, f in enumerate(frames)]
        return [(name, about | entry) for name, entry in zip(names, frames, strict=True)]
    if all(isinstance(entry, list) and all(map(_has_keypoints, entry)) for entry in frames):
        return [(i, entry) for i, entry in enumerate(frames)] if any(frames) else None
    return None


def _v_u_exchanged(points: Any) -> Any:
    """Points of v, u, confidence as u, v, confidence."""
    if not isinstance(points, list) or not all(is_point(point) for point in points):
        return points
    return [[point[1], point[0], *point[2:]] for point in points]


def by_image(path: Path, data: Any) -> dict[int, Any]:
    """What the file says of each image, by the number in the image's name, in order.

    Each entry has the form of a file on one image. Raises BadFile if the file does not say which
    image a person is in.
    """
    images: dict[int, Any] = {}
    frames = frames_in(data)
    if frames is not None:
        for name, entry in frames:
            number = _frame_number(path, "an entry", name)
            if number in images:
                raise BadFile(f"{path}: two images have the number {number}, in {shown(name)} too")
            images[number] = entry
    elif isinstance(data, list) and data:
        for i, entry in enumerate(data):
            name = entry.get("image_id") if isinstance(entry, dict) else None
            images.setdefault(_frame_number(path, f"[{i}]", name), []).append(entry)
    elif isinstance(data, dict) and isinstance(data.get("annotations"), list):
        return _annotated(path, data)
    else:
        raise BadFile(
            f"{path} does not say which image a person is in; give a file of AlphaPose or COCO "
            "with an `image_id` for each person, or a folder with a file for each frame"
        )
    return dict(sorted(images.items()))


def _annotated(path: Path, data: dict[str, Any]) -> dict[int, Any]:
    """The annotations of each image of COCO's form, numbered by file names if all have numbers."""
    images = data.get("images", [])
    if not isinstance(images, list) or not all(isinstance(entry, dict) for entry in images):
        raise BadFile(f"{path}: images must be a list of objects, not {shown(images)}")
    known = {str(entry.get("id")): entry for entry in images}
    numbers = {name: number_in(entry.get("file_name")) for name, entry in known.items()}
    named = None not in numbers.values() and len({*numbers.values()}) == len(numbers)
    about = {key: entry for key, entry in data.items() if key == "categories"}
    by_number: dict[int, Any] = {}
    for i, entry in enumerate(data["annotations"]):
        name = entry.get("image_id") if isinstance(entry, dict) else None
        own = known.get(str(name))
        number = numbers[str(name)] if named and own is not None else None
        if number is None:
            number = _frame_number(path, f"annotations[{i}]", name)
        empty = about | {"images": [] if own is None else [own], "annotations": []}
        by_number.setdefault(number, empty)["annotations"].append(entry)
    return dict(sorted(by_number.items()))


def _frame_number(path: Path, where: str, name: Any) -> int:
    number = number_in(name)
    if number is None:
        raise BadFile(
            f"{path}: {where} is of image {shown(name)}, and the name of a frame's image holds its "
            "number, such as frame_012.jpg"
        )
    return number


def read_keypoints(
    path: str | Path, *, size: tuple[int, int] | None = None, person: int | None = None
) -> tuple[tuple[str, ...], Array, tuple[int, int] | None]:
    """Read names, keypoints (M, 3) as u, v, confidence, and the image's size if it is given.

    It reads JSON of COCO, COCO-WholeBody, OpenPose, AlphaPose, MMPose, Sapiens, ViTPose,
    Ultralytics, EasyMocap and MediaPipe, and plain lists of as many points as one of
    `KEYPOINT_SCHEMAS` has, or of points by name. Of several people the one is taken who is largest
    in the image, or number `person`, counted from 0. A keypoint that is NaN, negative or zero was
    not seen, and has confidence 0.

    Raises BadFile or UnknownName.
    """
    detected = read_person(path, size=size, person=person)
    return detected.names, detected.points, detected.size


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
    data, entries, notes = _people(path, data)
    if len(entries) > MOST_PEOPLE:
        raise BadFile(
            f"{path} holds {len(entries):,} people, and at most {MOST_PEOPLE:,} are read; give a "
            "file with fewer"
        )
    if person is not None and entries and not 0 <= person < len(entries):
        raise no_such_person(path, person, len(entries))
    chosen = range(len(entries)) if person is None else [person] if entries else []
    people = {i: _main_points(path, *entries[i]) for i in chosen}
    seen = {i: trusted(points) for i, (_, points) in people.items() if len(points)}
    if not seen:
        raise BadFile(_without_keypoints(path, data))
    number = max(seen, key=lambda i: how_large(seen[i]))
    where, entry = entries[number]
    own, points = people[number]
    body = own or _names(path, data, len(points))
    names, points, unread = _with_parts(path, where, entry, (body, points))
    notes = [*notes, *unread]
    if (count := sum(bool(keypoints[:, 2].any()) for keypoints in seen.values())) > 1:
        notes.append(
            f"{Path(path).name} holds {count} people; the largest, number {number} counted from "
            "0, is read, and --person takes another"
        )
    scores = points[np.isfinite(points[:, 2]), 2]
    if (scores > 1).any() and not {*scores} <= {0.0, 1.0, 2.0}:
        notes.append(
            f"{Path(path).name}: confidences of up to {scores.max():g} are scores, of which "
            "those above 1 count as 1"
        )
    size = _image_size(path, data, entry) if size is None else size
    in_image, fractions = in_px(path, trusted(points), size, fractions=is_mediapipe(data))
    return DetectedPerson(names, in_image, size, () if own else body, (*notes, *fractions))


def people_of(path: str | Path, data: Any) -> list[int]:
    """The numbers of the people in it who have keypoints, as `person_of` takes them.

    Raises BadFile.
    """
    return [i for i, (_, entry) in enumerate(_people(path, data)[1]) if _main_keypoints(entry)]


def _main_keypoints(entry: Mapping[str, Any]) -> Any:
    """What an entry holds under the key of a body's keypoints."""
    return next((entry[key] for key in KEYPOINT_KEYS if key in entry), None)


def _main_points(path: str | Path, where: str, entry: dict[str, Any]) -> tuple[Any, Array]:
    main = _main_keypoints(entry)
    if main == []:  # an entry without a person; files may hold many
        return (), np.zeros((0, 3))
    scores = next((entry[key] for key in SCORE_KEYS if isinstance(entry.get(key), list)), None)
    return points_in(path, where, main, scores)


def _people(path: str | Path, data: Any) -> tuple[Any, list[tuple[str, dict[str, Any]]], list[str]]:
    """What a file says of one image; its people, each with the place in the file; and notes."""
    if is_mediapipe(data):
        return data, *mediapipe_people(path, data)
    frames = frames_in(data)
    if frames is not None:
        if len(frames) > 1:
            raise BadFile(
                f"{path} holds the people of {len(frames):,} images; fit them with --video, or "
                "give a file of one image"
            )
        data = frames[0][1] if frames else []
    where, listed = "annotations", data
    if isinstance(data, dict):
        key = next((key for key in PEOPLE_KEYS if key in data), None)
        if key is not None:
            where, listed = key, data[key]
        elif _has_keypoints(data):
            listed = [data]
        elif data and any(data.values()) and all(is_point(p or [0, 0]) for p in data.values()):
            listed = [{"keypoints": data}]
        else:
            raise BadFile(_without_keypoints(path, data))
    elif isinstance(data, list) and data:
        first = next((entry for entry in data if entry is not None), None)
        if is_point(first) or isinstance(first, int | float):
            listed = [{"keypoints": data}]
        elif isinstance(first, list) and first and is_point(first[0]):
            listed = [{"keypoints": entry} for entry in data]
    return data, [entry for entry in _objects(path, where, listed) if _has_keypoints(entry[1])], []


def _without_keypoints(path: str | Path, data: Any) -> str:
    """Why a file is refused, with its keys."""
    empty = [k for k in PEOPLE_KEYS if data.get(k) == []] if isinstance(data, dict) else []
    if empty:
        return f"{path} holds no person: its list `{empty[0]}` is empty"
    inside = data
    for _ in range(2):  # a list of people, or an object with one
        if isinstance(inside, dict):
            inside = next((inside[key] for key in PEOPLE_KEYS if inside.get(key)), inside)
        if isinstance(inside, list) and inside:
            inside = inside[0]
    keys = [*inside] if isinstance(inside, dict) else []
    has = f"; it has the keys {some(map(str, keys))}" if keys else f"; it is {shown(data)}"
    return (
        f"{path} holds no person's keypoints{has}. Read are COCO JSON (annotations with "
        "`keypoints`), OpenPose JSON (`people` with `pose_keypoints_2d`) and others, which "
        "howto/formats.md lists"
    )


def _names(path: str | Path, data: Any, count: int) -> tuple[str, ...]:
    """The names of so many keypoints: those that the file says, or those of the usual layout."""
    texts: Any = None
    if isinstance(data, dict):
        meta, categories = data.get("meta_info"), data.get("categories")
        texts = meta.get("keypoint_id2name") if isinstance(meta, dict) else data.get("skeleton")
        if isinstance(categories, list) and categories and isinstance(categories[0], dict):
            texts = categories[0].get("keypoints")
    if isinstance(texts, dict):
        texts = [*texts.values()]
    known = BODIES.get(count)
    if isinstance(texts, list) and len(texts) == count and all(isinstance(n, str) for n in texts):
        names = tuple(map(keypoint_name, texts))
        if known is None or any(a != b and a in KNOWN for a, b in zip(names, known, strict=True)):
            return names
    if known is None:
        raise BadFile(
            f"{path} has {count} keypoints per person, whose names it does not say; those of a "
            f"person are {', '.join(map(str, BODIES))}, as howto/formats.md says"
        )
    return known


def _with_parts(
    path: str | Path, where: str, entry: dict[str, Any], main: tuple[tuple[str, ...], Array]
) -> tuple[tuple[str, ...], Array, list[str]]:
    """Names and points of body, feet, hands and face, and a note on the points not read."""
    names, points, unread = list(main[0]), [main[1]], []
    for key, value in entry.items():
        if key in PARTS and value:
            try:
                part = points_in(path, f"{where}: {key}", value)[1]
            except BadFile:  # a hand or a face that perhaps no body needs
                unread.append(key)
                continue
            known = PARTS[key].get(len(part), ())
            if not known or set(known) & set(names):
                unread.append(f"{key} ({len(part)} points)")
                continue
            names += known
            points.append(part)
    unread += [
        key
        for key, value in entry.items()
        if key not in (*KEYPOINT_KEYS, *SCORE_KEYS, *PARTS) and value and _is_of_points(key)
    ]
    note = f"{Path(path).name}: not read are {some(unread)}"
    return tuple(names), np.concatenate(points), [note] if unread else []


def _is_of_points(key: str) -> bool:
    """Whether a key such as `pose_keypoints_3d` holds points, and not a number about points."""
    about = key.startswith("num_") or key.endswith("_valid")
    return ("keypoints" in key or "kpts" in key) and not about


def _objects(path: str | Path, what: str, entries: Any) -> list[tuple[str, dict[str, Any]]]:
    """The objects of a list, each with its place in the file: `people[3]`."""
    if not isinstance(entries, list):
        raise BadFile(f"{path}: {what} must be a list of objects, not {shown(entries)}")
    for i, entry in enumerate(entries):
        if not isinstance(entry, dict):
            raise BadFile(f"{path}: {what}[{i}] must be an object, not {shown(entry)}")
    return [(f"{what}[{i}]", entry) for i, entry in enumerate(entries)]


def _image_size(path: str | Path, data: Any, entry: dict[str, Any]) -> tuple[int, int] | None:
    """The size of an entry's image: that of its `image_id`, or of the file's only image."""
    if not isinstance(data, dict):
        return None
    image_id = entry.get("image_id")
    if isinstance(image_id, list | dict):  # which could be too deep to be compared
        raise BadFile(f"{path}: image_id must be a number or a text, not {shown(image_id)}")
    of_id = [
        candidate
        for candidate in _objects(path, "images", data.get("images", []))
        if candidate[1].get("id") == image_id
    ]
    inner = data.get("image")
    whole = [("the image", candidate) for candidate in (inner, data) if isinstance(candidate, dict)]
    for where, image in of_id or whole:
        for width, height in SIZE_KEYS:
            if width in image:
                return size_in(path, where, [image[width], image.get(height)])
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
    camera_to_world: bool = False,
) -> Observations:
    """Read one photograph per file; the cameras of several are the calibration's, in its order.

    Of a calibration with more cameras those are taken whose names are in those of the files.
    `camera_to_world` says that its extrinsics are poses of cameras.

    Raises BadFile, UnknownName, BadArgument or BadObservation.
    """
    if focal is not None and not 0 < focal < np.inf:
        raise BadArgument(f"a focal length is a number of px above 0, not {focal:g}")
    if size is not None and min(size) < 1:
        raise BadArgument(f"an image is at least 1 px wide and high, not {size[0]}x{size[1]}")
    cameras = cameras_of([Path(path) for path in paths], calibration, camera_to_world)
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
        seen = read_person(path, size=size or camera.get("size"), person=person)
        if seen.size is None:
            raise BadFile(
                f"{path} does not say how large the image is; give --size WIDTHxHEIGHT in px"
            )
        read.append(seen)
    if len({seen.body for seen in read}) > 1:
        raise BadFile("the files list different keypoints; give files of one detector")
    names = tuple(dict.fromkeys(name for seen in read for name in seen.names))
    for seen, (name, camera) in zip(read, named, strict=True):
        assert seen.size is not None
        points = np.zeros((len(names), 3))  # hands that one file lacks have confidence 0 there
        points[[names.index(known) for known in seen.names]] = seen.points
        calibrated = calibration_of(camera, focal, seen.size)
        photographs.append(Photograph(name, seen.size, points[:, :2], points[:, 2], *calibrated))
    notes = (
        *(note for seen in read for note in seen.notes),
        *notes_on(calibration, cameras),
    )
    return Observations(names, tuple(photographs), notes)
