"""When a run has solved a case.

A run has solved a case if it ends at a point that costs at most

    (1 + 1e-6) f* + 1e-12 f_0,

where f* is the cost of the known answer and f_0 the least cost at any start of the problem: a
start that is a hundred times farther away makes a problem no easier. Where NIST certified the
parameters, each of them must agree to four digits as well (McCullough, The American Statistician
52, 1998). What a solver says of itself is not asked.
"""

import numpy as np

from workbench.comparison.record import KINDS, Record
from workbench.comparison.targets import units
from workbench.fitting.setup import KnownAnswer

RELATIVE = 1e-6
SHARE = 1e-12
DIGITS = 4


def target(known: float, least_start: float) -> float:
    """The highest cost of a solution, for the known cost and the least cost at any start."""
    return (1 + RELATIVE) * known + SHARE * least_start


def is_solved(record: Record, enough: float, known: KnownAnswer) -> bool:
    """Whether a run ended at a solution; `enough` is the target.

    Parameters are certified where their standard deviations are known too.
    """
    agrees = known.deviations is None or record.digits >= DIGITS
    return record.finite and record.inside and record.cost <= enough and agrees


def counts_until(record: Record, enough: float) -> np.ndarray:
    """(kinds,) how often each kind was evaluated when a cost first was low enough.

    Where no such point was seen by the counter, all evaluations of the run.
    """
    rows = record.observed.trace
    below = np.flatnonzero(rows[:, -1] <= enough) if rows.size else np.zeros(0, int)
    row = rows[below[0], : len(KINDS)] if below.size else record.observed.counts
    return np.asarray(row, dtype=float)


def effort_until(record: Record, enough: float, unknowns: int) -> float:
    """Evaluations until then at the prices of `workbench.comparison.targets`, in residuals."""
    return float(units(counts_until(record, enough), unknowns))
