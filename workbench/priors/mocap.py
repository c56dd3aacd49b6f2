"""Recordings of people in motion (motion capture), as poses of SMPL's joints.

A recording is an .npz with `poses` (F, 72) rad, `ok` (F,), `clip` (F,), `clip_name` and
`joint_names`. Every fifth clip is held out, so that what was learned from the others can be
measured on poses that nothing was learned from. Frames whose elbows bend backwards are left out:
the recording that the embedded priors were learned from flips them in clips 01_01 and 13_18.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.errors import BadFile, listed
from workbench.reading.arrays import (
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


@dataclass(frozen=True, eq=False)
class Mocap:
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

    def split(self) -> tuple["Mocap", "Mocap"]:
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

    def _where(self, chosen: Mask) -> "Mocap":
        return Mocap(self.poses[chosen], self.clip[chosen], self.clip_names, self.joint_names)


def read_mocap(path: Path) -> Mocap:
    """Read the good frames of a recording. Raises BadFile if an array is missing."""
    what = "recording in the layout described"
    with opened(path, what, "give such an .npz") as archive:
        arrays = read_expected(archive, RECORDED)
        names = tuple(map(str, arrays["joint_names"]))
        if arrays["poses"].shape[1] != 3 * len(names) or not set(ELBOWS) <= set(names):
            raise BadFile(f"its poses have {arrays['poses'].shape[1]} angles of {listed(names)}")
        check_numbers("clip", arrays["clip"], len(arrays["clip_name"]))
    poses = arrays["poses"].reshape(len(arrays["poses"]), -1, 3)
    good = arrays["ok"] & elbows_bend_forwards(poses, names)
    clips = tuple(map(str, arrays["clip_name"]))
    return Mocap(poses[good], arrays["clip"][good], clips, names)


def elbows_bend_forwards(poses: Array, names: tuple[str, ...]) -> Mask:
    """Which poses (F,) bend elbows forwards: the left one about -y, the right one about +y."""
    left, right = (poses[:, names.index(name), 1] for name in ELBOWS)
    forwards: Mask = (left < ELBOW_LIMIT) & (right > -ELBOW_LIMIT)
    return forwards


def held_out_poses(path: Path) -> Array:
    """The good frames of every fifth clip, (F, 24, 3) rad, with the pelvis' rotation set to zero.

    Raises BadFile as `read_mocap` does.
    """
    _, clips = read_mocap(path).split()
    poses = clips.poses.copy()
    poses[:, 0] = 0
    return poses
