"""Why a run ended at more than the lowest cost: one cause for each end."""

from collections.abc import Mapping
from enum import Enum

from workbench.comparison.end_analysis import ABOVE, EndAnalysis
from workbench.comparison.record import Ending, Record
from workbench.comparison.targets import LIMITS, Yardstick, stationary
from workbench.experiments.relative_costs import relative_excess
from workbench.solvers import Status


class Cause(Enum):
    """Why an end costs more than 1.01 times the lowest cost known.

    SECOND_BASIN and SADDLE are stationary points. NO_FINITE_MINIMUM and INSENSITIVE were
    noticed by the solver itself. In all other cases the solver was stopped on its way, or gave up.
    """

    SECOND_BASIN = "it is another minimum"
    SADDLE = "it is a saddle point: the cost falls along a direction of negative curvature"
    NO_FINITE_MINIMUM = "the cost falls for ever as some unknowns grow without limit"
    INSENSITIVE = "the residual hardly changed with some unknowns"
    LIMIT = "a limit of evaluations, iterations or time ended the run on its way"
    ROUNDING = "rounding of the residual leaves unknowns undetermined there"
    RANK = "the Jacobian has a lower rank there than at the lowest point"
    STOPPED_EARLY = "the solver stopped on its way by a rule of its own"


def cause(
    record: Record, yardstick: Yardstick, ends: EndAnalysis, k: int, tolerance: float
) -> Cause | None:
    """The cause of end number k of an analysis; None if its cost is at most 1.01 times f*.

    The end is stationary if its `Problem.optimality` is within the tolerance.
    """
    excess = relative_excess(record.cost, yardstick.best, yardstick.start)
    if yardstick.alone or not excess > ABOVE - 1:
        return None
    if record.claim == Status.NO_FINITE_MINIMUM.name:
        return Cause.NO_FINITE_MINIMUM
    if stationary(record, tolerance):
        basin = ends.where[k]
        bends = ends.at_saddle(basin) or record.claim == Status.SADDLE.name
        return Cause.SADDLE if bends else Cause.SECOND_BASIN
    if record.claim == Status.INSENSITIVE.name:
        return Cause.INSENSITIVE
    if record.ending is Ending.CUT or record.claim in LIMITS:
        return Cause.LIMIT
    if ends.hidden[k]:
        return Cause.ROUNDING
    return Cause.RANK if ends.lost_ranks[k] else Cause.STOPPED_EARLY


Run = tuple[str, str]  # the names of an instance and a solver


def causes(
    ends: Mapping[Run, tuple[EndAnalysis, int]],
    records: Mapping[Run, Record],
    yardsticks: Mapping[str, Yardstick],
    tolerance: float,
) -> dict[Run, Cause]:
    """The causes of the ends that are not at the lowest cost; see `cause`."""
    found = {}
    for run, (analysis, k) in ends.items():
        why = cause(records[run], yardsticks[run[0]], analysis, k, tolerance)
        if why is not None:
            found[run] = why
    return found
