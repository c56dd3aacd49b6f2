"""How far a point is from stationary, free of units: one measure for every solver."""

from math import sqrt

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from workbench.problem.constraint_set import Constrained
from workbench.problem.linearization import Linearization

Array = NDArray[np.float64]
Box = tuple[Array, Array]


def optimality(x: Array, here: Linearization, box: Box | None, rounding: float) -> float:
    """0 at a stationary point; without constraints at most 1; NaN where there are no numbers.

    The largest |d_i| / |r|, less what rounding explains. d is the way that the gradient pulls,
    -g_i / |J_i|, in variables y_i = |J_i| x_i, whose steps have the units of the residual: there
    d / |r| are the cosines between the residual and the columns of the Jacobian. With bounds (a
    box, lower and upper) and constraints d is that pull's projection on what they allow, to first
    order: where the bounds or the linearized constraints stop it, it is stopped, and a constraint
    that is missed moves it. So d = 0 says that Karush, Kuhn and Tucker's conditions hold.
    """
    if not here.finite:
        return np.nan
    norms, size = here.column_norms, sqrt(2 * here.cost)
    if here.constraints is None:
        scale = np.where(norms > 0, norms, 1.0)  # nothing pulls at what no residual notices
        d = -here.gradient / scale
        if box is not None:
            lower, upper = box
            d = np.minimum(np.maximum(d, (lower - x) * scale), (upper - x) * scale)
    else:  # what no residual notices costs nothing to move, but is measured all the same
        scale = np.where(norms > 0, norms, norms.max(initial=0.0) or 1.0)
        lower, upper = box or (np.full_like(x, -np.inf), np.full_like(x, np.inf))
        d = _allowed(-here.gradient / scale, (lower - x) * scale, (upper - x) * scale,
                     here.constraints, scale)  # fmt: skip
    way = float(np.abs(d).max(initial=0.0)) - rounding
    if way <= 0:
        return 0.0
    if here.constraints is not None and not size:
        return np.inf
    return way / size if size > 0 else 0.0


def _allowed(pull: Array, left: Array, right: Array, there: Constrained, scale: Array) -> Array:
    """The d nearest to the pull with left <= d <= right and the constraints met, linearized.

    A least-distance problem, by nonnegative least squares for its multipliers (Lawson and Hanson
    1974, chapter 23). Infinite where no d meets them.
    """
    down, up = there.way_left
    A = there.jacobian / scale
    lengths = np.linalg.norm(A, axis=1)
    flat = lengths == 0
    if (flat & ((down > 0) | (up < 0))).any():
        return np.full_like(pull, np.inf)
    lengths = np.where(flat, 1.0, lengths)
    rows = np.concatenate([np.eye(len(pull)), A / lengths[:, None]])
    lows, highs = np.concatenate([left, down / lengths]), np.concatenate([right, up / lengths])
    # G z >= h for z = d - pull, in units of the farthest that d may have to go
    reach = float(np.linalg.norm(pull)) + float(
        np.max(np.concatenate([lows, -highs, [0.0]]), initial=0.0)
    )
    if reach == 0:
        return np.zeros_like(pull)
    at = rows @ pull
    G = np.concatenate([rows, -rows])
    h = np.concatenate([lows - at, at - highs]) / reach
    near = h > -4.0 * np.sqrt(len(pull))  # a limit farther away than any d stops nothing
    G, h = G[near], h[near]
    if (h <= 0).all():
        return pull
    E = np.concatenate([G.T, h[None]])
    u, distance = scipy.optimize.nnls(E, np.append(np.zeros(len(pull)), 1.0))
    if distance < 1e-10:
        return np.full_like(pull, np.inf)
    active = u > 0
    z = np.linalg.lstsq(G[active], h[active], rcond=None)[0]  # the same, to all digits
    return np.asarray(pull + reach * z)
