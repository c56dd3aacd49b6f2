"""How many numbers a body is made of, array by array, and what a lecture's slide says instead.

The slide counts for N = 6,890 vertices, 23 joints and 10 shape directions. Its sum is right. But
one of its products lacks a factor that its value has, and two of its values are not what a released
model holds; `SLIDE` says why.
"""

from dataclasses import dataclass

import numpy as np

from workbench.bodies.skinned import SkinnedBody

SMPL_SIZE = (6890, 24, 10)  # N, K, B of the released model


@dataclass(frozen=True)
class Count:
    """The size of one array.

    Attributes:
        name: the array's.
        shape: the array's.
        numbers: how many it holds.
        nonzero: how many of them are not zero; None where only the size is known.
    """

    name: str
    shape: tuple[int, ...]
    numbers: int
    nonzero: int | None = None


@dataclass(frozen=True)
class SlideRow:
    """What the slide prints about one array, the number it gives, and a remark."""

    name: str
    printed: str
    numbers: int
    remark: str


SLIDE = (
    SlideRow("template", "3 · 6890", 20_670, ""),
    SlideRow("shapedirs", "3 · 6890 · 10", 206_700, ""),
    SlideRow(
        "posedirs",
        "9 · 23 · 6890",
        4_278_690,
        "the value includes the factor 3 of the coordinates that the product leaves out",
    ),
    SlideRow(
        "weights",
        "4 · 3 · 6890",
        82_680,
        "four weights a vertex are 27,560 and a dense file has 165,360; the 3 has no meaning here",
    ),
    SlideRow(
        "J_regressor",
        "3 · 6890 · 23 · 3",
        1_426_230,
        "a free linear map from all coordinates to all joints; the model has one weight for each "
        "vertex and joint, 158,470, or 165,360 with the root",
    ),
)


def dense_counts(N: int, K: int, B: int) -> tuple[Count, ...]:
    """The arrays of a file: N vertices, K joints with the root, and B shape directions."""
    shapes = {
        "template": (N, 3),
        "shapedirs": (N, 3, B),
        "posedirs": (N, 3, 9 * (K - 1)),
        "weights": (N, K),
        "J_regressor": (K, N),
    }
    return tuple(Count(name, shape, int(np.prod(shape))) for name, shape in shapes.items())


def counts(body: SkinnedBody) -> tuple[Count, ...]:
    """The arrays of a body itself."""
    arrays = {
        name: body.array(name)
        for name in ("template", "shapedirs", "posedirs", "weights", "J_regressor")
    }
    return tuple(
        Count(name, array.shape, int(array.size), int(np.count_nonzero(array)))
        for name, array in arrays.items()
    )


def total(found: tuple[Count, ...] | tuple[SlideRow, ...]) -> int:
    """The sum of all rows."""
    return sum(row.numbers for row in found)
