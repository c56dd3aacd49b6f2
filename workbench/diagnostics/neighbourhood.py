"""The points around: whether what holds here holds there."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.diagnostics.jacobian import Jacobian, jacobian_at
from workbench.problem import Problem

NEIGHBOURS = 4
NEARBY = 0.1  # of a unit: how far they are away in each entry


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Rank and singular values at a few random points, a tenth of a unit away in each entry.

    Points where the Jacobian is not finite are left out; so are all for a sparse large one.
    """

    problem: Problem
    at: Values
    here: Jacobian

    @cached_property
    def points(self) -> tuple[tuple[int, NDArray[np.float64]], ...]:
        """Of each, the rank and the singular values (min(m, n),)."""
        if self.here.estimated or not self.problem.free.size:
            return ()
        rng = np.random.default_rng(0)
        found = []
        for _ in range(NEIGHBOURS):
            moved = {
                block.name: np.asarray(self.at[block.name], dtype=float)
                + NEARBY * rng.standard_normal(np.shape(self.at[block.name]))
                for block in self.problem.free.blocks
            }
            there = jacobian_at(self.problem, self.at | moved)
            if there.finite:
                found.append((there.rank, there.svd[0]))
        return tuple(found)

    @property
    def ranks(self) -> tuple[int, ...]:
        """The ranks there: is the rank here the rule or the exception?"""
        return tuple(rank for rank, _ in self.points)

    @property
    def weaker_here(self) -> float:
        """How many times weaker the weakest direction that is seen is here than typically there."""
        rank = self.here.rank
        if not self.points or not rank:
            return 1.0
        there = float(np.median([s[rank - 1] for _, s in self.points]))
        return there / float(self.here.svd[0][rank - 1])
