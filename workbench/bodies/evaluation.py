"""Evaluating a body for batches of poses and shapes."""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.errors import BadBody

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody


def batched(
    body: SkinnedBody,
    function: cs.Function,
    pose: ArrayLike | None,
    betas: ArrayLike | None,
    trans: ArrayLike | None,
) -> NDArray[np.float64]:
    """`function` of (pose, betas, trans), (3, n) each time, over a broadcast batch: (..., n, 3).

    What is None is as in the template; betas may be shorter than B. Raises BadBody.
    """
    theta = _pose(body, body.bind_pose if pose is None else pose)
    beta = _betas(body, np.zeros(0) if betas is None else betas)
    move = np.asarray(np.zeros(3) if trans is None else trans, dtype=float)
    if move.shape[-1:] != (3,):
        raise BadBody(f"body {body.name!r} takes a trans of shape (..., 3), not {move.shape}")
    try:
        batch = np.broadcast_shapes(theta.shape[:-2], beta.shape[:-1], move.shape[:-1])
    except ValueError:
        raise BadBody(
            f"the batches of pose {theta.shape}, betas {beta.shape} and trans {move.shape} "
            "do not fit each other"
        ) from None
    theta, beta, move = (
        np.broadcast_to(a, batch + tail).reshape(prod(batch), *tail)
        for a, tail in ((theta, theta.shape[-2:]), (beta, beta.shape[-1:]), (move, (3,)))
    )
    free = [body.array(n).reshape(b.symbol_shape[::-1]).T for n, b in body.free.items()]
    points = np.empty((len(theta), function.size2_out(0), 3))
    for i in range(len(theta)):
        points[i] = np.asarray(function(theta[i].T, beta[i], move[i], *free)).T
    return points.reshape(*batch, *points.shape[1:])


def _pose(body: SkinnedBody, pose: ArrayLike) -> NDArray[np.float64]:
    theta, K = np.asarray(pose, dtype=float), body.n_joints
    if theta.shape[-2:] == (K, 3):
        return theta
    if theta.shape[-1:] == (3 * K,):
        return theta.reshape(*theta.shape[:-1], K, 3)
    raise BadBody(
        f"body {body.name!r} has {K} joints and takes a pose of shape (..., {K}, 3) or "
        f"(..., {3 * K}), not {theta.shape}"
    )


def _betas(body: SkinnedBody, betas: ArrayLike) -> NDArray[np.float64]:
    beta, B = np.asarray(betas, dtype=float), body.n_betas
    if beta.ndim == 0 or beta.shape[-1] > B:
        raise BadBody(f"body {body.name!r} takes up to {B} betas, not an array {beta.shape}")
    return np.pad(beta, [(0, 0)] * (beta.ndim - 1) + [(0, B - beta.shape[-1])])
