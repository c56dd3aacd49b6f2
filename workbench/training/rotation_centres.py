"""Where joints are, from how the segments on both sides of them move.

The symmetrical centre of rotation (Ehrig, Taylor, Duda and Heller 2006) is the point that the
motions of two segments take to the same place. It is sought in the frame of each,

    min over a, b of sum_j |R_parent,j a + t_parent,j - R_child,j b - t_child,j|^2.

A hinge does not determine the position along its axis. There, and where a segment hardly turns,
the estimate stays at the middle of the ring of vertices between the two segments.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.geometry.rigid import segment_motions
from workbench.training.first_guess import Start
from workbench.training.registrations import Registrations, batches
from workbench.training.simplex import shares

FIT, RING = 0.01, 0.05  # m: how far a segment is from rigid, and a ring's middle from the joint
NEAREST = 80  # vertices that a joint is a mean of


@dataclass(frozen=True, eq=False)
class SegmentMotions:
    """The rigid motion of each segment of a template in each registration.

    Attributes:
        R: (J, K, 3, 3) the rotations.
        t: (J, K, 3) the translations in metres.
    """

    R: Array
    t: Array


def motions_of_segments(
    start: Start, weights: Array, registrations: Registrations
) -> SegmentMotions:
    """The motions that take each segment of the template to its vertices in each registration."""
    J, K = len(registrations.subject), len(start.parents)
    R, t = np.empty((J, K, 3, 3)), np.empty((J, K, 3))
    for batch in batches(registrations):
        for at, (V, confidence) in enumerate(zip(batch.vertices, batch.confidence, strict=True)):
            trusted = weights.T * confidence + 1e-9 * confidence
            for k, motion in enumerate(segment_motions(start.template, V, trusted)):
                R[batch.some.start + at, k], t[batch.some.start + at, k] = motion.R, motion.t
    return SegmentMotions(R, t)


def rotation_centres(
    motions: SegmentMotions, subject: Index, parents: tuple[int, ...], rings: Array
) -> Array:
    """Joints (K, 3) m on the template, the mean of all subjects; `rings` (K, 3) m are the prior."""
    found = rings.copy()
    prior = (FIT / RING) * np.eye(6)
    for k, parent in enumerate(parents[1:], start=1):
        both = np.tile(rings[k], 2)
        centres = []
        for s in np.unique(subject):
            own = subject == s
            A = np.concatenate([motions.R[own, parent], -motions.R[own, k]], axis=2).reshape(-1, 6)
            gap = (motions.t[own, k] - motions.t[own, parent]).ravel() - A @ both
            step = np.linalg.solve(A.T @ A + prior.T @ prior, A.T @ gap)
            centres.append(rings[k] + step.reshape(2, 3).mean(axis=0))
        found[k] = np.mean(centres, axis=0)
    return found


def means_at(template: Array, points: Array) -> csr_array:
    """Rows (K, N) of shares, as even as possible, that give the points (K, 3) on the template.

    A point outside of the convex hull of the vertices nearest to it is approximated.
    """
    rows = np.zeros((len(points), len(template)))
    for k, point in enumerate(points):
        near = np.argsort(np.linalg.norm(template - point, axis=1), kind="stable")[:NEAREST]
        away = template[near] - point
        gram = away @ away.T + 1e-6 * np.eye(len(near))  # m^2: evenness decides among exact ones
        first = np.full(len(near), 1 / len(near))
        rows[k, near] = shares(gram, np.zeros(len(near)), first)
    return csr_array(rows)


def joint_guess(start: Start, weights: Array, registrations: Registrations) -> csr_array:
    """The first guess of the joint regressor (K, N), which E_J uses until one is learned."""
    middles = start.rings() @ start.template
    motions = motions_of_segments(start, weights, registrations)
    centres = rotation_centres(motions, registrations.subject, start.parents, middles)
    return means_at(start.template, centres)
