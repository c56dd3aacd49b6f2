"""Recordings of people in motion (motion capture), as poses of SMPL's joints and as motions.

A recording is an .npz with `poses` (F, 72) rad, `ok` (F,), `clip` (F,), `clip_name` and
`joint_names`; as motions also with `trans` (F, 3) m and `fps`. Every fifth clip is held out, so
that what was learned from the others can be measured on poses that nothing was learned from.
Frames whose elbows bend backwards are left out: the recording that the embedded priors were
learned from flips them in clips 01_01 and 13_18.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.errors import BadFile, listed
from workbench.motions import Motion
from workbench.reading.arrays import (
    Expected,
    check_numbers,
    opened,
    read_expected,
    reals,
    texts,
    truths,
    wholes,
)

HELD_OUT_EVERY = 5
ELBOWS = ("left_elbow", "right_elbow")
ELBOW_LIMIT = 0.1  # rad, how far an elbow may bend backwards
RECORDED = {
    "joint_names": texts("K"),
    "poses": reals("F", "3 K"),
    "ok": truths("F"),
    "clip": wholes("F"),
    "clip_name": texts("clips"),
}
MOVING = {**RECORDED, "trans": reals("F", 3), "fps": reals()}
LEAST = 2  # frames of a motion


@dataclass(frozen=True, eq=False)
class PoseRecording:
    """Recorded poses.

    Attributes:
        poses: (F, 24, 3) rad.
        clip: (F,) the number of each pose's clip.
        clip_names: the names of all clips.
        joint_names: the names of the 24 joints.
    """

    poses: Array
    clip: Index
    clip_names: tuple[str, ...]
    joint_names: tuple[str, ...]

    def split(self) -> tuple["PoseRecording", "PoseRecording"]:
        """The recording to learn from, and every fifth clip, held out to measure on.

        Whole clips are held out because the frames of a clip are alike.
        """
        held_out = self.clip % HELD_OUT_EVERY == HELD_OUT_EVERY - 1
        return self._where(~held_out), self._where(held_out)

    @property
    def absent(self) -> tuple[str, ...]:
        """The names of the clips from which no frame was taken."""
        present = {self.clip_names[c] for c in np.unique(self.clip)}
        return tuple(sorted(set(self.clip_names) - present))

    def _where(self, chosen: Mask) -> "PoseRecording":
        return PoseRecording(
            self.poses[chosen], self.clip[chosen], self.clip_names, self.joint_names
        )


def _read(path: Path, expected: Mapping[str, Expected]) -> tuple[dict[str, Any], Array, Mask]:
    """The arrays of a recording, its poses (F, K, 3) rad, and which of them (F,) are good."""
    with opened(path, "recording in the layout described", "give such an .npz") as archive:
        arrays: dict[str, Any] = read_expected(archive, expected)
        names = arrays["joint_names"] = tuple(map(str, arrays["joint_names"]))
        arrays["clip_name"] = tuple(map(str, arrays["clip_name"]))
        if arrays["poses"].shape[1] != 3 * len(names) or not set(ELBOWS) <= set(names):
            raise BadFile(f"its poses have {arrays['poses'].shape[1]} angles of {listed(names)}")
        check_numbers("clip", arrays["clip"], len(arrays["clip_name"]))
        if "fps" in arrays and not 0 < arrays["fps"] < 1e6:
            raise BadFile(f"fps is {arrays['fps']:g}")
    poses = arrays["poses"].reshape(len(arrays["poses"]), -1, 3)
    left, right = (poses[:, names.index(name), 1] for name in ELBOWS)  # about -y, and about +y
    return arrays, poses, arrays["ok"] & (left < ELBOW_LIMIT) & (right > -ELBOW_LIMIT)


def read_recording(path: Path) -> PoseRecording:
    """Read the good frames of a recording. Raises BadFile if an array is missing."""
    arrays, poses, good = _read(path, RECORDED)
    return PoseRecording(
        poses[good], arrays["clip"][good], arrays["clip_name"], arrays["joint_names"]
    )


def held_out_poses(path: Path) -> Array:
    """The good frames of every fifth clip, (F, 24, 3) rad, with the pelvis' rotation set to zero.

    Raises BadFile as `read_recording` does.
    """
    poses = read_recording(path).split()[1].poses.copy()
    poses[:, 0] = 0
    return poses


def recorded_motions(path: Path) -> tuple[Motion, ...]:
    """Every run of two good frames or more of each clip, in the order of the file.

    `origin` says the clip and its frames. Frames are good if they are marked so and no elbow bends
    backwards. Raises BadFile.
    """
    arrays, poses, good = _read(path, MOVING)
    clips, names = arrays["clip"], arrays["joint_names"]
    run = np.where(good, clips, -1)
    cuts = [0, *(np.flatnonzero(np.diff(run)) + 1), len(run)]
    motions = []
    for first, end in itertools.pairwise(cuts):
        if end - first < LEAST or run[first] < 0:
            continue
        begin = int(np.flatnonzero(clips == clips[first])[0])
        origin = f"{arrays['clip_name'][clips[first]]}, frames {first - begin} to {end - begin - 1}"
        trans, fps = arrays["trans"][first:end], float(arrays["fps"])
        motions.append(Motion(poses[first:end], trans, fps, names, origin=origin))
    return tuple(motions)
