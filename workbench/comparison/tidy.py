"""Every run as one row of plain numbers and words."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench.comparison.comparison import Comparison
from workbench.comparison.design import Instance
from workbench.comparison.log import KINDS
from workbench.comparison.targets import claims, named, stationary
from workbench.writing import replacing

RUN = (
    "problem",
    "argument",
    "number",
    "solver",
    "verdict",
    "cause",
    "ending",
    "claim",
    "claim_holds",
    "cost",
    "claimed_cost",
    "lowest_visited",
    "optimality",
    "basin",
    "best_known_cost",
    "start_cost",
    "digits",
    *KINDS,
    "all_counted",
    "not_finite",
)
MEASURED = ("seconds", "machine")  # not the same on another machine, or a second time


def columns(comparison: Comparison) -> tuple[str, ...]:
    """The columns of the table, with the evaluations and the effort until each target was met."""
    until = [f"{what} to {named(tau)}" for tau in comparison.taus for what in (*KINDS,)]
    effort = [f"units to {named(tau)}" for tau in comparison.taus]
    seconds = [f"seconds to {named(tau)}" for tau in comparison.taus]
    return (*RUN, *until, *effort, "message", *seconds, *MEASURED)


def deterministic(comparison: Comparison) -> tuple[str, ...]:
    """The columns that a repetition gives again: all but those with times."""
    return tuple(c for c in columns(comparison) if not c.startswith(("seconds", "machine")))


def rows(comparison: Comparison) -> Iterator[dict[str, Any]]:
    """One dict per run, in the order of the design; what is unknown or not finite is empty."""
    for instance in comparison.instances:
        for solver in comparison.solvers:
            yield {k: _plain(v) for k, v in _row(comparison, instance, solver).items()}


def write_csv(comparison: Comparison, path: Path, chosen: Sequence[str] | None = None) -> None:
    """All columns or the chosen ones, whole or not at all. Raises BadFile."""
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        names = tuple(chosen or columns(comparison))
        writer = csv.DictWriter(file, names, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows(comparison))


def _row(comparison: Comparison, instance: Instance, solver: str) -> dict[str, Any]:
    record = comparison.records[instance.name, solver]
    yardstick = comparison.yardsticks[instance.name]
    holds = stationary(record, comparison.design.budget.stationary) if claims(record) else None
    basin = comparison.basins.get((instance.name, solver))
    cause = comparison.causes.get((instance.name, solver))
    found: dict[str, Any] = {
        "problem": instance.problem,
        "argument": instance.argument,
        "number": instance.number if instance.argument else None,
        "solver": solver,
        "verdict": comparison.outcomes[instance.name, solver].name,
        "cause": None if cause is None else cause.name,
        "ending": record.ending.name,
        "claim": record.claim,
        "claim_holds": holds,
        "cost": record.cost,
        "claimed_cost": record.claimed_cost,
        "lowest_visited": record.lowest,
        "optimality": record.optimality,
        "basin": None if basin is None else basin + 1,
        "best_known_cost": yardstick.best,
        "start_cost": yardstick.start,
        "digits": record.digits,
        "not_finite": record.observed.not_finite,
        "message": record.message,
        "seconds": record.observed.seconds,
        "machine": record.machine,
    }
    found |= dict(zip(KINDS, record.observed.counts, strict=True))
    found["all_counted"] = not comparison.uncounted(instance.name, solver)
    for tau in comparison.taus:
        met = comparison.met(instance.name, solver, tau)
        if met is not None:
            found |= {
                f"{kind} to {named(tau)}": int(n) for kind, n in zip(KINDS, met, strict=False)
            }
            found[f"seconds to {named(tau)}"] = met[-2]
            if not comparison.uncounted(instance.name, solver, tau):
                effort = comparison.units(instance.problem, met[: len(KINDS)])
                found[f"units to {named(tau)}"] = float(effort)
    return found


def _plain(value: Any) -> Any:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return repr(float(value)) if isinstance(value, float) else value
