"""By what a measurement is chosen: the size of the covariance of what matters.

D-optimality does not depend on the units of the unknowns, nor on any other linear change of them:
the volume of the ellipsoid is multiplied by the same number for every candidate. A- and
E-optimality do depend on them, and therefore measure every unknown by its yardstick (a radian, a
metre, a standard deviation of shape); with other yardsticks they may choose another candidate. See
Pukelsheim, Optimal Design of Experiments, 2006.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as cs
import numpy as np
import scipy.linalg

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Points
from workbench.blocks.checks import texts
from workbench.blocks.layout import entries
from workbench.errors import BadArgument
from workbench.residuals import Residual

YARDSTICKS = "yardsticks"  # the unit of what is measured by them
Size = Callable[[Array], float]  # of K (r, q), with K'K the covariance of what matters
Measured = Callable[[Layout, Index, Array], tuple[Array, str]]


@dataclass(frozen=True, eq=False)
class Quantity:
    """A number or a few that are functions of the unknowns, such as a stature or a distance.

    Attributes:
        name: what it is called.
        expression: (q, 1) an expression of symbols of blocks and of points.
        unit: the unit of every row.
        points: the points of bodies that it reads.
        blocks: blocks whose units and labels are known.
    """

    name: str
    expression: cs.MX
    unit: str = "1"
    points: tuple[Points, ...] = ()
    blocks: tuple[Block, ...] = ()

    @cached_property
    def residual(self) -> Residual:
        """The same as a residual with a sigma of 1. Raises BadResidual where it is none."""
        return Residual(
            self.name, self.expression, 1.0, self.unit, points=self.points, blocks=self.blocks
        )


@dataclass(frozen=True, eq=False)
class Criterion:
    """What matters, and a number for the size of its covariance: the smaller the better.

    Attributes:
        name: in words, for the end of a sentence.
        size: the number, a standard deviation in some sense.
        measured: the units in which entries count, such as `in_yardsticks`.
        names: the blocks or entries that matter; all that is free if there are none.
        quantity: what matters instead of entries.
    """

    name: str
    size: Size
    measured: Measured
    names: tuple[str, ...] = ()
    quantity: Quantity | None = None

    def over(self, *names: str) -> "Criterion":
        """The same, where only some blocks or entries matter and the others may stay unknown."""
        chosen = texts("the names of what matters", names)
        words = f"{self.name} of {', '.join(chosen)}"
        return replace(self, name=words, names=chosen, quantity=None)

    def gradients(self, free: Layout, yardsticks: Array) -> tuple[Array, str]:
        """Derivatives (n, q) of what matters by the unknowns in their yardsticks, and their unit.

        Raises UnknownName for an entry that is not free.
        """
        meant = entries(free, self.names or free.names)
        return self.measured(free, meant, yardsticks)


def in_yardsticks(free: Layout, meant: Index, yardsticks: Array) -> tuple[Array, str]:
    """Entries count by their yardsticks."""
    return np.eye(free.size)[:, meant], YARDSTICKS


def in_their_unit(free: Layout, meant: Index, yardsticks: Array) -> tuple[Array, str]:
    """Entries count in the unit that they have. Raises BadArgument if they have several."""
    units = list(dict.fromkeys(free.unit(int(i)) for i in meant))
    if len(units) > 1:
        raise BadArgument(
            f"one standard deviation is of numbers in one unit, and not of numbers in "
            f"{' and '.join(units)}; name entries of one unit, or take d_optimal.over(...)"
        )
    return (np.eye(free.size) * yardsticks)[:, meant], units[0]


def geometric_mean(half: Array) -> float:
    """det(K'K)^(1 / 2 q): the geometric mean of the half axes of the ellipsoid, one sd long."""
    if not half.shape[1]:
        return 1.0  # of nothing
    R = scipy.linalg.qr(half, mode="r", check_finite=False)[0]
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(abs(np.diag(R))))))


def root_mean_square(half: Array) -> float:
    """sqrt(trace(K'K) / q), the root mean square of the standard deviations."""
    return float(np.linalg.norm(half) / np.sqrt(max(1, half.shape[1])))


def largest(half: Array) -> float:
    """sqrt of the largest eigenvalue of K'K: the standard deviation along the worst direction."""
    return float(np.linalg.norm(half, 2)) if half.shape[1] else 1.0


def total(half: Array) -> float:
    """sqrt(trace(K'K)); of one quantity its standard deviation, of a place the length of that."""
    return float(np.linalg.norm(half))


# D-optimality: the volume of the ellipsoid of uncertainty, whatever the units.
d_optimal = Criterion(
    "D-optimality, the mean half axis of the uncertainty ellipsoid", geometric_mean, in_yardsticks
)
# A-optimality: the mean variance, in characteristic scales.
a_optimal = Criterion("A-optimality, the mean variance", root_mean_square, in_yardsticks)
# E-optimality: the variance along the worst direction, in characteristic scales.
e_optimal = Criterion("E-optimality, the worst direction", largest, in_yardsticks)
CRITERIA: Mapping[str, Criterion] = {"d": d_optimal, "a": a_optimal, "e": e_optimal}


def sd_of(what: str | Quantity) -> Criterion:
    """The standard deviation of an entry such as `trans[z]`, of a block, or of a quantity.

    Of several rows it is the root of the sum of their variances. Raises BadArgument for anything
    else, and when it is used, for a block of several units, and UnknownName for no free entry.
    """
    if isinstance(what, Quantity):
        return Criterion(
            f"the standard deviation of {what.name}", total, in_their_unit, quantity=what
        )
    if not isinstance(what, str):
        raise BadArgument(
            f"the standard deviation is that of the name of an entry, such as 'trans[z]', or of a "
            f"Quantity, not of something of type {type(what).__name__}"
        )
    return Criterion(f"the standard deviation of {what}", total, in_their_unit, (what,))
