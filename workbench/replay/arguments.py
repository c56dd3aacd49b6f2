"""Values of blocks as the numbers that move a body: pose, betas and trans in one row."""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.bodies.forward.sources import arguments_from_values
from workbench.problem import Problem

Row = Callable[[Values], Array]


def row_of_body(body: Body, problem: Problem, known: Values) -> Row | None:
    """A function from values to 3 K + B + 3 numbers; None if the problem does not determine them.

    `known` are the values of blocks that the given values lack.
    """

    def row(values: Values) -> Array:
        found = arguments_from_values(body, problem.points, dict(known) | dict(values))
        assert found is not None  # asked below
        return np.concatenate([np.ravel(one) for one in found])

    found = arguments_from_values(body, problem.points, known)
    shapes = tuple(block.shape for block in body.blocks())
    if found is None or tuple(np.shape(one) for one in found) != shapes:
        return None  # among them several frames
    return row
