"""Weights of residuals: their roots, by which rows are multiplied, and what weights may be."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks.checks import reals
from workbench.errors import BadResidual


def root(weights: cs.MX | ArrayLike) -> cs.MX | cs.DM:
    """sqrt(w), by which a whitened row is multiplied so that its square counts w times.

    The derivative is 0 at w = 0, where that of the root is infinite. NaN below zero.
    """
    if not isinstance(weights, cs.MX):
        return cs.DM(np.sqrt(reals("weights", weights)))
    none = weights == 0
    return cs.if_else(none, 0, cs.sqrt(cs.if_else(none, 1, weights)))


def check_weights(
    name: str, weights: cs.MX | ArrayLike | None, counts: tuple[int, ...], why: str
) -> None:
    """Raise BadResidual unless there is one weight, or one of `counts`, none below zero.

    `why` ends the sentence about weights that do not fit. If weights depend on symbols, only
    their shape is checked. Raises NotNumbers for text.
    """
    if weights is None:
        return
    if isinstance(weights, cs.MX):
        shape, fits = weights.shape, weights.shape in ((1, 1), *((n, 1) for n in counts))
        known = None if cs.symvar(weights) else np.asarray(cs.evalf(weights), dtype=float)
    else:
        known = reals(f"the weights of residual {name!r}", weights)
        shape, fits = known.shape, known.shape in ((), *((n,) for n in counts))
    if not fits:
        raise BadResidual(
            f"residual {name!r} needs one weight or {' or '.join(map(str, counts))} of them, not "
            f"an array of shape {shape}{why}"
        )
    if known is not None:
        _check_numbers(name, known)


def _check_numbers(name: str, known: Array) -> None:
    bad = ~((known >= 0) & np.isfinite(known))
    if bad.any():
        raise BadResidual(
            f"residual {name!r} needs finite weights from 0 on, not {known[bad].flat[0]:g}; a row "
            "of weight 0 has no influence"
        )
