"""Comparisons made by hand: runs whose costs and counts are written down here."""

from collections.abc import Mapping, Sequence

import numpy as np

from tests.comparison.problems import slide
from workbench.comparison import Budget, Comparison, Ending, Record
from workbench.comparison.description import Description
from workbench.comparison.entrants import Entrant
from workbench.comparison.judgement import Judgement
from workbench.comparison.plan import Instance, Plan
from workbench.comparison.watch import Seen
from workbench.experiments import Experiment
from workbench.solvers import Evaluations, LevenbergMarquardt

NOTHING = np.zeros(0)


def record(
    instance: str,
    solver: str,
    costs: Sequence[float],
    *,
    ending: Ending = Ending.RETURNED,
    claim: str = "CONVERGED",
    optimality: float = 0.0,
    every: int = 1,
) -> Record:
    """A run that found `costs`, one after the other, each after `every` residuals more."""
    rows = [(every * (k + 1), 0, 0, 0, 0.1 * (k + 1), c) for k, c in enumerate(costs)]
    found = np.array([row for row in rows if np.isfinite(row[-1])], dtype=float).reshape(-1, 6)
    counts = Evaluations(residual=every * len(costs))
    seen = Seen(counts, (0.0,) * 4, 0, 0.1 * len(costs), np.zeros(1), found)
    end = costs[-1] if costs and ending is Ending.RETURNED else np.nan
    return Record(
        solver, instance, ending, "", claim, end, end, optimality, np.nan, True,
        np.zeros(1) if np.isfinite(end) else NOTHING, seen, "a machine",
    )  # fmt: skip


def comparison(
    runs: Mapping[tuple[str, str], Sequence[float]],
    *,
    start: float = 100.0,
    basins: Mapping[tuple[str, str], int] | None = None,
    **changed: Record,
) -> Comparison:
    """From the costs that each solver visited on each problem; every problem starts at `start`.

    A solver that visited nothing raised an exception. Prices are all 1; n is 1.
    """
    problems = list(dict.fromkeys(problem for problem, _ in runs))
    solvers = list(dict.fromkeys(solver for _, solver in runs))
    instances = tuple(Instance(p, Experiment(p, slide, "made up"), "", 0, 0) for p in problems)
    records = {
        (p, s): record(p, s, costs, ending=Ending.RETURNED if len(costs) else Ending.RAISED)
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
        judged.append(Judgement(where, costs, (0.0,) * count, np.zeros((count, 1)), {}))
    seconds = {"residual": 1.0, "gradient": 1.0, "jacobian": 1.0}
    described = {
        p: Description(
            p, 1, 1, False, np.zeros(1), start, NOTHING, seconds, np.nan, "", False, "made up"
        )
        for p in problems
    }  # fmt: skip
    entrants = tuple(Entrant(s, LevenbergMarquardt()) for s in solvers)
    plan = Plan(instances, entrants, Budget(), 1)
    groups = tuple((p,) for p in problems)
    return Comparison(plan, instances, {}, described, records, groups, tuple(judged))
