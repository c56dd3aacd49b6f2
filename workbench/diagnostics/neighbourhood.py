"""Rank and singular values at points nearby: whether this point is an exception."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array
from workbench.diagnostics.active_set import constrained_jacobian_at
from workbench.diagnostics.point import Point

NEIGHBOURS = 4
NEARBY = 0.1  # how far they are away in each entry, in yardsticks


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Rank and singular values at a few random points, a tenth of a yardstick away in each entry.

    The constraints and bounds that are active here count as active there. Points where the
    Jacobian is not finite are left out, and all points for a large sparse Jacobian.

    Attributes:
        here: the point in the middle.
    """

    here: Point

    @cached_property
    def points(self) -> tuple[tuple[int, Array], ...]:
        """The rank and the singular values (min(m, n),) at each point."""
        if self.here.here.estimated or not self.here.problem.free.size:
            return ()
        rng = np.random.default_rng(0)
        found = []
        problem, at, steps = self.here.problem, self.here.at, self.here.yardsticks.sizes
        sizes = problem.free.placed(steps)
        for _ in range(NEIGHBOURS):
            moved = {
                block.name: np.asarray(at[block.name], dtype=float)
                + NEARBY * sizes[block.name] * rng.standard_normal(np.shape(at[block.name]))
                for block in problem.free.blocks
            }
            there = constrained_jacobian_at(problem, at | moved, self.here.active)
            if there.here.finite and np.isfinite(there.rows).all():
                there = there.measured(steps)
                found.append((there.rank, there.reduced.spectrum.s))
        return tuple(found)

    @property
    def ranks(self) -> tuple[int, ...]:
        """The rank at each of the points."""
        return tuple(rank for rank, _ in self.points)

    @property
    def weaker_here(self) -> float:
        """How many times weaker the weakest direction that is seen is here than typically there."""
        if not self.points:
            return 1.0
        here = self.here.measured.reduced
        rank = here.spectrum.rank
        there = [s[rank - 1] for _, s in self.points if s.size >= rank]
        if not there or not rank:
            return 1.0
        return float(np.median(there)) / float(here.spectrum.s[rank - 1])
