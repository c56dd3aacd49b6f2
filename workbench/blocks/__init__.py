"""Named blocks of numbers, the flat vectors they pack into, and points that come from bodies."""

from workbench.blocks.block import Block
from workbench.blocks.layout import Layout, Values
from workbench.blocks.points import (
    NumericPoints,
    Points,
    PointsAt,
    PointSource,
    Tree,
    in_blocks,
    jacobian,
)

__all__ = [
    "Block",
    "Layout",
    "NumericPoints",
    "PointSource",
    "Points",
    "PointsAt",
    "Tree",
    "Values",
    "in_blocks",
    "jacobian",
]
