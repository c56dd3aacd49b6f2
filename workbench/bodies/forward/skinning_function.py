"""W(T, J, weights, theta), the skinning function of SMPL, as a function of all four."""

from collections.abc import Sequence
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks.checks import reals
from workbench.bodies.forward.kinematics import binding_motions
from workbench.bodies.forward.skinning import linear_blend
from workbench.errors import BadArgument
from workbench.geometry.rotation import rodrigues


def skin(T: Any, J: Any, weights: Any, theta: Any, parents: Sequence[int]) -> Any:
    """The posed points (3, N) m in symbols: W(T, J, weights, theta).

        w_i = sum over k of weights[i, k] G'_k(theta, J) (t_i; 1)                  (SMPL eq. 2)
        G'_k(theta, J) = G_k(theta, J) G_k(0, J)^-1                                (SMPL eq. 3)
        G_k(theta, J) = product over the joints j from the root to k of
                        [exp(theta_j), J_j - J_parent(j); 0, 1]                    (SMPL eq. 4)

    T (3, N) m are the points at rest, J (3, K) m the joints at rest, weights (N, K) and theta
    (3, K) rad rotation vectors. Each is a symbol or an expression of CasADi, MX or SX, or an array
    of numbers of that shape; the result is of the same kind. It is linear in T, in J and in the
    weights, each alone. A body's own surface is W(T + B_S(beta) + B_P(theta), J(beta), weights,
    theta), which `SkinnedBody.points` writes for its own arrays.

    Raises BadArgument for MX together with SX, and for shapes that do not fit.
    """
    given = {"T": T, "J": J, "weights": weights, "theta": theta}
    kinds = {type(a) for a in given.values() if isinstance(a, (cs.MX, cs.SX))}
    if len(kinds) > 1:
        raise BadArgument(
            "the skinning function takes symbols of one kind, and was given MX and SX; a function "
            "of SX, called with MX, joins the two"
        )
    kind = kinds.pop() if kinds else cs.DM
    points, joints, shares, pose = (
        a if isinstance(a, kind) else kind(cs.DM(a)) for a in given.values()
    )
    N, K = points.shape[1], len(parents)
    expected = {"T": (3, N), "J": (3, K), "weights": (N, K), "theta": (3, K)}
    for name, found in zip(given, (points, joints, shares, pose), strict=True):
        if found.shape != expected[name]:
            raise BadArgument(
                f"{name} has shape {found.shape}, but must be {expected[name]} for {N} points on "
                f"{K} joints"
            )
    at_zero = rodrigues(kind(cs.DM.zeros(3, K)))
    motions, _ = binding_motions(rodrigues(pose), at_zero, joints, parents)
    return linear_blend(points, motions, shares)


def skin_vertices(
    T: ArrayLike, J: ArrayLike, weights: ArrayLike, theta: ArrayLike, parents: Sequence[int]
) -> Array:
    """W(T, J, weights, theta) in numbers; see `skin`.

    T and the result are (N, 3) m, J (K, 3) m, weights (N, K) and theta (K, 3) rad.

    Raises BadArgument for shapes that do not fit, and NotNumbers.
    """
    t, j, w, pose = (
        reals(name, array)
        for name, array in (("T", T), ("J", J), ("weights", weights), ("theta", theta))
    )
    for name, array in (("T", t), ("J", j), ("theta", pose)):
        if array.ndim != 2 or array.shape[1] != 3:
            raise BadArgument(f"{name} has shape {array.shape}, but must have three columns")
    return np.array(skin(t.T, j.T, w, pose.T, parents)).T
