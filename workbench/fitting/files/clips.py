"""A clip in files: a keypoint file for each frame or one for all, of one camera or several."""

import re
from collections.abc import Sequence
from math import gcd
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.blocks.checks import above_zero
from workbench.errors import BadFile, UnknownName, some
from workbench.fitting.files.cameras import cameras_of, notes_on
from workbench.fitting.files.keypoints import (
    by_image,
    calibration_of,
    number_in,
    people_of,
    person_of,
)
from workbench.fitting.files.points import DetectedPerson, how_large
from workbench.fitting.observations import FEWEST_PLACING, Clip, Film
from workbench.reading.facts import json_in

MOST_FRAMES, MOST_PEOPLE = 100_000, 100  # of a clip, and of one of its frames
FARTHEST_STEP = 1.0  # of a person between two frames, in diagonals of the person's box
DIFFERENT = "files list different keypoints; give one detector's"
Frame = tuple[Path, Any]  # a file, and what it says of one frame; None for all of it


def read_clip(
    folder: str | Path,
    *,
    fps: float,
    calibration: str | Path | None = None,
    size: tuple[int, int] | None = None,
    focal: float | None = None,
    person: int | None = None,
    camera_to_world: bool = False,
) -> Clip:
    """Read the JSON files of a folder as `read_keypoints` does, or of a folder for each camera.

    One file that holds all images, as AlphaPose, COCO, MMPose and easy_ViTPose write, may take the
    place of a folder, or be the only file in one; its frames have the numbers in the names of the
    images, or are counted.
    Files are ordered by the last number in their names; frames of which there is no file are gaps,
    and a note says which. If the numbers grow by a constant step, such as 10, 20, 30, each step is
    one frame, and `fps` are those of the files. Of several people in a frame the one nearest to
    where the person was before is followed; the first is number `person`, or the largest.
    Folders of cameras go with the cameras of the calibration, by name or else in order.

    Raises BadFile, UnknownName, BadArgument or BadObservation.
    """
    root = Path(folder)
    above_zero("a clip", fps=fps)
    inner = _folders_of_cameras(root)
    cameras = inner or [root]
    known = cameras_of(cameras, calibration, camera_to_world)
    if len(known) != len(cameras) and (known or len(cameras) > 1):
        raise BadFile(
            f"{root} holds the frames of {len(cameras)} cameras, and {len(known)} are calibrated; "
            "give --cameras FILE with one camera for each folder"
        )
    names = [path.name for path in cameras] if inner else list(known) or ["camera"]
    by_name = {*names} <= {*known}
    numbered = [_numbered(path) for path in cameras]
    numbers = sorted({n for files in numbered for n in files})
    step = gcd(*np.diff(numbers).tolist()) or 1
    frames = range(numbers[0], numbers[-1] + 1, step)
    if len(frames) > MOST_FRAMES:
        raise BadFile(f"{root} has frames {frames[0]} to {frames[-1]}; at most {MOST_FRAMES:,}")
    notes: list[str] = []
    films: list[Film] = []
    keypoints: tuple[str, ...] = ()
    for i, (name, files) in enumerate(zip(names, numbered, strict=True)):
        camera = known[name] if by_name else list(known.values())[i] if known else {}
        people, more = _followed(files, frames, size or camera.get("size"), person)
        notes += more
        own_keypoints, image = _described(cameras[i], people)
        keypoints = keypoints or own_keypoints
        if not set(own_keypoints) <= set(keypoints):
            raise BadFile(f"{cameras[i]}: {DIFFERENT}")
        points = np.zeros((len(frames), len(keypoints), 3))
        for t, detected in enumerate(people):
            if detected is not None:
                points[t, [keypoints.index(n) for n in detected.names]] = detected.points
        calibrated = calibration_of(camera, focal, image)
        films.append(Film(name, image, points[..., :2], points[..., 2], *calibrated))
    notes += notes_on(calibration, known)
    return Clip(keypoints, tuple(films), fps, tuple(dict.fromkeys(notes)))


def _folders_of_cameras(root: Path) -> list[Path]:
    """The folders of cameras in that of a clip; none if it holds the frames of a single camera."""
    if root.is_file() and root.suffix.lower() == ".json":
        return []
    if not root.is_dir():
        raise BadFile(
            f"{root} is no folder; a clip is a folder with a JSON file for each frame, or one "
            ".json of AlphaPose or COCO with all of them"
        )
    inner = sorted(path for path in root.iterdir() if path.is_dir() and any(path.glob("*.json")))
    if inner and any(root.glob("*.json")):
        raise BadFile(
            f"{root} holds JSON files and folders of JSON files; give the folder of one camera, or "
            "one that holds nothing but a folder for each camera"
        )
    return inner


def _described(
    camera: Path, people: Sequence[DetectedPerson | None]
) -> tuple[tuple[str, ...], tuple[int, int]]:
    """The keypoints that a camera's frames list, and the size of its images. Raises BadFile."""
    seen = [detected for detected in people if detected is not None]
    if not seen:
        raise BadFile(f"{camera}: no frame holds a person")
    image, *other_sizes = {detected.size for detected in seen}
    if other_sizes or image is None:
        sizes = sorted({str(detected.size) for detected in seen})
        raise BadFile(
            f"{camera}: images have the sizes {sizes}; a clip has one, which --size WIDTHxHEIGHT "
            "says"
        )
    if len({detected.body for detected in seen}) > 1:
        raise BadFile(f"{camera}: {DIFFERENT}")
    return tuple(dict.fromkeys(name for detected in seen for name in detected.names)), image


def _numbered(folder: Path) -> dict[int, Frame]:
    """The frames of a file or a folder by the last number in their names. Raises BadFile."""
    paths = sorted(folder.glob("*.json")) if folder.is_dir() else [folder]
    if len(paths) == 1 and (paths[0] == folder or number_in(paths[0].name) is None):
        parts = by_image(paths[0], json_in(paths[0]))
        if not parts:
            raise BadFile(f"{paths[0]} holds no frame with a person")
        return {number: (paths[0], part) for number, part in parts.items()}
    frames: dict[int, Frame] = {}
    for path in paths:
        number = number_in(path.name)
        if number is None:
            raise BadFile(f"{path}: the name of a frame holds its number, such as frame_012.json")
        if number in frames:
            raise BadFile(
                f"{frames[number][0]} and {path} have the same number, {number}; keep one"
            )
        frames[number] = path, None
    if not frames:
        raise BadFile(f"{folder} holds no JSON file; a clip has one for each frame")
    return frames


def _followed(
    files: dict[int, Frame], frames: range, size: tuple[int, int] | None, person: int | None
) -> tuple[list[DetectedPerson | None], list[str]]:
    """One person in every frame, or None, and notes."""
    followed: list[DetectedPerson | None] = []
    last: Array | None = None
    several = lost = 0
    path, part = next(iter(files.values()))
    folder = path.parent.name if part is None else path.name
    for number in frames:
        people = _people(files[number], size) if number in files else {}
        several += len(people) > 1
        if not people:
            followed.append(None)
        elif last is None:
            if person is not None and person not in people:
                raise UnknownName("person", str(person), map(str, people))
            best = max(people, key=lambda i: how_large(people[i].points))
            followed.append(people[best if person is None else person])
        else:
            near = {i: _apart(last, detected.points) for i, detected in people.items()}
            i = min(near, key=lambda i: near[i])
            followed.append(people[i] if near[i] < FARTHEST_STEP else None)
            lost += followed[-1] is None
        detected = followed[-1]
        if detected is not None and (detected.points[:, 2] > 0).sum() >= FEWEST_PLACING:
            last = detected.points  # fewer keypoints do not say how large a person is
    alike: dict[str, list[str]] = {}  # notes on frames that say the same, whatever the numbers
    for detected in followed:
        for note in () if detected is None else detected.notes:
            alike.setdefault(re.sub(r"\d+", "", note), []).append(note)
    notes = [
        same[0] if len(same) == 1 else f"{same[0]} (and so in {len(same)} frames)"
        for same in alike.values()
    ]
    missing = [str(n) for n in frames if n not in files]
    if missing:
        what = "there are no files of" if part is None else "nothing is said of"
        notes.append(f"{folder}: {what} frames {some(missing)}, which are gaps")
    if several:
        notes.append(
            f"{folder}: {several} frames hold several people; one is followed, from the "
            "largest of the first frame unless --person says which"
        )
    if lost:
        notes.append(f"{folder}: in {lost} frames nobody is near to where the person was: gaps")
    return followed, notes


def _people(frame: Frame, size: tuple[int, int] | None) -> dict[int, DetectedPerson]:
    """The people of a frame who have a keypoint, by their number in it."""
    path, part = frame
    content = json_in(path) if part is None else part
    numbers = people_of(path, content)
    if len(numbers) > MOST_PEOPLE:
        raise BadFile(
            f"{path} holds {len(numbers):,} people in one image; a frame of a clip, {MOST_PEOPLE}"
        )
    people = {i: person_of(path, content, size, i) for i in numbers}
    return {i: detected for i, detected in people.items() if (detected.points[:, 2] > 0).any()}


def _apart(last: Array, now: Array) -> float:
    """The mean distance of the keypoints that both have, over the diagonal of the last one's box.

    Infinite if they have none in common.
    """
    if len(last) != len(now):
        return np.inf
    both = (last[:, 2] > 0) & (now[:, 2] > 0)
    if not both.any():
        return np.inf
    box = np.ptp(last[last[:, 2] > 0, :2], axis=0)
    far = np.linalg.norm(last[both, :2] - now[both, :2], axis=1).mean()
    return float(far / max(np.linalg.norm(box), 1.0))
