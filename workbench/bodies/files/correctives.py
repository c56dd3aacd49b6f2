"""Pose blend shapes as a few morph targets: what some poses use of them, by its singular values.

A body adds P f(theta) to its rest surface, with F columns in P. Poses theta_1 .. theta_T use only
the space of P f(theta_1) .. P f(theta_T), and most of it is in a few directions. The best C of them
in the sum of squares are the singular vectors of that (3 N, T) matrix (Eckart and Young, 1936).
With P = Q R they are Q times those of the small matrix R f.
"""

from collections.abc import Callable
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
    _check(count)
    people = np.tile(betas, (len(poses), 1))
    features = body.kinematics.motions(poses, people).features  # (T, F)
    P = body.posedirs.reshape(3 * body.n_vertices, -1)
    if P.shape[1] == 0 or count == 0:
        mixed, shares = np.zeros((len(poses), 0)), np.zeros((len(poses), 0))
    else:
        mixed, shares = _mixtures(np.linalg.qr(P, mode="r") @ features.T, count)
    shapes = P @ (features.T @ mixed)
    return _judged(body, poses, people, shapes, shares, lambda some: features[some] @ P.T)


def correctives_of_surfaces(
    body: SkinnedBody, poses: Array, betas: Array, surfaces: Array, count: int | None = None
) -> Correctives:
    """The best `count` correctives by which a body without blend shapes shows other surfaces.

    Surfaces (T, N, 3) m belong to poses (T, K, 3) rad. Skinning moves vertex i by B_i p_i + t_i, so
    that it is at v_i if p_i = B_i^-1 (v_i - t_i). What p lacks of the rest surface is taken for
    what blend shapes add. No B_i may be singular. Raises BadArgument for a count below zero.
    """
    _check(count)
    T, N = len(poses), body.n_vertices
    people = np.tile(betas, (T, 1))
    rest = body.template + body.shapedirs @ betas
    added = np.empty((T, 3 * N))
    for some in _batches(T):
        M = _blended(body, poses[some], people[some])
        away = (surfaces[some] - M[..., 3])[..., None]
        added[some] = (np.linalg.solve(M[..., :3], away)[..., 0] - rest).reshape(-1, 3 * N)
    mixed, shares = _mixtures(added.T, count)
    return _judged(body, poses, people, added.T @ mixed, shares, lambda some: added[some])


def _check(count: int | None) -> None:
    if count is not None and (type(count) is not int or count < 0):
        raise BadArgument(
            f"the number of correctives is a whole number from 0, or None for all, not {count!r}"
        )


def _mixtures(added: Array, count: int | None) -> tuple[Array, Array]:
    """The mixtures (T, C) of the columns of `added` (rows, T) m that are the shapes; the shares."""
    _, sizes, turns = np.linalg.svd(added, full_matrices=False)
    kept = int((sizes > NOTHING).sum())
    used = turns[: kept if count is None else min(kept, count)].T  # columns of length one
    largest = np.abs(used).max(axis=0, initial=1e-300)
    return used * largest, used / largest


def _judged(
    body: SkinnedBody,
    poses: Array,
    people: Array,
    shapes: Array,
    shares: Array,
    added: Callable[[slice], Array],
) -> Correctives:
    """Shapes (3 N, C) in single precision, and by how much what they lack moves the surfaces."""
    modes, held = (a.astype(np.float32).astype(np.float64) for a in (shapes, shares))
    total, largest, N = 0.0, 0.0, body.n_vertices
    for some in _batches(len(poses)):
        missing = (added(some) - held[some] @ modes.T).reshape(-1, N, 3)
        turns = _blended(body, poses[some], people[some])[..., :3]
        off = np.linalg.norm(np.einsum("tnij,tnj->tni", turns, missing), axis=2)
        total, largest = total + float(off.sum()), max(largest, float(off.max()))
    targets = np.moveaxis(modes.reshape(N, 3, -1), 2, 0)
    return Correctives(targets, held, total / (len(poses) * N), largest)


def _batches(T: int) -> list[slice]:
    return [slice(first, first + TOGETHER) for first in range(0, T, TOGETHER)]


def _blended(body: SkinnedBody, poses: Array, people: Array) -> Array:
    """The motion (T, N, 3, 4) of each vertex."""
    G = body.kinematics.motions(poses, people).G
    flat = body.weights @ G.reshape(len(G), body.n_joints, 12)
    return np.asarray(flat.reshape(len(G), body.n_vertices, 3, 4))
