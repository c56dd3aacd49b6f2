"""A run in one small file that programs read."""

from dataclasses import asdict
from typing import Any

from workbench.diagnostics import Diagnosis
from workbench.experiments.running import Outcome
from workbench.solvers import Solution


def run_summary(outcome: Outcome) -> dict[str, Any]:
    """How a run ended, its measures, and the machine on which it ran."""
    alone, priors = outcome.data_alone, list(outcome.setup.priors)
    return {
        "kind": "run",
        "name": outcome.name,
        "synthetic": outcome.setup.synthetic,
        "notes": list(outcome.setup.notes),
        **_ending(outcome.solution),
        "solver": outcome.solver,
        "better": outcome.better,
        "best_cost": outcome.best_cost,
        **_seen(outcome.diagnosis),
        "data_alone": None if alone is None else {"without": priors, **_seen(alone)},
        "costs": dict(outcome.costs),
        "priors": priors,
        "measures": [asdict(measure) for measure in outcome.measures],
        "compared": {
            name: _ending(solution) | {"excess": outcome.excess(name)}
            for name, solution in outcome.compared.items()
        },
        "interrupted": outcome.interrupted,
        "skipped": list(outcome.skipped),
    }


def _seen(diagnosis: Diagnosis) -> dict[str, int]:
    rows, unknowns = diagnosis.shape
    return {"rows": rows, "unknowns": unknowns, "rank": diagnosis.rank}


def _ending(solution: Solution) -> dict[str, Any]:
    return {
        "status": solution.status.name,
        "message": solution.message,
        "cost": solution.cost,
        "optimality": solution.optimality,
        "iterations": solution.iterations,
        "evaluations": asdict(solution.evaluations),
        "seconds": solution.seconds,
    }
