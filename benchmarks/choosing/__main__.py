"""`python -m benchmarks.choosing`: solvers on problems of each temperament, and the page of it.

Each temperament is one comparison, as `workbench compare` makes it: the same starts and limits for
all, success by targets on the cost, effort in evaluations of the residual at published prices.
Finished runs are stored in a folder, so that an interrupted run continues where it stopped.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.choosing import page
from benchmarks.choosing.temperaments import TEMPERAMENTS, Temperament
from benchmarks.keeping import keep
from workbench.comparison import Budget, Comparison, compare
from workbench.comparison.record import KINDS

HERE = Path(__file__).parent.parent
KEPT = "choosing.json"
DIGITS = 6
BUDGET = Budget(max_seconds=20.0)
WITHOUT = "no derivatives"  # a gradient costs n + 1 residuals there, by finite differences


def main() -> None:
    """Measure what is asked for, keep it, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.choosing", description=__doc__)
    parser.add_argument("temperament", nargs="*", help=f"of {', '.join(TEMPERAMENTS)}; or page")
    parser.add_argument("--out", type=Path, default=HERE, help="where results/ and SOLVERS.md are")
    parser.add_argument("--runs", type=Path, default=Path("runs") / "choosing")
    asked = parser.parse_args()
    kept = asked.out / "results" / KEPT
    found = page.read(kept) if kept.exists() else {"found": {}}
    for name in asked.temperament or TEMPERAMENTS:
        if name == "page":
            continue
        one = TEMPERAMENTS[name]
        comparison = compare(
            one.problems,
            one.solvers,
            seeds=one.seeds,
            budget=BUDGET,
            folder=asked.runs / name.replace(" ", "-"),
            progress=lambda what, done, of, name=name: print(f"{name}: {what} {done}/{of}"),
        )
        found["found"][name] = of_comparison(one, comparison) | {"machine": machine.description()}
        keep(kept, found, DIGITS)
    page.write(asked.out / "SOLVERS.md", found)


def of_comparison(one: Temperament, comparison: Comparison) -> dict[str, Any]:
    """By solver: starts solved, all starts, and the median effort, null where most are unsolved."""
    starts = comparison.starts()
    rows = {}
    for solver in comparison.solvers:
        solved = [comparison.solved(i.name, solver, one.tau) for i in starts]
        median = float(np.median(efforts(one, comparison, solver)))
        rows[solver] = {
            "solved": int(sum(solved)),
            "starts": len(starts),
            "effort": median if np.isfinite(median) else None,
        }
    return {
        "meaning": one.meaning,
        "problems": [e.name for e in one.problems],
        "seeds": one.seeds,
        "tau": one.tau,
        "unbuilt": dict(comparison.unbuilt),
        "solvers": rows,
    }


def efforts(one: Temperament, comparison: Comparison, solver: str) -> Sequence[float]:
    """Evaluations of the residual until the target, by start; infinite where it was not met."""
    if one.name != WITHOUT:
        needed = comparison.needed(one.tau)[:, comparison.solvers.index(solver)]
        return [float(x) for x in np.where(np.isnan(needed), np.inf, needed)]
    found = []
    for instance in comparison.starts():
        counts = comparison.reached_at(instance.name, solver, one.tau)
        n = comparison.unknowns[instance.problem]
        by_differences = dict.fromkeys(KINDS, 1.0) | {"gradient": n + 1.0, "jacobian": n + 1.0}
        prices = np.array([by_differences[kind] for kind in KINDS])
        found.append(np.inf if counts is None else float(counts[: len(KINDS)] @ prices))
    return found


if __name__ == "__main__":
    main()
