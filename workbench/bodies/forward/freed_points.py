"""The surface of a body with free arrays, under the names that a problem gives to its blocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array
from workbench.bodies.forward.freed_numbers import BLOCKS, FreedSurface, FreedSurfaceAt
from workbench.bodies.forward.freed_patterns import pattern_by


@dataclass(frozen=True, eq=False)
class FreedPoints:
    """Such a surface under a problem's names of its blocks; see NumericPoints, SparsePoints."""

    surface: FreedSurface
    names: tuple[str, str, str]  # of pose, betas and trans
    arrays: Mapping[str, str]  # the block of each free array

    @property
    def reads(self) -> tuple[str, ...]:
        """Pose, betas, trans and the free arrays by their names in the problem."""
        return (*self.names, *self.arrays.values())

    @property
    def named(self) -> dict[str, str]:
        """The surface's own names by those of the problem."""
        return dict(zip(self.reads, (*BLOCKS, *self.arrays), strict=True))

    def pattern(self, name: str) -> csc_array | None:
        """Where the derivative by a block can be nonzero; see `pattern_by`."""
        return pattern_by(self.surface, self.named[name], self.arrays)

    def at(self, values: Mapping[str, Array]) -> FreedPointsAt:
        """Where the blocks have these values."""
        arrays = {name: values[block] for name, block in self.arrays.items()}
        pose, betas, trans = (values[name] for name in self.names)
        return FreedPointsAt(self, self.surface.at(arrays, pose, betas, trans))

    def many(self, values: Mapping[str, Array]) -> Array:
        """(M, n, 3) m, one after the other."""
        count = len(values[self.names[0]])
        each = ({name: values[name][i] for name in self.reads} for i in range(count))
        return np.array([self.at(one).points for one in each])


@dataclass(frozen=True, eq=False)
class FreedPointsAt:
    """The vertices at one set of values; see PointsAt, SparsePointsAt."""

    of: FreedPoints
    here: FreedSurfaceAt

    @property
    def points(self) -> Array:
        """The chosen vertices of the posed surface, (n, 3) m."""
        return self.here.points

    def jacobian(self, name: str) -> csc_array:
        """By a block, (3 n, size); see FreedSurfaceAt."""
        return self.here.jacobian(self.of.named[name])

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[block] (size, 3 n)."""
        self.here.tangent({self.of.named[name]: a for name, a in into.items()}, scale)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By every block that is read, flat."""
        found = self.here.adjoint(pull)
        return {name: found[own] for name, own in self.of.named.items()}
