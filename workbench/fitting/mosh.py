"""MoSh: shape and offsets of markers from a few frames, then the poses of all frames.

Loper, Mahmood and Black, MoSh: Motion and Shape Capture from Sparse Markers, 2014.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.fitting.marker_sets import MarkerSet
from workbench.fitting.markers import (
    FEWEST_MARKERS,
    OFFSET_SIGMA,
    SIGMA,
    WIDE_SIGMAS,
    checked_markers,
    frame_by_frame,
    marker_errors,
    marker_fit,
    marker_frame,
    marker_solver,
)
from workbench.fitting.observations import BadObservation
from workbench.fitting.setup import Setup
from workbench.fitting.tracking import SHAPE_FRAMES, spread_frames
from workbench.residuals.kernels import quadratic

ALONE_EVERY = 10  # frames between two that are fitted by themselves as well


@dataclass(frozen=True, eq=False)
class MarkerFit:
    """The motion of a body that wears M markers, in T frames.

    Attributes:
        pose, trans: (T, K, 3) rad and (T, 3) m; NaN in frames that show less than four markers.
        betas: (B,) the shape.
        offsets: (M, 3) m, of the markers at rest.
        frames: the frames from which shape and offsets were found.
        errors: (T, M) m from each observed marker to that of the body; NaN where it was not seen.
    """

    pose: Array
    trans: Array
    betas: Array
    offsets: Array
    frames: Index
    errors: Array


def mosh(
    markers: ArrayLike,
    body: SkinnedBody,
    marker_set: MarkerSet,
    *,
    frames: int = SHAPE_FRAMES,
    sigma: float = SIGMA,
    across: float | None = None,
    solve: Callable[[Setup], Values] | None = None,
    progress: Callable[[str], object] = lambda text: None,
) -> MarkerFit:
    """Find shape and offsets from some frames, and then the pose in every frame, these being held.

    `markers` are (T, M, 3) m, NaN where one was not seen; `sigma` and `across` are those of
    `marker_fit`. The `frames` of the first step are `spread_frames`; its problem is solved in the
    stages of `marker_solver`, or else by `solve`, a function from its setup to the values found. In
    the second step frames are fitted one by one, so that a recording may be long. Raises
    BadObservation if no frame shows four markers, and BadArgument for markers of another shape and
    as `offset_prior` does.
    """
    whole = checked_markers(markers, marker_set)
    usable = np.flatnonzero(np.isfinite(whole).all(axis=2).sum(axis=1) >= FEWEST_MARKERS)
    if not len(usable):
        raise BadObservation(f"no frame shows {FEWEST_MARKERS} markers, by which a body is placed")
    observed = whole[usable]
    chosen = spread_frames(observed, frames)
    progress(f"shape and offsets from {len(chosen)} of {len(whole)} frames")
    setup = marker_fit(observed[chosen], body, marker_set, sigma=sigma, across=across)
    if solve is None:
        values = marker_solver().solve(setup.problem, setup.start).values
    else:
        values = solve(setup)
    dressed = marker_set.on(body)
    pose, betas, trans = (block.name for block in dressed.blocks())
    known = dressed.start() | {name: values[name] for name in (betas, "offsets")}
    frame, _ = marker_frame(dressed, marker_set, sigma, OFFSET_SIGMA, quadratic, (trans, pose))
    shares = (*(sigma / wide for wide in WIDE_SIGMAS), 1.0)
    every = max(1, len(usable) // 10)

    def told(done: int, all_of: int) -> None:
        if done % every == 0 or done == all_of:
            progress(f"poses: frame {done} of {all_of}")

    moved = frame_by_frame(frame, dressed, observed, known, shares, ALONE_EVERY, told)
    poses = np.full((len(whole), dressed.n_joints, 3), np.nan)
    places, errors = np.full((len(whole), 3), np.nan), np.full(whole.shape[:2], np.nan)
    poses[usable], places[usable] = moved[pose], moved[trans]
    errors[usable] = marker_errors(dressed, observed, known | moved)
    return MarkerFit(poses, places, known[betas], known["offsets"], usable[chosen], errors)
