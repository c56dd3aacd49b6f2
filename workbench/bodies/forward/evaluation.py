"""Evaluating a body for batches of poses and shapes."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.blocks.checks import reals
from workbench.bodies.body import Body, Given
from workbench.bodies.forward.numeric import batch_points
from workbench.bodies.forward.numeric_body import NumericBody
from workbench.bodies.landmarks import Landmarks
from workbench.errors import BadBody


def vertices(of: NumericBody, pose: Given, betas: Given, trans: Given) -> Array:
    """The posed surface over a broadcast batch, (..., N, 3) m."""
    body = of.arrays
    batch, theta, beta, move = arguments(body, pose, betas, trans)
    if body.is_smpl:
        found = batch_points(of.chunks, of.kinematics.motions(theta, beta), beta)
    else:
        each = [np.asarray(of.skinned_rest(t.T, b)).T for t, b in zip(theta, beta, strict=True)]
        found = np.array(each).reshape(len(theta), body.n_vertices, 3)
    return (found + move[:, None]).reshape(*batch, body.n_vertices, 3)


def regressed(regressor: csr_array, points: Array) -> Array:
    """Weighted means (..., M, 3) of points (..., N, 3), for a regressor (M, N)."""
    flat = np.moveaxis(points, -2, 0).reshape(points.shape[-2], -1)
    found = (regressor @ flat).reshape(regressor.shape[0], *points.shape[:-2], 3)
    return np.moveaxis(found, 0, -2)


def displaced(
    of: NumericBody, landmarks: Landmarks, given: tuple[Given, Given, Given], offsets: ArrayLike
) -> Array:
    """Landmarks with offsets (..., M, 3) m, over a broadcast batch of pose, betas and trans."""
    body, count = of.arrays, len(landmarks.names)
    moved = reals("offsets", offsets)
    if moved.shape[-2:] != (count, 3):
        raise BadBody(
            f"body {body.name!r} takes offsets of shape (..., {count}, 3) for {count} landmarks, "
            f"not {moved.shape}"
        )
    parts = {**_parts(body, *given), "offsets": (moved, 2)}
    batch, (theta, beta, move, moved) = _broadcast(parts)
    if body.is_smpl:
        found = of.landmarks(landmarks).evaluate_batch(theta, beta, move, moved)
    else:
        function, each = of.displaced_rest(landmarks), zip(theta, beta, moved, strict=True)
        alone = [np.asarray(function(t.T, b, o.T)).T for t, b, o in each]
        found = np.array(alone).reshape(len(theta), count, 3) + move[:, None]
    return found.reshape(*batch, count, 3)


def joints(of: NumericBody, pose: Given, betas: Given, trans: Given) -> Array:
    """The posed joints over a broadcast batch, (..., K, 3) m."""
    batch, theta, beta, move = arguments(of.arrays, pose, betas, trans)
    found = of.kinematics.motions(theta, beta).joints + move[:, None]
    return found.reshape(*batch, of.arrays.n_joints, 3)


def arguments(
    body: Body, pose: Given, betas: Given, trans: Given
) -> tuple[tuple[int, ...], Array, Array, Array]:
    """The batch, and M of each: (M, K, 3), (M, B), (M, 3).

    What is None is as in the template; betas may be shorter than B. Raises BadBody or NotNumbers.
    """
    batch, (theta, beta, move) = _broadcast(_parts(body, pose, betas, trans))
    return batch, theta, beta, move


def _parts(body: Body, pose: Given, betas: Given, trans: Given) -> dict[str, tuple[Array, int]]:
    """Each argument, with the number of axes that are not of its batch."""
    theta = _pose(body, body.bind_pose if pose is None else pose)
    beta = _betas(body, np.zeros(0) if betas is None else betas)
    move = reals("trans", np.zeros(3) if trans is None else trans)
    if move.shape[-1:] != (3,):
        raise BadBody(f"body {body.name!r} takes a trans of shape (..., 3), not {move.shape}")
    return {"pose": (theta, 2), "betas": (beta, 1), "trans": (move, 1)}


def _broadcast(parts: Mapping[str, tuple[Array, int]]) -> tuple[tuple[int, ...], list[Array]]:
    """The batch, and each argument for all M of it: (M, ...)."""
    try:
        batch = np.broadcast_shapes(*(a.shape[:-axes] for a, axes in parts.values()))
    except ValueError:
        *first, last = (f"{name} {a.shape}" for name, (a, _) in parts.items())
        raise BadBody(
            f"the batches of {', '.join(first)} and {last} do not fit each other"
        ) from None
    tails = ((a, a.shape[-axes:]) for a, axes in parts.values())
    return batch, [
        np.broadcast_to(a, batch + tail).reshape(prod(batch), *tail) for a, tail in tails
    ]


def _pose(body: Body, pose: ArrayLike) -> Array:
    theta, K = reals("pose", pose), body.n_joints
    if theta.shape[-2:] == (K, 3):
        return theta
    if theta.shape[-1:] == (3 * K,):
        return theta.reshape(*theta.shape[:-1], K, 3)
    raise BadBody(
        f"body {body.name!r} has {K} joints and takes a pose of shape (..., {K}, 3) or "
        f"(..., {3 * K}), not {theta.shape}"
    )


def _betas(body: Body, betas: ArrayLike) -> Array:
    beta, B = reals("betas", betas), body.n_betas
    if beta.ndim == 0 or beta.shape[-1] > B:
        raise BadBody(f"body {body.name!r} takes up to {B} betas, not an array {beta.shape}")
    return np.pad(beta, [(0, 0)] * (beta.ndim - 1) + [(0, B - beta.shape[-1])])
