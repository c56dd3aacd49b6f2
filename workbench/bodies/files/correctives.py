"""Pose blend shapes as a few morph targets: what some poses use of them, by its singular values.

A body adds P f(theta) to its rest surface, with F columns in P. Poses theta_1 .. theta_T use only
the space of P f(theta_1) .. P f(theta_T), and most of it is in a few directions. The best C of them
in the sum of squares are the singular vectors of that (3 N, T) matrix (Eckart and Young, 1936).
With P = Q R they are Q times those of the small matrix R f.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadArgument

NOTHING = 1e-9  # m, summed over all vertices and poses: a smaller direction is rounding
TOGETHER = 32  # poses whose surfaces are in memory at once


@dataclass(frozen=True, eq=False)
class Correctives:
    """C morph targets that stand for a body's pose blend shapes in T poses.

    Attributes:
        shapes: (C, N, 3) m, added to the rest surface, as single precision holds them.
        shares: (T, C) how much of each, at most one in size, as single precision holds them.
        mean: how far vertices of the posed surface are off on average, in m.
        largest: the same for the vertex and the pose where it is most, in m.
    """

    shapes: Array
    shares: Array
    mean: float
    largest: float

    def __str__(self) -> str:
        return (
            f"{len(self.shapes)} correctives: vertices are off by {1e3 * self.mean:.2g} mm on "
            f"average and {1e3 * self.largest:.2g} mm at most"
        )


def correctives_of(
    body: SkinnedBody, poses: Array, betas: Array, count: int | None = None
) -> Correctives:
    """The best `count` correctives of poses (T, K, 3) rad; None: as many as make them exact.

    Raises BadArgument for a count below zero.
    """
    if count is not None and (type(count) is not int or count < 0):
        raise BadArgument(
            f"the number of correctives is a whole number from 0, or None for all, not {count!r}"
        )
    N, T = body.n_vertices, len(poses)
    people = np.tile(betas, (T, 1))
    features = body.kinematics.motions(poses, people).features  # (T, F)
    P = body.posedirs.reshape(3 * N, -1)
    if P.shape[1] == 0 or count == 0:
        shapes, shares = np.zeros((0, N, 3)), np.zeros((T, 0))
    else:
        R = np.linalg.qr(P, mode="r")
        _, sizes, turns = np.linalg.svd(R @ features.T, full_matrices=False)
        kept = int((sizes > NOTHING).sum())
        kept = kept if count is None else min(kept, count)
        used = turns[:kept].T  # (T, C), columns of length one
        largest = np.abs(used).max(axis=0, initial=1e-300)
        shares = used / largest
        shapes = np.moveaxis((P @ (features.T @ used) * largest).reshape(N, 3, kept), 2, 0)
    shapes = shapes.astype(np.float32).astype(np.float64)
    shares = shares.astype(np.float32).astype(np.float64)
    off = [*_errors(body, poses, people, features, shapes, shares)]
    return Correctives(
        shapes, shares, float(np.mean([o.mean() for o in off])), float(max(o.max() for o in off))
    )


def _errors(
    body: SkinnedBody,
    poses: Array,
    people: Array,
    features: Array,
    shapes: Array,
    shares: Array,
) -> Iterator[Array]:
    """How far each vertex of each posed surface is off, (N,) m: what is missing, skinned."""
    N, K = body.n_vertices, body.n_joints
    P, modes = body.posedirs.reshape(3 * N, -1), shapes.reshape(len(shapes), 3 * N)
    for first in range(0, len(poses), TOGETHER):
        some = slice(first, first + TOGETHER)
        missing = features[some] @ P.T - shares[some] @ modes
        turns = body.kinematics.motions(poses[some], people[some]).G[:, :, :, :3]
        for lacks, R in zip(missing.reshape(-1, N, 3), turns, strict=True):
            blend = (body.weights @ R.reshape(K, 9)).reshape(N, 3, 3)
            yield np.linalg.norm(np.einsum("nij,nj->ni", blend, lacks), axis=1)
