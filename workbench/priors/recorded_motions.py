"""The motions of a recording: its clips, cut where frames are not good."""

import itertools
from pathlib import Path

import numpy as np

from workbench.errors import BadFile
from workbench.motions import Motion
from workbench.priors.mocap import RECORDED, elbows_bend_forwards
from workbench.reading.arrays import check_numbers, opened, read_expected, reals

MOVING = {**RECORDED, "trans": reals("F", 3), "fps": reals()}
LEAST = 2  # frames of a motion


def recorded_motions(path: Path) -> tuple[Motion, ...]:
    """Every run of two good frames or more of each clip, in the order of the file.

    `origin` says the clip and its frames. A recording has the arrays that `workbench.priors.mocap`
    describes, and `trans` (F, 3) m and `fps`. Frames are good if they are marked so and no elbow
    bends backwards. Raises BadFile.
    """
    with opened(path, "recording of motions in the layout described", "give such an .npz") as found:
        arrays = read_expected(found, MOVING)
        names = tuple(map(str, arrays["joint_names"]))
        poses, clips = arrays["poses"], arrays["clip"]
        if not len(poses) or poses.shape[1] != 3 * len(names):
            raise BadFile(f"poses has shape {poses.shape}, and {len(names)} joints have names")
        check_numbers("clip", clips, len(arrays["clip_name"]))
        if not 0 < arrays["fps"] < 1e6:
            raise BadFile(f"fps is {arrays['fps']:g}")
        pose = poses.reshape(len(poses), -1, 3)
        good = arrays["ok"] & elbows_bend_forwards(pose, names)
    run = np.where(good, clips, -1)
    cuts = [0, *(np.flatnonzero(np.diff(run)) + 1), len(run)]
    motions = []
    for first, end in itertools.pairwise(cuts):
        if run[first] < 0 or end - first < LEAST:
            continue
        clip = clips[first]
        begin = int(np.flatnonzero(clips == clip)[0])
        origin = f"{arrays['clip_name'][clip]}, frames {first - begin} to {end - begin - 1}"
        here = slice(first, end)
        motions.append(
            Motion(pose[here], arrays["trans"][here], float(arrays["fps"]), names, origin=origin)
        )
    return tuple(motions)
