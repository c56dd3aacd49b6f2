"""Landmarks in symbols: weighted means of posed vertices, with offsets at rest if there are any."""

from __future__ import annotations

from collections.abc import Callable

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.blocks.functions import sparse_constant
from workbench.bodies.body import Landmarks
from workbench.bodies.forward import surface
from workbench.bodies.forward.arrays import SkinnedArrays
from workbench.bodies.forward.rest_points import RestPoints
from workbench.bodies.forward.skinning import linear_blend


def posed_landmarks(
    body: SkinnedArrays,
    landmarks: Landmarks,
    rest_points: Callable[[], RestPoints],
    symbols: tuple[cs.MX, cs.MX, cs.MX],
    offsets: cs.MX | None = None,
) -> cs.MX:
    """The landmarks (3, L) m in the symbols of pose, betas and trans; `offsets` (3, L) m.

    Only the vertices that carry weight are posed. Where that is exact, the landmarks come from
    their `rest_points` instead.
    """
    if not body.free and body.skinning is linear_blend:
        pose, betas, trans = symbols
        posture = surface.posture(body, pose, betas)
        G, _ = surface.motions(body, posture)
        means = rest_points().expression(G, body.features(posture), betas, offsets)
        return means + cs.repmat(trans, 1, len(landmarks.names))
    if offsets is None:
        regressor, used = landmarks.of_vertices
        posed = surface.posed(body, *symbols, used)
        return posed @ cs.MX(sparse_constant(regressor.T))
    pairs = landmarks.regressor.tocoo()  # a vertex of two landmarks is displaced by each
    owner, vertices = (np.asarray(axis, dtype=np.int64) for axis in pairs.coords)
    each = np.arange(len(owner))
    own = csc_array((np.ones(len(owner)), (owner, each)), shape=(len(landmarks.names), len(owner)))
    posed = surface.posed(body, *symbols, vertices.tolist(), offsets @ sparse_constant(own))
    return posed @ cs.MX(sparse_constant(own.T.multiply(pairs.data[:, None])))
