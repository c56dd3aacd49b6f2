"""The frames of a recording that say most of a person's shape and of where the markers sit."""

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.diagnostics.design.candidates import Candidate, rows_of
from workbench.fitting.marker_frames import Choice, spread_frames
from workbench.fitting.marker_sets import MarkerSet
from workbench.fitting.markers import (
    OFFSET_SIGMA,
    SIGMA,
    WIDE,
    frame_by_frame,
    marker_frame,
    observations,
)
from workbench.problem import Problem
from workbench.residuals.kernels import quadratic

CANDIDATES = 120  # frames whose information is computed, those that differ most


def informative_frames(
    body: SkinnedBody,
    marker_set: MarkerSet,
    *,
    sigma: float = SIGMA,
    offset_sigma: float = OFFSET_SIGMA,
    across: float | None = None,
) -> Choice:
    """A choice of the frames after which shape and offsets are known best, one after the other.

    Each frame is a candidate of a design of measurements, whose pose and place are unknowns of its
    own: it adds J_s'J_s less what these can explain, their Schur complement. The next frame is the
    one that leaves the smallest variance, the mean over the vertices at rest plus that over the
    offsets, in m^2 (A-optimal design). Poses are found roughly, with nominal offsets, for at most
    120 frames.
    """

    def choose(markers: Array, count: int) -> Index:
        candidates = spread_frames(markers, CANDIDATES)
        known, each = _information(
            body, marker_set, markers[candidates], sigma, offset_sigma, across
        )
        B, M = body.n_betas, len(marker_set.names)
        directions = body.shapedirs.reshape(-1, B)
        matters = np.zeros_like(known)
        matters[:B, :B] = directions.T @ directions / body.n_vertices
        matters[B:, B:] = np.eye(3 * M) / M
        chosen: list[int] = []
        while len(chosen) < min(count, len(candidates)):
            left = [i for i in range(len(candidates)) if i not in chosen]
            variance = [_variance(known + each[i], matters) for i in left]
            best = left[int(np.argmin(variance))]
            known = known + each[best]
            chosen.append(best)
        return np.sort(candidates[chosen])

    return choose


def _variance(information: Array, matters: Array) -> float:
    """The trace of the covariance, each direction counted as it matters."""
    return float(np.trace(cho_solve(cho_factor(information), matters)))


def _information(
    body: SkinnedBody,
    marker_set: MarkerSet,
    markers: Array,
    sigma: float,
    offset_sigma: float,
    across: float | None,
) -> tuple[Array, list[Array]]:
    """What the priors and each frame say of betas and offsets, (B + 3 M, B + 3 M) each."""
    dressed = marker_set.on(body)
    pose, betas, trans = (block.name for block in dressed.blocks())
    free = (trans, pose, betas, "offsets")
    frame, priors = marker_frame(dressed, marker_set, sigma, offset_sigma, quadratic, free, across)
    first = dressed.start() | {"offsets": marker_set.nominal}
    shares = tuple(sigma / wide for wide in WIDE)
    moved = frame_by_frame(frame, dressed, markers, first, shares)
    shared = [name for name in priors if name != "pose prior"]
    person = Problem([r for r in frame.residuals if r.name in shared], (betas, "offsets"))
    seen = tuple(r for r in frame.residuals if r.name not in shared)
    places = [{name: moved[name][t] for name in (pose, trans)} for t in range(len(markers))]
    frames = {
        str(t): Candidate(seen, observations(markers[t]) | places[t], own=(trans, pose))
        for t in range(len(markers))
    }
    rows = rows_of(person, frames, first, {})
    return np.asarray(person.linearize(first).normal), [A.T @ A for A in rows.values()]
