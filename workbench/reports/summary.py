"""A run in one small file that programs read."""

import json
import math
import platform
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from workbench.diagnostics import Diagnosis
from workbench.experiments.running import Outcome
from workbench.installation import DISTRIBUTION, version_of
from workbench.reports.folder import MAKER
from workbench.solvers import Solution

PACKAGES = (DISTRIBUTION, "casadi", "numpy", "scipy", "nlopt", "emcee", "matplotlib")


def run_summary(outcome: Outcome, files: Iterable[str]) -> dict[str, Any]:
    """How a run ended, what it measured, and what it ran on."""
    alone, priors = outcome.data_alone, list(outcome.setup.priors)
    return {
        "made_by": MAKER,
        "kind": "run",
        "name": outcome.name,
        "source": outcome.source,
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
        "versions": versions(),
        "files": sorted(files),
    }


def versions() -> dict[str, str | None]:
    """Of Python and of what computes; None for what is not installed."""
    return {"python": platform.python_version()} | {name: version_of(name) for name in PACKAGES}


def as_json(summary: dict[str, Any]) -> str:
    """JSON as every reader takes it: null where a number is not finite."""
    return json.dumps(_finite(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


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


def _finite(thing: Any) -> Any:
    if isinstance(thing, dict):
        return {str(key): _finite(value) for key, value in thing.items()}
    if isinstance(thing, (list, tuple)):
        return [_finite(value) for value in thing]
    if isinstance(thing, float):  # NumPy's float64 is one
        return float(thing) if math.isfinite(thing) else None
    return thing
