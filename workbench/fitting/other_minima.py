"""Other minima, looked for along the directions that the data determine least.

A diagnosis looks at one point. A direction that is weak there may be the floor of a valley, along
which every point is as good, or the way into a second basin: a limb that one camera sees may lean
towards it or away from it, at nearly the same cost. So the fit is repeated from points on both
sides along the weakest directions, and the ends are told apart.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.directions import in_units
from workbench.diagnostics import diagnose_whole
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.solvers import DEFAULT, SOLVERS, Solver

REACH, LONGEST = 3.0, 1.5  # of a start: standard deviations along its direction; yardsticks at most
SHARES = (1.0, 0.5)  # of this: how far the starts are on each side
SAME = 0.01  # yardsticks of each entry: nearer ends are one
LEVEL = 1e-6  # of 1 + cost: ends of the same cost that are apart are in one valley


@dataclass(frozen=True, eq=False)
class OtherMinimum:
    """An end that is not the first one.

    Attributes:
        values: all unknowns there.
        excess: its cost minus that of the first.
        apart: the largest difference of an entry from the first minimum, in yardsticks.
        entry: the entry of this difference.
        starts: how many starts led to it.
    """

    values: Values = field(repr=False)
    excess: float
    apart: float
    entry: str
    starts: int


@dataclass(frozen=True, eq=False)
class OtherMinima:
    """What starts along the weakest directions ended in.

    Attributes:
        starts: how many there were.
        came_back: how many ended at the first minimum.
        valley: those at the same cost as the first, each apart from it.
        minima: those at other costs, the lowest first.
        directions: along which directions the starts lay, in words.
    """

    starts: int
    came_back: int
    valley: tuple[OtherMinimum, ...]
    minima: tuple[OtherMinimum, ...]
    directions: tuple[str, ...] = field(repr=False)

    @property
    def better(self) -> tuple[OtherMinimum, ...]:
        """The minima at a lower cost than the first."""
        return tuple(one for one in self.minima if one.excess < 0)

    def __str__(self) -> str:
        """All of it in sentences."""
        told = [
            f"Of {self.starts} fits from starts on both sides along the {len(self.directions)} "
            f"weakest directions, {self.came_back} came back."
        ]
        if self.valley:
            far = max(self.valley, key=lambda one: one.apart)
            told.append(
                f"{sum(one.starts for one in self.valley)} ended elsewhere at the same cost, up to "
                f"{far.apart:.2g} yardsticks away in {far.entry}: this is a valley, and where a "
                "fit ends in it is arbitrary."
            )
        for one in self.minima:
            side = f"{one.excess:.3g} above" if one.excess > 0 else f"{-one.excess:.3g} below"
            told.append(
                f"{one.starts} ended in another minimum, at a cost {side}, which differs most in "
                f"{one.entry}, by {one.apart:.2g} yardsticks."
            )
        if self.better:
            told.append("The fit was not at the best minimum.")
        if not self.valley and not self.minima:
            told.append("No other minimum was found this way.")
        return " ".join(told)


def other_minima(
    problem: Problem,
    values: Mapping[str, ArrayLike],
    *,
    directions: int = 8,
    solver: Solver = SOLVERS[DEFAULT],
    progress: Callable[[int, int], object] | None = None,
) -> OtherMinima:
    """Fit from four starts along each of the weakest directions at the minimum `values`.

    On each side of the minimum there are two starts: at three standard deviations along the
    direction, but at most 1.5 yardsticks, and at half this distance. `progress` is told how many
    fits are done, and of how many. Minima that lie in no such direction are not found. Raises
    BadArgument for no directions.

    >>> import casadi, workbench as wb
    >>> from workbench.fitting import other_minima
    >>> from workbench.residuals import Residual
    >>> x = wb.Block("x", (2,))
    >>> bent = casadi.vertcat(x.symbol[0] ** 2 - 0.5, 0.1 * (x.symbol[0] + 2), x.symbol[1])
    >>> problem = wb.Problem([Residual("two wells", bent, 1.0)], ["x"])
    >>> found = other_minima(problem, wb.solve(problem, {"x": [1, 0]}).values)
    >>> len(found.better), found.better[0].entry
    (1, 'x[0]')
    """
    if directions < 1:
        raise BadArgument(f"one direction or more is looked along, not {directions}")
    here = diagnose_whole(problem, values)
    sizes = here.scales.sizes
    s, basis = _weakest(here.here.dense * sizes, directions)
    x, fixed = problem.split(values)
    starts = [
        np.clip(x + sign * share * length * sizes * d, problem.lower, problem.upper)
        for d, length in zip(basis, np.minimum(REACH / np.maximum(s, 1e-300), LONGEST), strict=True)
        for sign in (1, -1)
        for share in SHARES
    ]
    first, back = here.here.cost, 0
    ends: list[tuple[Array, float, int]] = []
    for done, start in enumerate(starts, start=1):
        solution = solver.solve(problem, problem.values(start, fixed))
        end = problem.split({**values, **solution.values})[0]
        if np.abs((end - x) / sizes).max() < SAME:
            back += 1
        else:
            _add(ends, end, solution.cost, sizes)
        if progress is not None:
            progress(done, len(starts))
    found = []
    for end, cost, count in ends:
        away = np.abs((end - x) / sizes)
        k = int(np.argmax(away))
        there, entry = problem.values(end, fixed), problem.free.label(k)
        found.append(OtherMinimum(there, cost - first, float(away[k]), entry, count))
    level = LEVEL * (1 + first)
    return OtherMinima(
        len(starts),
        back,
        tuple(one for one in found if abs(one.excess) <= level),
        tuple(sorted((o for o in found if abs(o.excess) > level), key=lambda one: one.excess)),
        tuple(in_units(d * sizes, problem.free) for d in basis),
    )


def _weakest(J: Array, count: int) -> tuple[Array, Array]:
    """The smallest singular values of J (m, n), zeros included, and their directions (count, n)."""
    n = J.shape[1]
    values, vectors = scipy.linalg.eigh(J.T @ J, subset_by_index=(0, min(count, n) - 1))
    return np.sqrt(np.maximum(values, 0)), vectors.T


def _add(ends: list[tuple[Array, float, int]], end: Array, cost: float, sizes: Array) -> None:
    """Count an end among those that are near it."""
    for i, (there, least, count) in enumerate(ends):
        if np.abs((end - there) / sizes).max() < SAME:
            ends[i] = (there, least, count + 1)
            return
    ends.append((end, cost, 1))
