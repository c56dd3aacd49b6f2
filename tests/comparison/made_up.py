"""Comparisons made by hand: runs whose costs and counts are written down here."""

import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from tests.comparison.problems import slide
from workbench.comparison import Budget, Comparison, Record, RunEnding, worker
from workbench.comparison.design import Design, Instance, NamedSolver
from workbench.comparison.ends import EndAnalysis
from workbench.comparison.record import KINDS, ROW, Description, ObservedRun, Stored
from workbench.comparison.tables import rows
from workbench.comparison.workers import JobFailed, Solve, SolverJob
from workbench.errors import UnknownName, WorkbenchError
from workbench.experiments import Experiment
from workbench.solvers import LevenbergMarquardt

NOTHING = np.zeros(0)


def record(
    instance: str,
    solver: str,
    costs: Sequence[float],
    *,
    ending: RunEnding = RunEnding.RETURNED,
    claim: str = "CONVERGED",
    optimality: float = 0.0,
    every: int = 1,
    taken: bool = False,
) -> Record:
    """A run that found `costs`, one after the other, each after `every` residuals more."""
    others = (0,) * (len(KINDS) - 1)
    rows = [(every * (k + 1), *others, 0.1 * (k + 1), c) for k, c in enumerate(costs)]
    trace = np.array([row for row in rows if np.isfinite(row[-1])], dtype=float).reshape(-1, ROW)
    counts = every * len(costs), *others
    seen = ObservedRun(counts, (0.0,) * len(KINDS), 0, 0.1 * len(costs), np.zeros(1), trace, taken)
    end = costs[-1] if costs and ending is RunEnding.RETURNED else np.nan
    return Record(
        solver,
        instance,
        ending,
        "",
        seen,
        "a machine",
        claim,
        end,
        end,
        optimality,
        end=np.zeros(1) if np.isfinite(end) else NOTHING,
    )


def comparison(
    runs: Mapping[tuple[str, str], Sequence[float]],
    *,
    start: float = 100.0,
    basins: Mapping[tuple[str, str], int] | None = None,
    known: bool = False,
    **changed: Record,
) -> Comparison:
    """From the costs that each solver visited on each problem; every problem starts at `start`.

    A solver that visited nothing raised an exception. Only residuals are asked for, whose price is
    1; n is 1. "p, start 1" is another start of problem p. If `known`, the known cost is 0.
    """
    problems = list(dict.fromkeys(problem for problem, _ in runs))
    solvers = list(dict.fromkeys(solver for _, solver in runs))
    instances = tuple(_instance(p) for p in problems)
    records = {
        (p, s): record(p, s, costs, ending=RunEnding.RETURNED if len(costs) else RunEnding.RAISED)
        for (p, s), costs in runs.items()
    } | {(r.instance, r.solver): r for r in changed.values()}
    judged = []
    for p in problems:
        ended = [records[p, s] for s in solvers if records[p, s].finite]
        where = tuple((basins or {}).get((p, r.solver), 0) for r in ended)
        count = 1 + max(where, default=-1)
        costs = tuple(
            min((r.cost for r, w in zip(ended, where, strict=True) if w == k), default=0.0)
            for k in range(count)
        )
        points = np.zeros((count, 1))
        judged.append(EndAnalysis(where, costs, (0.0,) * count, (False,) * count, points))
    described = {
        p: Description(
            p, 1, 1, False, start, 0.0 if known else np.nan, "known" if known else "", "made up"
        )
        for p in problems
    }
    named_solvers = tuple(NamedSolver(s, LevenbergMarquardt()) for s in solvers)
    design = Design(instances, named_solvers, Budget(), 1)
    groups = tuple((p,) for p in problems)
    return Comparison(design, instances, {}, described, records, groups, tuple(judged))


def _instance(name: str) -> Instance:
    problem, _, number = name.partition(", start ")
    made = Experiment(problem, slide, "made up")
    if not number:
        return Instance(problem, made, "", 0, 0)
    return Instance(problem, made, "start", int(number), int(number))


def deterministic(compared: Comparison) -> tuple[str, ...]:
    """The columns of a table that a repetition gives again: all but those with times."""
    return tuple(c for c in next(rows(compared)) if not c.startswith(("seconds", "machine")))


@contextmanager
def in_this_process() -> Iterator[None]:
    """Comparisons in this context start no worker processes, which take seconds to import."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.modules["workbench.comparison.compare"], "answered", answered_here)
        yield


def answered_here(job: SolverJob, comparison: str) -> Stored | JobFailed:
    """What a worker process would answer."""
    with tempfile.TemporaryDirectory() as folder:
        if isinstance(job, Solve):
            job = replace(job, log=f"{folder}/log")
        try:
            return worker._answered(job, job.open_experiment().setup(), lambda *_: None)
        except WorkbenchError as error:
            return JobFailed(str(error), isinstance(error, UnknownName))
