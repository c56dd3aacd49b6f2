"""The people in a file of motions, whatever their arrays are called and however they are nested.

What arrays are called, and by whom, is a table (`data/motions/keys.csv`): each line has the part of
a motion, a key, its form, and where that is described. Earlier lines are preferred: those in the
world before those in a camera.
"""

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.geometry.rotation import vector_from_matrix
from workbench.motions.contents import Contents, Tree

FACTS = ("gender", "rate", "ids")  # parts that are said of all that a dictionary holds
POSES = ("pose", "body")  # without one of which there is no pose
JOINTS: dict[str, tuple[int, ...]] = {  # how many joints an array of a part may hold
    **{"pose": (24, 22, 52, 55, 23, 21), "root": (1,), "body": (21, 23), "head": (3,)},
    **{"left_hand": (15,), "right_hand": (15,), "hands": (30,)},
    **{"jaw": (1,), "eyes": (2,), "left_eye": (1,), "right_eye": (1,)},
}
NUMBERS = ("trans", "betas", "expression", "dmpls", "scale", "frames")  # the other parts
SIXES = ("_6d", "_r6d", "_rot6d", "6d")  # how keys end whose rotations are six numbers (PyTorch3D)
MOTION_X = {  # how many columns of an array (T, 322) without a name belong to what
    **{"root_orient": 3, "pose_body": 63, "pose_hand": 90, "pose_jaw": 3, "face_expr": 50},
    **{"face_shape": 100, "trans": 3, "betas": 10},
}
FEATURES = (263, 251)  # columns of HumanML3D's and KIT-ML's features
EASYMOCAP = {78: 66, 87: 66}  # columns of its poses, and how many are rotation vectors
MATRIX_TOLERANCE = 0.05  # of R R' - I, in files that hold matrices in single or half precision
MOST_NUMBERS = 30_000_000
MOST_PEOPLE = 30  # in one frame
DEEPEST = 6  # dictionaries in dictionaries


class PersonLine(NamedTuple):
    """A line of the table: the part of a motion, a key, its form, where it is described."""

    part: str
    key: str
    form: str  # such as 6d rows, 6d columns, frames last, origin, or a rate in fps
    source: str


@cache
def table() -> tuple[PersonLine, ...]:
    """What arrays of motions are called; earlier lines are preferred."""
    text = (files("workbench") / "data" / "motions" / "keys.csv").read_text(encoding="utf-8")
    return tuple(PersonLine(*row) for row in csv.reader(text.splitlines()))[1:]


@cache
def lines_of(part: str) -> tuple[PersonLine, ...]:
    """The lines of one part; each key of rotations also as that of six numbers."""
    ends = ("", *SIXES) if part in JOINTS else ("",)
    return tuple(
        line._replace(key=line.key + end, form="6d rows" if end else line.form)
        for line in table()
        if line.part == part
        for end in ends
    )


@dataclass
class Track:
    """One person in N frames; NaN where it was not found.

    Attributes:
        turns: rotation vectors (N, J, 3) rad by part; `pose` or `body` is among them.
        numbers: arrays (N, D) or (1, D) of the other parts.
        facts: all that stands beside them in the file, and farther out.
        used: the line of the table by which each part was found.
        which: the place of this person where a fact lists several.
        notes: sentences.
    """

    turns: dict[str, Array]
    numbers: dict[str, Array]
    facts: Mapping[str, Tree]
    used: dict[str, PersonLine]
    which: int = 0
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(next(iter(self.turns.values())))

    @property
    def usual_rate(self) -> float | None:
        """The frames a second of all motions of its kind; None if they differ."""
        rates = [re.search(r"(\d+) fps", line.form) for line in self.used.values()]
        return next((float(rate.group(1)) for rate in rates if rate), None)

    def rows(self, which: Any, person: int = 0) -> "Track":
        """Some of the rows; the person may have another place in lists of facts."""
        N = len(self)
        turns = {part: array[which] for part, array in self.turns.items()}
        numbers = {p: a[which] if len(a) == N else a for p, a in self.numbers.items()}
        return replace(self, turns=turns, numbers=numbers, which=person)


class People:
    """Those in the contents of a file. Raises BadFile for rows that do not fit together.

    Attributes:
        tracks: each of them by name; a single one may have none.
        met: the keys that the file holds, and whether each was read.
        misfits: arrays whose key is that of a pose, and whose shape is none.
    """

    def __init__(self, contents: Contents) -> None:
        self._contents = contents
        self.met: dict[str, bool] = {}
        self.misfits: list[str] = []
        self.tracks = self._below(contents.root, {}, False, 0)

    def _below(
        self, node: Tree, outer: Mapping[str, Tree], apart: bool, depth: int
    ) -> dict[str, Track]:
        """Everybody below a node. Lists there are of people if they are `apart`, else of frames.

        `outer` are the facts that stand above it.
        """
        value = self._contents.plain(node)
        if isinstance(value, np.ndarray) and depth == 0:
            value = _parts_of_unnamed(value)
        if depth > DEEPEST or not isinstance(value, (dict, list)):
            return {}
        are_images = False
        if isinstance(value, list):
            ids = self._ids(outer)
            apart = apart or len(ids) == len(value) > 0
            names = ids if len(ids) == len(value) else map(str, range(len(value)))
            items = dict(zip(names, value, strict=True))
        else:
            for key in value:
                self.met.setdefault(key, False)
            if people := self._here(value, outer, apart):
                return people
            meta = self._contents.plain(value.get("meta"))  # facts in mmhuman3d's HumanData
            outer = {**outer, **_facts(value), **(_facts(meta) if isinstance(meta, dict) else {})}
            for line in lines_of("within"):
                inside = apart or line.form == "people"
                if people := self._below(value.get(line.key), outer, inside, depth + 1):
                    self.met[line.key] = True
                    return people
            are_images = all(re.search(r"\.[a-zA-Z]{2,4}$", name) for name in value)
            items = value
        groups = {
            name: people
            for name, item in items.items()
            if (people := self._below(item, outer, apart or are_images, depth + 1))
        }
        self.met.update((name, True) for name in groups if name in self.met)
        return _joined(list(groups.values())) if are_images else _together(groups, apart)

    def _ids(self, facts: Mapping[str, Tree]) -> tuple[str, ...]:
        """The names of people that stand in a dictionary."""
        for line in lines_of("ids"):
            array = self._contents.numbers(facts.get(line.key))
            if array is not None and array.size <= MOST_NUMBERS:
                self.met[line.key] = True
                return tuple(f"{number:g}" for number in array.reshape(-1))
        return ()

    def _arrays(self, value: Mapping[str, Tree], part: str) -> Iterator[tuple[PersonLine, Array]]:
        """The arrays that a part may be, frames first, in the order of the table."""
        for line in lines_of(part):
            array = self._contents.numbers(value[line.key]) if line.key in value else None
            if array is None:
                continue
            if not array.size:
                self.met[line.key] = True
                self.misfits += [f"{line.key} of shape {array.shape}"] if part in POSES else []
                continue
            if array.size > MOST_NUMBERS:
                raise BadFile(f"{line.key} has {array.size:,} numbers; split the motion")
            last = "frames last" in line.form and array.ndim > 1 and array.shape[-2] in (3, 6)
            yield line, np.moveaxis(array, -1, 0) if last else array

    def _here(
        self, value: Mapping[str, Tree], outer: Mapping[str, Tree], apart: bool
    ) -> dict[str, Track]:
        """The people whose poses stand in a dictionary itself, by the first array of each part."""
        pose = next((pose for part in POSES for pose in self._poses(value, part)), None)
        if pose is None:
            return {}
        line, lead, vectors = pose
        self.met[line.key] = True
        track = Track({line.part: vectors}, {}, {**outer, **value}, {line.part: line})
        for part in (*JOINTS, *NUMBERS):
            if part not in (line.part, "pose"):
                self._read_part(track, value, part, lead)
        return _by_person(track, lead, self._ids(value), apart)

    def _read_part(
        self, track: Track, value: Mapping[str, Tree], part: str, lead: tuple[int, ...]
    ) -> None:
        """Put the first array of a dictionary that fits a part into a track."""
        for line, array in self._arrays(value, part):
            rows = _rows(line, array, lead)
            if part in NUMBERS:
                track.numbers[part] = rows
            else:
                widths = {n * J: n for n in _numbers_per_rotation(line) for J in JOINTS[part]}
                if rows.shape[1] not in widths:
                    if "hand" in part and "pose" not in track.turns:
                        track.notes += (
                            f"{line.key} has {rows.shape[1]} numbers a frame, principal "
                            "components that need the model; the fingers stay at rest",
                        )
                    continue
                vectors = _vectors(line, rows, widths[rows.shape[1]])
                track.turns[part] = np.broadcast_to(vectors, (prod(lead), *vectors.shape[1:]))
            track.used[part], self.met[line.key] = line, True
            return

    def _poses(
        self, value: Mapping[str, Tree], part: str
    ) -> Iterator[tuple[PersonLine, tuple[int, ...], Array]]:
        """What can be the pose: its line, the axes before those of a frame, and its vectors."""
        for line, array in self._arrays(value, part):
            if line.key == "poses" and "Rh" in value and array.shape[-1] in EASYMOCAP:
                array = array[..., : EASYMOCAP[array.shape[-1]]]
            any_joints = "joint_names" in value  # vectors, of any number of joints
            per_rotation = () if any_joints else _numbers_per_rotation(line)
            widths = {n * J: n for n in per_rotation for J in JOINTS[part]}
            splits = (s for s in (1, 2, 0) if s <= array.ndim and prod(array.shape[s:]) in widths)
            if (split := next(splits, None)) is not None:
                lead, width = array.shape[:split], prod(array.shape[split:])
                yield line, lead, _vectors(line, array.reshape(-1, width), widths[width])
            elif array.ndim in (2, 3) and (any_joints or line.key == "poses"):
                width = array.shape[-1]
                if width % 3 or (array.ndim == 3 and width != 3):
                    columns = f"{line.key} has {width} columns"
                    raise BadFile(
                        f"{columns}, and three belong to each joint; quaternions are not read"
                    )
                yield line, array.shape[:1], array.reshape(len(array), -1, 3)
            else:
                self.misfits.append(f"{line.key} of shape {array.shape}")


def _by_person(
    track: Track, lead: tuple[int, ...], ids: tuple[str, ...], apart: bool
) -> dict[str, Track]:
    """The rows of a track that are of several people, by their names; else the track itself."""
    N = len(track)
    if len(lead) == 2:
        P, T = lead
        names = ids if len(ids) == P else tuple(map(str, range(P)))
        return {names[p]: track.rows(slice(p * T, p * T + T), p) for p in range(P)}
    if len(ids) == N and (N == 1 or len({*ids}) > 1 or apart):
        return {name: track.rows(np.array(ids) == name) for name in dict.fromkeys(ids)}
    if apart and N > 1:
        if N > MOST_PEOPLE or any(line.key in track.facts for line in lines_of("rate")):
            raise BadFile(f"it holds motions, one of {N} frames, and no frames; name one file")
        return {str(n): track.rows(slice(n, n + 1), n) for n in range(N)}
    return {"": track}


def _facts(value: Mapping[str, Tree]) -> dict[str, Tree]:
    """What a dictionary says of all that it holds."""
    keys = (line.key for part in FACTS for line in lines_of(part))
    return {key: value[key] for key in keys if key in value}


def _parts_of_unnamed(array: NDArray[Any]) -> Tree:
    """The parts of an array that stands in a file without a name. Raises BadFile for no pose."""
    columns = array.shape[1] if array.ndim == 2 else 0
    if columns == sum(MOTION_X.values()):
        ends = np.cumsum([*MOTION_X.values()])[:-1]
        return dict(zip(MOTION_X, np.split(array, ends, axis=1), strict=True))
    features = columns in FEATURES
    if features or (array.shape[1:] in ((22, 3), (24, 3)) and _are_places(np.asarray(array))):
        what = f"{columns} features" if features else "places of joints"
        raise BadFile(
            f"its numbers are {what} of HumanML3D, and no rotations; write the places of joints as "
            "markers (T, M, 3) with labels into an .npz, for `workbench convert`"
        )
    return {"poses": array}


def _are_places(array: NDArray[Any]) -> bool:
    """Whether an array (T, K, 3) has places of SMPL's joints: left legs are as long as right."""
    legs = np.linalg.norm(array[:, [1, 4, 7, 2, 5, 8]] - array[:, [0, 1, 4, 0, 2, 5]], axis=2)
    left, right = legs[:, :3], legs[:, 3:]
    return bool((legs > 0.03).all() and (np.abs(left - right) < 0.2 * left).all())


def _numbers_per_rotation(line: PersonLine) -> tuple[int, ...]:
    """How many numbers a rotation may be."""
    return (3, 9, 6) if "6d" in line.form else (3, 9)


def _rows(line: PersonLine, array: Array, lead: tuple[int, ...]) -> Array:
    """An array as rows (N, D), one for each frame and person of a pose, or as a single row (1, D).

    Raises BadFile for another number of rows.
    """
    N = prod(lead)
    if array.shape[: len(lead)] == lead or (N == 1 and line.part in JOINTS):
        return array.reshape(N, -1)
    if len(lead) == 2 and array.shape[:1] == lead[:1] and array.size < prod(lead) * lead[0]:
        return np.repeat(array.reshape(lead[0], -1), lead[1], axis=0)
    if array.ndim < 2 or array.shape[0] == 1:
        return array.reshape(1, -1)
    raise BadFile(
        f"{line.key} has shape {array.shape}, and the pose has {' x '.join(map(str, lead))} frames"
    )


def _vectors(line: PersonLine, rows: Array, width: int) -> Array:
    """Rotation vectors (N, J, 3) of rows of J vectors, matrices or six numbers of a matrix."""
    N, J = len(rows), rows.shape[1] // width
    if width == 3:
        return rows.reshape(N, J, 3)
    finite = np.isfinite(rows).all(axis=1)
    R = rows[finite].reshape(-1, 3, width // 3)
    with np.errstate(all="ignore"):
        if width == 6:  # two columns of a matrix, or by the form two rows: Zhou et al., 2019
            pair = R if "columns" in line.form else R.reshape(-1, 2, 3).swapaxes(1, 2)
            first = pair[..., 0] / np.linalg.norm(pair[..., 0], axis=1, keepdims=True)
            second = pair[..., 1] - (first * pair[..., 1]).sum(axis=1, keepdims=True) * first
            second /= np.linalg.norm(second, axis=1, keepdims=True)
            R = np.stack([first, second, np.cross(first, second)], axis=2)
            R = R if "columns" in line.form else R.swapaxes(1, 2)
        off = np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max(initial=0.0)
        proper = off < MATRIX_TOLERANCE and (np.linalg.det(R) > 0).all()
    if not proper:
        raise BadFile(f"{line.key} holds matrices that are no rotations")
    vectors = np.full((N, J, 3), np.nan)
    vectors[finite] = vector_from_matrix(R).reshape(-1, J, 3)
    return vectors


def _together(groups: dict[str, dict[str, Track]], apart: bool) -> dict[str, Track]:
    """Those of all groups as different people, unless the groups are frames that show the same."""
    move = any(len(track) > 1 for group in groups.values() for track in group.values())
    names = [name for group in groups.values() for name in group]
    different = all(names) and len({*names}) == len(names)
    if not (apart or move or different):
        return _joined(list(groups.values()))
    return {
        inner if inner and len(group) == 1 else f"{name} {inner}".strip(): track
        for name, group in groups.items()
        for inner, track in group.items()
    }


def _joined(groups: list[dict[str, Track]]) -> dict[str, Track]:
    """People in frames, each frame with those who were found there."""
    people: dict[str, Track] = {}
    for name in dict.fromkeys(name for group in groups for name in group):
        tracks = [group.get(name) for group in groups]
        first = next(track for track in tracks if track is not None)
        people[name] = replace(
            first,
            turns={part: _rows_of_all(tracks, "turns", part) for part in first.turns},
            numbers={part: _rows_of_all(tracks, "numbers", part) for part in first.numbers},
        )
    return people


def _rows_of_all(tracks: list[Track | None], kind: str, part: str) -> Array:
    """The rows of one part in all frames, in the shape of the first; NaN where it is missing."""
    arrays = [None if track is None else getattr(track, kind).get(part) for track in tracks]
    shape = next(array.shape[1:] for array in arrays if array is not None)
    rows = []
    for track, array in zip(tracks, arrays, strict=True):
        if array is None or array.shape[1:] != shape:
            array = np.full((1, *shape), np.nan)
        rows.append(np.broadcast_to(array, (1 if track is None else len(track), *shape)))
    return np.concatenate(rows)
