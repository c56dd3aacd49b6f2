"""Frames of a motion that were not found: they are filled from their neighbours, and said."""

import numpy as np

from workbench.arrays import Array, Mask
from workbench.errors import BadArgument
from workbench.motions.interpolation import between, rotations_between


def without_gaps(
    pose: Array, trans: Array, expression: Array | None = None
) -> tuple[Array, Array, Array | None, tuple[str, ...]]:
    """Pose (T, K, 3) rad, trans (T, 3) m and expression without NaN, and sentences on it.

    A frame that holds NaN is interpolated between the frames before and after it; at both ends
    such frames are left out. Raises BadArgument if no frame is whole.
    """
    T = len(pose)
    lines = (trans,) if expression is None else (trans, expression)
    missing: Mask = np.asarray(np.isnan(pose).reshape(T, -1).any(axis=1))
    for line in lines:
        missing |= np.isnan(line).any(axis=1)
    if not missing.any():
        return pose, trans, expression, ()
    whole = np.flatnonzero(~missing)
    if not len(whole):
        raise BadArgument("no frame of the motion is whole: each one holds NaN")
    first, last = int(whole[0]), int(whole[-1])
    at = np.interp(np.arange(first, last + 1), whole, np.arange(len(whole)))
    filled, cut = int(missing[first:last].sum()), T - (last + 1 - first)
    said = []
    if filled:
        said.append(f"{filled} of {T} frames were not found, and are interpolated")
    if cut:
        said.append(f"{cut} of {T} frames at the ends were not found, and are left out")
    moved = [between(line[whole], at) for line in lines]
    return (
        rotations_between(pose[whole], at),
        moved[0],
        moved[1] if expression is not None else None,
        tuple(said),
    )
