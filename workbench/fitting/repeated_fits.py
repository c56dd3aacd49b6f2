"""Many fits to data that are made anew: how uncertain a solution is, without linear algebra.

At a point x* every whitened row r(x) is replaced by r(x) - r(x*) - e with e ~ N(0, 1): data at
which x* is exact, and noise of the size that sigma states. Priors count as data about x*, so that
the spread of the ends is that of the posterior: J'J exactly where residuals are linear (randomized
maximum likelihood; Oliver, He and Reynolds, Conditioning permeability fields to pressure data,
1996), and up to curvature elsewhere.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Mask
from workbench.blocks import Block, Layout, Values
from workbench.blocks.layout import entries
from workbench.diagnostics.design import Criterion, MeasurementDesign, Quantity
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.residuals import Residual
from workbench.solvers import TrustRegion
from workbench.solvers.solution import Solver


@dataclass(frozen=True, eq=False)
class RepeatedFits:
    """The ends of N fits.

    Attributes:
        free: the layout of the unknowns.
        truth: (n,) the point from which the data were made.
        ends: (N, n) the free numbers at the ends.
        converged: (N,) which of the fits converged.
    """

    free: Layout
    truth: Array
    ends: Array
    converged: Mask

    @property
    def errors(self) -> Array:
        """The ends minus the truth, (N, n)."""
        return self.ends - self.truth

    def values(self, fit: int, values: Values) -> Values:
        """The values of all blocks at the end of one fit; fixed ones are taken from `values`."""
        return dict(values) | self.free.unpack(self.ends[fit])

    def numbers(self, what: Quantity, values: Values) -> Array:
        """A quantity at every end, (N, q); fixed blocks are taken from `values`."""
        graph = what.residual.graph()
        symbols = cs.symvar(graph)
        function = cs.Function("quantity", symbols, [graph])
        found = []
        for fit in range(len(self.ends)):
            at = self.values(fit, values)
            given = (np.asarray(at[symbol.name()], dtype=float).T for symbol in symbols)
            found.append(np.asarray(function(*given)).ravel())
        return np.array(found)

    def spread(self, criterion: Criterion, values: Values) -> float:
        """The standard deviation that `sd_of` predicts, as it is among the ends."""
        if criterion.quantity is not None:
            numbers = self.numbers(criterion.quantity, values)
        else:
            numbers = self.ends[:, entries(self.free, criterion.names or self.free.names)]
        return float(np.sqrt(numbers.var(axis=0, ddof=1).sum()))


def repeated_fits(
    problem: Problem,
    values: Mapping[str, ArrayLike],
    count: int,
    *,
    seed: int = 0,
    solver: Solver | None = None,
    progress: Callable[[int, int], object] = lambda done, of: None,
) -> RepeatedFits:
    """`count` fits to data with new noise, each of which begins at the point `values`.

    Bounds and constraints hold as usual. Raises BadArgument for less than one fit, and for a
    problem whose residuals are of a sequence.
    """
    if count < 1:
        raise BadArgument(f"one fit or more can be made, not {count}")
    if any(residual.by_frame for residual in problem.residuals):
        raise BadArgument(
            "the data of a sequence are not made anew; take the problem of one frame, or stack "
            "residuals of your own in a Problem"
        )
    x, fixed = problem.split(values)
    exact = problem.residual(x, fixed)
    noise = Block("noise", (problem.size,), "1")
    noisy = [
        _noisy(one, noise, problem.rows[one.name], exact[problem.rows[one.name]])
        for one in problem.residuals
    ]
    blocks = (*problem.known.values(), noise)
    made = Problem(
        noisy, problem.free.spelled(), problem.bounds, blocks, constraints=problem.constraints
    )
    rng, by = np.random.default_rng(seed), solver or TrustRegion()
    ends, converged = [], []
    for fit in range(count):
        data = {noise.name: rng.standard_normal(problem.size)}
        solution = by.solve(made, {**problem.read(values), **data})
        ends.append(problem.split(dict(values) | solution.values)[0])
        converged.append(solution.converged)
        progress(fit + 1, count)
    return RepeatedFits(problem.free, x, np.array(ends), np.array(converged))


def checked_by_fits(
    found: MeasurementDesign,
    problems: tuple[Problem, Problem],
    criterion: Criterion,
    values: Values,
    count: int,
    *,
    seed: int = 0,
    progress: Callable[[str, int, int], None] = lambda what, done, of: None,
) -> str:
    """A sentence that compares the standard deviations of a design with those of `count` fits each.

    `problems` are those without and with the chosen candidates.
    """
    unit = "" if found.unit == "1" else f" {found.unit}"
    parts = []
    for when, problem, score in zip(
        ("before", "after"), problems, (found.before, found.after), strict=True
    ):
        if score.open:
            parts.append(f"{when}: undetermined, so nothing was simulated")
            continue
        told = partial(progress, f"simulated fits {when}")
        fits = repeated_fits(problem, values, count, seed=seed, progress=told)
        sd = fits.spread(criterion, values)
        parts.append(f"{when}: predicted {score.sd:.3g}{unit}, simulated {sd:.3g}{unit}")
    return f"Checked by {count} simulated fits each; {'; '.join(parts)}."


def _noisy(residual: Residual, noise: Block, rows: slice, exact: Array) -> Residual:
    """The whitened residual, zero at the point where it was `exact` but for the noise."""
    whitened = residual.whitened - exact - noise.symbol[rows]
    points = residual.points
    return Residual(residual.name, whitened, 1.0, points=points, blocks=residual.blocks)
