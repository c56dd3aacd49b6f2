"""The frames of a recording that say most of a person's shape and of where the markers sit."""

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
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
from workbench.residuals.kernels import quadratic

CANDIDATES = 120  # frames whose information is computed, those that differ most


def informative_frames(
    body: SkinnedBody,
    marker_set: MarkerSet,
    *,
    sigma: float = SIGMA,
    offset_sigma: float = OFFSET_SIGMA,
) -> Choice:
    """A choice of the frames after which shape and offsets are known best, one after the other.

    Each frame adds to the information on what is shared, J_s'J_s less what the pose can explain:
    the Schur complement of the frame's own unknowns. The next frame is the one that leaves the
    smallest variance, the mean over the vertices at rest plus that over the offsets, in m^2
    (A-optimal design). Poses are found roughly, with nominal offsets, for at most 120 frames.
    """

    def choose(markers: Array, count: int) -> Index:
        candidates = spread_frames(markers, CANDIDATES)
        each = _information(body, marker_set, markers[candidates], sigma, offset_sigma)
        B, M = body.n_betas, len(marker_set.names)
        known = np.diag(np.append(np.ones(B), np.full(3 * M, offset_sigma**-2)))
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
    body: SkinnedBody, marker_set: MarkerSet, markers: Array, sigma: float, offset_sigma: float
) -> list[Array]:
    """The information of each frame on betas and offsets, (B + 3 M, B + 3 M)."""
    dressed = marker_set.on(body)
    pose, betas, trans = (block.name for block in dressed.blocks())
    free = (trans, pose, betas, "offsets")
    frame, priors = marker_frame(dressed, marker_set, sigma, offset_sigma, quadratic, free)
    first = dressed.start() | {"offsets": marker_set.nominal}
    shares = tuple(sigma / wide for wide in WIDE)
    moved = frame_by_frame(frame, dressed, markers, first, shares)
    data = frame.without(*(name for name in priors if name != "pose prior"))
    own = [data.free.slices[name] for name in (trans, pose)]
    shared = [data.free.slices[name] for name in (betas, "offsets")]
    found = []
    for t, seen in enumerate(markers):
        values = first | observations(seen) | {name: moved[name][t] for name in (pose, trans)}
        J = data.linearize({name: values[name] for name in data.known}).dense
        of_pose, of_person = (np.concatenate([J[:, at] for at in s], axis=1) for s in (own, shared))
        basis, size, _ = np.linalg.svd(of_pose, full_matrices=False)
        basis = basis[:, size > 1e-9 * size[0]]
        apart = of_person - basis @ (basis.T @ of_person)
        found.append(apart.T @ apart)
    return found
