"""Points at several sets of values, such as those of the frames of a sequence."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from workbench.arrays import Array
from workbench.blocks.points import NumericPoints, PointsAt


class PointsOfEach(Protocol):
    """Points at M sets of values; see PointsAt for those at one."""

    @property
    def points(self) -> Array:
        """The points, (M, N, 3), in metres."""

    def tangents(self, some: slice, into: Mapping[str, Array]) -> None:
        """Write the derivatives by blocks at some of the values, into[name] (some, 3 N, size)."""

    def adjoints(self, pulls: Array) -> dict[str, Array]:
        """The gradients (M, size) of each sum(pull * points), pulls (M, 3 N), by each block."""


@dataclass(frozen=True, eq=False)
class FrameByFrame:
    """Points that are computed for one set of values after the other; see PointsOfEach."""

    places: list[PointsAt]

    @cached_property
    def points(self) -> Array:
        """The points, (M, N, 3), in metres."""
        return np.array([here.points for here in self.places])

    def tangents(self, some: slice, into: Mapping[str, Array]) -> None:
        """Write the derivatives at some of the values, (some, 3 N, size)."""
        for i, here in enumerate(self.places[some]):
            here.tangent({name: room[i].T for name, room in into.items()}, None)

    def adjoints(self, pulls: Array) -> dict[str, Array]:
        """The gradients (M, size) by each block that is read."""
        return stacked([here.adjoint(own) for here, own in zip(self.places, pulls, strict=True)])


def stacked(found: list[dict[str, Array]]) -> dict[str, Array]:
    """Gradients (M, size) by each block, from M of them."""
    return {name: np.array([one[name] for one in found]) for name in (found[0] if found else {})}


def points_of_each(source: NumericPoints, values: Mapping[str, Array], count: int) -> PointsOfEach:
    """The points at M = `count` sets of values, of every block that is read (M, *shape).

    A source may have a method `evaluate_each` for that, where it finds several in fewer calls.
    """
    together = getattr(source, "evaluate_each", None)
    if together is not None:
        found: PointsOfEach = together(values, count)
        return found
    each = ({name: value[i] for name, value in values.items()} for i in range(count))
    return FrameByFrame([source.evaluate(some) for some in each])
