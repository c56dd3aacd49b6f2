"""Times of a comparison as a clock measured them. They differ from machine to machine and from one
run to the next, and so they are shown separately, with their spread, and rank no solver.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.comparison.comparison import Comparison
from workbench.comparison.log import KINDS

TIMED = 3  # kinds of evaluations that are timed at the start: residual, gradient and Jacobian


@dataclass(frozen=True)
class Timing:
    """The smallest, the median and the largest of several times in seconds; NaN without any."""

    minimum: float
    median: float
    maximum: float

    @staticmethod
    def of(seconds: ArrayLike) -> "Timing":
        """The timing of any number of seconds."""
        s = np.asarray(seconds, dtype=float)
        if not s.size:
            return Timing(np.nan, np.nan, np.nan)
        return Timing(float(s.min()), float(np.median(s)), float(s.max()))


def seconds_to(
    comparison: Comparison, solver: str, tau: float, problem: str | None = None
) -> Timing:
    """The seconds until a target was met, over the starts from which a run met it."""
    chosen = comparison.starts(problem)
    rows = [comparison.met(i.name, solver, tau) for i in chosen]
    return Timing.of([row[-2] for row in rows if row is not None])


def seconds_of_runs(comparison: Comparison, solver: str) -> Timing:
    """The time of whole runs, over all starts."""
    return Timing.of(
        [comparison.records[i.name, solver].observed.seconds for i in comparison.instances]
    )


def ratios(comparison: Comparison, problem: str) -> dict[str, float]:
    """The time of one evaluation of each kind over that of a residual, on this machine.

    Hessians and constraints are timed over all runs that asked for one; NaN if none did.
    """
    chosen = comparison.of(problem)
    seconds = [comparison.described[i.name].seconds for i in chosen]
    residual = float(np.median([s["residual"] for s in seconds]))
    found = {
        kind: float(np.median([s[kind] / s["residual"] for s in seconds])) for kind in KINDS[:TIMED]
    }
    seen = [comparison.records[i.name, s].observed for i in chosen for s in comparison.solvers]
    for k, kind in list(enumerate(KINDS))[TIMED:]:
        count, spent = sum(s.counts[k] for s in seen), sum(s.spent[k] for s in seen)
        found[kind] = spent / count / residual if count and spent else np.nan
    return found
