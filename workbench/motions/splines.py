"""Smooth motions between frames, whose accelerations mean something."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from workbench.errors import BadArgument
from workbench.motions.motion import Motion

FEWEST = 4  # frames, of a cubic spline with free ends


def splined(motion: Motion, fps: float) -> Motion:
    """The motion at another rate, through the same frames, with continuous accelerations.

    `Motion.resampled` turns joints along the shortest arcs, at speeds that jump from one frame to
    the next. Here rotations are cubic splines on the group (`scipy`'s RotationSpline) and places
    are cubic splines. What lies between the recorded frames is made up all the same: a recording
    at 10 frames a second holds nothing above 5 Hz.

    Raises BadArgument for fewer than 4 frames, a rate that is not above zero, or one that makes
    more than ten million frames.
    """
    if len(motion) < FEWEST:
        raise BadArgument(
            f"a spline needs {FEWEST} frames or more, and this motion has {len(motion)}; "
            "use motion.resampled, or a longer motion"
        )
    times = motion.resampled(fps)  # checks the rate
    at = np.arange(len(times)) / times.fps
    known = np.arange(len(motion)) / motion.fps
    pose = np.stack(
        [
            RotationSpline(known, Rotation.from_rotvec(turns))(at).as_rotvec()
            for turns in motion.pose.swapaxes(0, 1)
        ],
        axis=1,
    )
    face = motion.expression
    note = f"resampled by splines from {motion.fps:g} to {times.fps:g} frames a second"
    return replace(
        motion,
        pose=pose,
        trans=CubicSpline(known, motion.trans)(at),
        expression=None if face is None else CubicSpline(known, face)(at),
        fps=times.fps,
        notes=(*motion.notes, note),
    )
