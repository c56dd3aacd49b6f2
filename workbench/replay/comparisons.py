"""The replay of a comparison: where every solver ended from each start, side by side."""

from collections.abc import Sequence

import numpy as np

from workbench.blocks import Values
from workbench.comparison import Comparison, Record
from workbench.comparison.design import Instance
from workbench.fitting.setup import Setup
from workbench.replay.assembling import recording
from workbench.replay.observations import landmarks_of_views, observed_data, view_data
from workbench.replay.series import Series
from workbench.replay.shown_body import Recording, shown_with_row

STARTS, SOLVERS = 8, 12  # of a problem that are shown
OF_ENDS = (
    "The body where each solver ended, from the same start for all; the grey body is the start. "
)
OF_STARTS = "The slider goes from start to start. "


def recorded_ends(comparison: Comparison, problem: str) -> Recording | None:
    """The ends of all solvers on one problem, from each of its first starts.

    None if no body is fitted, or one that a page cannot pose, and for a problem that cannot be
    built here.
    """
    instances = comparison.instances_of(problem)[:STARTS]
    solvers = comparison.solvers[:SOLVERS]
    try:
        setups = [one.experiment.setup() for one in instances]
    except Exception:  # a file of the user, which ran in other processes before
        return None
    first = setups[0]
    found = shown_with_row(first.body, first.problem, first.start)
    if found is None:
        return None
    shown, row = found
    missing = np.full(row(first.start).size, np.nan)
    rows = []
    for instance, setup in zip(instances, setups, strict=True):
        ends = [_end(comparison.records[instance.name, solver], setup) for solver in solvers]
        rows.append([row(setup.start), *(missing if end is None else row(end) for end in ends)])
    series = Series(
        "ends",
        [_label(one) for one in instances],
        [_said(comparison, one, solvers) for one in instances],
        rows=np.array(rows),
        columns=("start", *solvers),
    )
    alike = all(_same_views(one, first) for one in setups)
    landmarks = landmarks_of_views(shown.body, first.views if alike else ())
    seen = [view_data(v, first.start) for v in first.views] if landmarks["names"] else []
    observed = [observed_data(s.problem, s.problem.read(s.start), shown.body) for s in setups]
    return recording(
        shown,
        row(first.start),
        (OF_ENDS + (OF_STARTS if len(instances) > 1 else "")).rstrip(),
        series=[series],
        landmarks=landmarks,
        views=seen,
        observed=observed[0] if all(one == observed[0] for one in observed) else None,
    )


def _end(record: Record, setup: Setup) -> Values | None:
    """The values where a run ended; None if it ended at no point of this problem."""
    free = setup.problem.free
    if not record.finite or record.end.size != free.size:
        return None
    return dict(setup.start) | free.unpack(record.end, setup.start)


def _same_views(one: Setup, other: Setup) -> bool:
    """Whether the cameras observed the same, from every start."""
    return len(one.views) == len(other.views) and all(
        np.array_equal(a.observed, b.observed) for a, b in zip(one.views, other.views, strict=True)
    )


def _label(instance: Instance) -> str:
    return f"{instance.argument} {instance.number}" if instance.argument else instance.problem


def _said(comparison: Comparison, instance: Instance, solvers: Sequence[str]) -> str:
    """The costs at which the runs from one start ended."""
    known = comparison.references[instance.name]
    told = []
    for solver in solvers:
        record = comparison.records[instance.name, solver]
        told.append(f"{solver} {record.cost:.4g}" if record.finite else f"{solver} at no point")
    lowest = f" The lowest cost known is {known.best:.4g}." if np.isfinite(known.best) else ""
    begun = f"From {_label(instance)} the runs" if instance.argument else "The runs"
    return f"{begun} ended at these costs: {', '.join(told)}.{lowest}"
