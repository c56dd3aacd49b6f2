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


def columns(comparison: Comparison) -> tuple[str, ...]:
    """The columns of the table, with the evaluations and the effort until each target was met."""
    return tuple(next(rows(comparison)))


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
        **dict(zip(KINDS, record.observed.counts, strict=True)),
        "all_counted": not comparison.uncounted(instance.name, solver),
        "not_finite": record.observed.not_finite,
    }
    effort: dict[str, Any] = {}
    seconds: dict[str, Any] = {}
    for tau in comparison.taus:
        row, until = comparison.met(instance.name, solver, tau), named(tau)
        counts = None if row is None else row[: len(KINDS)]
        if counts is None or comparison.uncounted(instance.name, solver, tau):
            effort[f"units to {until}"] = None
        else:
            effort[f"units to {until}"] = float(comparison.units(instance.problem, counts))
        for k, kind in enumerate(KINDS):
            found[f"{kind} to {until}"] = None if row is None else int(row[k])
        seconds[f"seconds to {until}"] = None if row is None else row[-2]
    times = {**seconds, "seconds": record.observed.seconds, "machine": record.machine}
    return {**found, **effort, "message": record.message, **times}


def _plain(value: Any) -> Any:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return repr(float(value)) if isinstance(value, float) else value
