"""In which arguments a body is linear, proved from the expression of its vertices."""

from collections.abc import Sequence

import casadi as cs
import numpy as np

from workbench.bodies.skinned import SkinnedBody

OF_A_BODY = ("pose", "betas", "trans")  # free anyway; everything else is an array of the model


def linear_in(body: SkinnedBody, names: Sequence[str], vertices: Sequence[int]) -> bool:
    """Whether some vertices are a linear function, up to a constant, of these arguments together.

    The names are those of arguments (pose, betas, trans) and of arrays of the model, such as
    `template` or `weights`. All others are held fixed.
    """
    freed = body.freed(*(name for name in names if name not in OF_A_BODY))
    arguments = [block.symbol for block in freed.blocks()]
    posed = freed.points(*arguments, vertices=list(vertices)).source.expression  # (3, n) m
    symbols = {symbol.name(): symbol for symbol in cs.symvar(posed)}
    others = [symbol for name, symbol in symbols.items() if name not in names]
    f = cs.Function("f", [*(symbols[name] for name in names), *others], [cs.vec(posed)]).expand()
    # one vector of all named numbers, cut into the arguments
    ends = np.cumsum([0, *(symbols[name].numel() for name in names)]).tolist()
    together = cs.SX.sym("x", ends[-1])
    inputs = [
        cs.reshape(part, symbols[name].shape)
        for name, part in zip(names, cs.vertsplit(together, ends), strict=True)
    ]
    fixed = [cs.SX.sym("fixed", *symbol.shape) for symbol in others]
    return bool(cs.is_linear(f(*inputs, *fixed), together))
