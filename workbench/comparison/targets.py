"""Success by targets that are common to all, and what became of each run.

A run meets the target tau when it has visited a point with f - f* <= tau (f_0 - f*): f_0 is the
cost at its start, f* the lowest cost that anybody found for this problem, polished, or the known
one where that is lower (More and Wild, Benchmarking derivative-free optimization algorithms, SIAM
J. Optim. 20, 2009, section 2). No solver's own word counts.

Effort is a sum of counts times prices, so the same runs have the same effort on every machine. A
residual is the unit, and n the number of free numbers. A derivative costs no more than anybody can
have it for: a gradient of the cost, one reverse sweep, 4 (Griewank and Walther, Evaluating
Derivatives, second edition, SIAM 2008, chapter 4), or n + 1 by forward differences where that is
less; residual and Jacobian n + 1, so that exact derivatives are never dearer than differences; a
Hessian of the cost, differences of gradients, 4 (n + 1). These are operations, not seconds. All
constraints together are priced as one residual by convention, and their derivatives accordingly.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.comparison.record import KINDS, Record, RunEnding
from workbench.experiments.running import COST_ROUNDING, relative_excess
from workbench.solvers import Status
from workbench.solvers.starts import AS_GOOD


class Price(NamedTuple):
    """The price of one kind of evaluation: its name and formula as texts, and as a function of n,
    in evaluations of the residual.
    """

    name: str
    formula: str
    of: Callable[[int], float]


PRICES = {
    "residual": Price("residual", "1", lambda n: 1.0),
    "gradient": Price("gradient", "min(4, n + 1)", lambda n: min(4.0, n + 1.0)),
    "jacobian": Price("Jacobian", "n + 1", lambda n: n + 1.0),
    "hessian": Price("Hessian", "4 (n + 1)", lambda n: 4.0 * (n + 1.0)),
    "constraint": Price("constraints", "1", lambda n: 1.0),
    "constraint_jacobian": Price("Jacobian of constraints", "n + 1", lambda n: n + 1.0),
    "constraint_hessian": Price("Hessian of constraints", "4 (n + 1)", lambda n: 4.0 * (n + 1.0)),
}
PRICES_SOURCE = "Griewank and Walther, Evaluating Derivatives (2008)"


def prices(n: int) -> dict[str, float]:
    """The price of each kind of evaluation, for n free numbers."""
    return {kind: PRICES[kind].of(n) for kind in KINDS}


def units(counts: ArrayLike, n: int) -> Array:
    """The effort in evaluations of the residual: the counts (..., kinds) times their prices."""
    return np.asarray(np.asarray(counts, dtype=float) @ np.array(list(prices(n).values())))


TAUS = (1e-1, 1e-3, 1e-5, 1e-7)
AT_LOWEST = 1e-9  # of the whole way: nearer than that, a run is at the lowest cost


def tau_text(tau: float) -> str:
    """`1e-5`, as it is written."""
    return f"{tau:g}".replace("e-0", "e-")


class TargetOutcome(Enum):
    """What became of a run, by the problem's own numbers."""

    REACHED = "ended at the lowest cost known"
    ALONE = "is the only one that ended, and no cost is known to compare it with"
    OTHER_BASIN = "ended at a stationary point of another basin, where the cost is higher"
    SADDLE = "ended at a saddle point, from which the cost falls along a direction"
    NO_FINITE_MINIMUM = "ended where the cost falls for ever as some unknowns grow without limit"
    INSENSITIVE = "came to where the residual hardly changes with some unknowns"
    FALSE_CLAIM = "claims convergence at a point that is not stationary"
    STALLED = "gave up at a point that is not stationary"
    OUT_OF_BUDGET = "ran out of evaluations, iterations or time"
    NOT_STOPPING = "did not stop in time, and was ended with its process"
    CRASHED = "crashed, which ended its process"
    RAISED = "raised an exception"
    NO_SOLUTION = "returned no solution, or one that is not finite"
    NOT_ALLOWED = "returned a point that bounds or constraints forbid"
    REFUSED = "refused the problem, for example its bounds or constraints"


LIMIT_CLAIMS = {Status.MAX_EVALUATIONS.name, Status.MAX_ITERATIONS.name, Status.MAX_SECONDS.name}
OUTCOME_OF_ENDING = {
    RunEnding.KILLED: TargetOutcome.NOT_STOPPING,
    RunEnding.CRASHED: TargetOutcome.CRASHED,
    RunEnding.RAISED: TargetOutcome.RAISED,
    RunEnding.BROKEN: TargetOutcome.NO_SOLUTION,
    RunEnding.REFUSED: TargetOutcome.REFUSED,
}


@dataclass(frozen=True)
class ReferenceCosts:
    """The two costs by which the runs from one start are measured."""

    start: float  # f_0, the cost at the start
    best: float  # f*, the lowest cost known
    origin: str  # where f* comes from
    alone: bool = False  # whether f* comes from the only run that ended, and no other cost is known

    def target(self, tau: float) -> float:
        """The largest cost that meets the target; NaN where start or best is not finite.

        Rounding is allowed for: 1e-12 of f*, 1e-16 of f_0. A start that constraints forbid may cost
        less than f*. The target is then the largest cost that counts as the lowest one.
        """
        if not (np.isfinite(self.start) and np.isfinite(self.best)):
            return np.nan
        rounding = 1e-12 if self.start >= self.best else AS_GOOD
        slack = max(rounding * abs(self.best), COST_ROUNDING * abs(self.start))
        return self.best + max(tau * (self.start - self.best), slack)

    def reached_at(self, record: Record, tau: float) -> Array | None:
        """The row of the trace (counts, seconds, cost) at which a run met the target, or None."""
        rows = record.observed.trace
        below = np.flatnonzero(rows[:, -1] <= self.target(tau)) if rows.size else np.zeros(0, int)
        return np.asarray(rows[below[0]]) if below.size else None

    def ends_below(self, record: Record, tau: float) -> bool:
        """Whether the end of a run meets the target, even if the run never evaluated that point."""
        return record.at_end and record.cost <= self.target(tau)

    def is_lowest(self, cost: float) -> bool:
        """Whether a cost counts as the lowest one.

        It is at most a millionth above it, or 1e-9 of the decrease from the cost at the start.
        """
        excess = relative_excess(cost, self.best, self.start)
        return excess <= AS_GOOD or cost <= self.target(AT_LOWEST)


def claims(record: Record) -> bool:
    """Whether the solver claims that it converged."""
    return record.claim == Status.CONVERGED.name


def ended_by_clock(record: Record) -> bool:
    """Whether more time might have led the run further, as on a faster machine."""
    out_of_time = record.claim == Status.MAX_SECONDS.name
    cut = record.ending is RunEnding.CUT and record.message == Status.MAX_SECONDS.value
    return out_of_time or cut or record.ending is RunEnding.KILLED


OUTCOME_OF_CLAIM = {  # of ends above the lowest cost: what a solver found out there by evaluations
    Status.NO_FINITE_MINIMUM.name: TargetOutcome.NO_FINITE_MINIMUM,
    Status.INSENSITIVE.name: TargetOutcome.INSENSITIVE,
    Status.SADDLE.name: TargetOutcome.SADDLE,
}


def target_outcome(
    record: Record,
    reference: ReferenceCosts,
    lowest: bool | None,
    tolerance: float,
    at_saddle: bool = False,
) -> TargetOutcome:
    """What became of a run.

    `lowest` says whether its end leads to the lowest cost known; None if that is not known. If the
    end is stationary, `at_saddle` says whether the curvature there is negative. Of an end above the
    lowest cost a solver's own status counts only if it admits a failure.
    """
    if record.ending in OUTCOME_OF_ENDING:
        return OUTCOME_OF_ENDING[record.ending]
    if not record.finite:
        spent = record.ending is RunEnding.CUT or record.claim in LIMIT_CLAIMS
        return TargetOutcome.OUT_OF_BUDGET if spent else TargetOutcome.NO_SOLUTION
    if not record.inside:
        return TargetOutcome.NOT_ALLOWED
    if reference.alone:
        return TargetOutcome.ALONE
    settled = record.optimality <= tolerance
    if (settled and lowest) or (lowest is not False and reference.is_lowest(record.cost)):
        return TargetOutcome.REACHED
    if record.claim in OUTCOME_OF_CLAIM and (settled or record.claim != Status.SADDLE.name):
        return OUTCOME_OF_CLAIM[record.claim]
    if settled:
        return TargetOutcome.SADDLE if at_saddle else TargetOutcome.OTHER_BASIN
    if claims(record):
        return TargetOutcome.FALSE_CLAIM
    if record.ending is RunEnding.CUT or record.claim in LIMIT_CLAIMS:
        return TargetOutcome.OUT_OF_BUDGET
    return TargetOutcome.STALLED
