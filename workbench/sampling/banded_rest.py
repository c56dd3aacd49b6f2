"""What is not sampled of a long sequence, integrated out by the band of its normal equations."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Index
from workbench.problem import Linearization
from workbench.problem.banded import BandedFactor, BandedMatrix


@dataclass(frozen=True, eq=False)
class BandedRest:
    """The matrix (n, c) that makes of w ~ N(0, 1) what is integrated out; it is never stored.

    Attributes:
        factor: Cholesky's factor of the normal equations.
        others: (c,) the unknowns that are integrated out.
    """

    factor: BandedFactor
    others: Index

    @property
    def shape(self) -> tuple[int, int]:
        """(n, c)."""
        return self.factor.order.size, len(self.others)

    def times(self, w: Array) -> Array:
        """The matrix times each row of w (M, c): (M, n)."""
        whole = np.zeros((self.shape[0], len(w)))
        whole[self.others] = w.T
        return self.factor.half_times(whole).T


def banded_rest(here: Linearization, named: Index) -> tuple[Array, BandedRest] | None:
    """The ridge -H_bb^-1 H_ba in the rows of b, (n, k), and what spreads about it, H = J'J.

    a are the `named` unknowns and b all others. None where H_bb is not definite enough.
    """
    n = here.shape[1]
    is_named = np.zeros(n, dtype=bool)
    is_named[named] = True
    others = here.scaled(np.where(is_named, 0.0, 1.0))
    normal = others.normal
    assert isinstance(normal, BandedMatrix)
    factor = normal.factorized(is_named.astype(float))  # a stands by itself, and stays zero
    if factor is None:
        return None
    own = np.zeros((n, len(named)))
    own[named, np.arange(len(named))] = 1.0
    along = here.jacobian @ own
    right = np.column_stack([others.jacobian.T @ column for column in along.T])
    return -factor.solve(right), BandedRest(factor, np.flatnonzero(~is_named))
