"""Every run as one row of plain numbers and words, and times as a clock measured them.

Times differ from machine to machine and from one run to the next, and so they are shown
separately, with their spread, and rank no solver.
"""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.comparison.comparison import Comparison
from workbench.comparison.design import Instance
from workbench.comparison.record import KINDS
from workbench.comparison.targets import claims, tau_text
from workbench.writing import replacing


def rows(comparison: Comparison) -> Iterator[dict[str, Any]]:
    """One dict per run, in the order of the design; what is unknown or not finite is empty.

    It has the evaluations and the effort until each target was met.
    """
    for instance in comparison.instances:
        for solver in comparison.solvers:
            yield {k: _plain(v) for k, v in _row(comparison, instance, solver).items()}


def write_csv(comparison: Comparison, path: Path, chosen: Sequence[str] | None = None) -> None:
    """All columns or the chosen ones, whole or not at all. Raises BadFile."""
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        names = chosen or list(next(rows(comparison)))
        writer = csv.DictWriter(file, names, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows(comparison))


def _row(comparison: Comparison, instance: Instance, solver: str) -> dict[str, Any]:
    record = comparison.records[instance.name, solver]
    reference = comparison.references[instance.name]
    budget = comparison.design.budget
    holds = record.optimality <= budget.stationary if claims(record) else None
    basin = comparison.basins.get((instance.name, solver))
    row: dict[str, Any] = {
        "problem": instance.problem,
        "argument": instance.argument,
        "number": instance.number if instance.argument else None,
        "solver": solver,
        "verdict": comparison.outcomes[instance.name, solver].name,
        "ending": record.ending.name,
        "claim": record.claim,
        "claim_holds": holds,
        "cost": record.cost,
        "claimed_cost": record.claimed_cost,
        "lowest_visited": record.lowest,
        "optimality": record.optimality,
        "basin": None if basin is None else basin + 1,
        "best_known_cost": reference.best,
        "start_cost": reference.start,
        "digits": record.digits,
        **dict(zip(KINDS, record.observed.counts, strict=True)),
        "all_counted": not comparison.uncounted(instance.name, solver),
        "not_finite": record.observed.not_finite,
    }
    effort: dict[str, Any] = {}
    seconds: dict[str, Any] = {}
    for tau in comparison.taus:
        reached, until = comparison.reached_at(instance.name, solver, tau), tau_text(tau)
        for k, kind in enumerate(KINDS):
            row[f"{kind} to {until}"] = None if reached is None else int(reached[k])
        effort[f"units to {until}"] = comparison.run_effort(instance, solver, tau)
        seconds[f"seconds to {until}"] = None if reached is None else reached[-2]
    times = {**seconds, "seconds": record.observed.seconds, "machine": record.machine}
    return {**row, **effort, "message": record.message, **times}


def _plain(value: Any) -> Any:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return repr(float(value)) if isinstance(value, float) else value


def seconds_to(
    comparison: Comparison, solver: str, tau: float, problem: str | None = None
) -> Array:
    """(3,) the least, median and most seconds until a target, over the starts from which it was
    met; NaN without any.
    """
    reached = [comparison.reached_at(i.name, solver, tau) for i in comparison.starts(problem)]
    return _spread([row[-2] for row in reached if row is not None])


def seconds_of_runs(comparison: Comparison, solver: str) -> Array:
    """(3,) the same of whole runs, over all starts."""
    runs = (comparison.records[i.name, solver] for i in comparison.instances)
    return _spread([run.observed.seconds for run in runs])


def _spread(seconds: list[float]) -> Array:
    return np.quantile(seconds, [0.0, 0.5, 1.0]) if seconds else np.full(3, np.nan)


def evaluation_seconds(comparison: Comparison, problem: str) -> dict[str, float]:
    """The mean time of one evaluation of each kind over all runs; NaN if none asked for one."""
    runs = [
        comparison.records[i.name, s].observed
        for i in comparison.instances_of(problem)
        for s in comparison.solvers
    ]
    counts = np.sum([run.counts for run in runs], axis=0)
    spent = np.sum([run.spent for run in runs], axis=0)
    return {
        kind: float(s / n) if n and s else np.nan
        for kind, n, s in zip(KINDS, counts, spent, strict=True)
    }


def relative_seconds(comparison: Comparison, problem: str) -> dict[str, float]:
    """The time of one evaluation of each kind over that of a residual, on this machine."""
    seconds = evaluation_seconds(comparison, problem)
    return {kind: s / seconds["residual"] for kind, s in seconds.items()}
