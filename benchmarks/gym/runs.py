"""Solvers on cases: each run is judged and kept on a line of its own as soon as it has ended."""

import json
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from benchmarks.gym.case import Case
from benchmarks.gym.cases import CASES
from benchmarks.gym.success import counts_until, effort_until, is_solved, target
from workbench.comparison import Budget
from workbench.comparison.targets import claims, stationary
from workbench.comparison.worker import run_solver
from workbench.comparison.workers import Solve

BUDGET = Budget(max_evaluations=2_000, max_seconds=30.0)


@dataclass(frozen=True)
class Kept:
    """One run.

    Attributes:
        case: the name of the case.
        solver: the name of the solver.
        solved: whether it ended at a solution; see `success`.
        evaluations: all kinds of them together until the target, or of the whole run if unsolved.
        effort: the same at published prices, in evaluations of the residual.
        claimed: whether the solver says that it converged.
        stationary: whether its end is stationary, as the problem judges it.
        gap: (f - f*) / f_0 at its end; null without an end.
        digits: of certified parameters; null without these.
        said: the status that it returned, or how the run was ended.
    """

    case: str
    solver: str
    solved: bool
    evaluations: float
    effort: float
    claimed: bool
    stationary: bool
    gap: float | None
    digits: float | None
    said: str


def least_starts(cases: Iterable[Case]) -> dict[str, float]:
    """By problem the least cost at any of its starts."""
    found: dict[str, float] = {}
    for one in cases:
        setup = one.experiment.setup()
        cost = setup.problem.linearize(setup.start).cost
        found[one.problem] = min(found.get(one.problem, np.inf), cost)
    return found


def run(
    cases: Sequence[Case],
    solvers: Mapping[str, Any],
    file: Path,
    workers: int = 1,
    budget: Budget = BUDGET,
    progress: Callable[[str], object] = lambda line: None,
) -> list[Kept]:
    """Every case by every solver; runs that the file already holds are not repeated."""
    there = {(kept.case, kept.solver): kept for kept in read(file)} if file.exists() else {}
    missing = [
        (one, left)
        for one in cases
        if (left := {n: s for n, s in solvers.items() if (one.name, n) not in there})
    ]
    begun = dict.fromkeys(one.problem for one, _ in missing)
    least = least_starts(one for one in CASES if one.problem in begun)
    jobs = [delayed(_of_case)(one, left, least[one.problem], budget) for one, left in missing]
    file.parent.mkdir(parents=True, exist_ok=True)
    parallel = Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)
    for done, found in enumerate(parallel(jobs), 1):
        with file.open("a", encoding="utf-8") as lines:
            for kept in found:
                lines.write(json.dumps(asdict(kept)) + "\n")
                there[kept.case, kept.solver] = kept
        progress(f"{done} of {len(jobs)}: {found[0].case}")
    return [there[one.name, solver] for one in cases for solver in solvers]


def read(file: Path) -> Iterator[Kept]:
    """The runs that a file holds."""
    for line in file.read_text(encoding="utf-8").splitlines():
        yield Kept(**json.loads(line))


def _of_case(
    one: Case, solvers: Mapping[str, Any], least_start: float, budget: Budget
) -> list[Kept]:
    setup = one.experiment.setup()
    assert setup.known is not None
    assert setup.known.cost is not None
    enough = target(setup.known.cost, least_start)
    n = setup.problem.free.size
    found = []
    for name, solver in solvers.items():
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            record = run_solver(
                Solve(
                    key="",
                    open_experiment=lambda: one.experiment,  # whose setup is here already
                    solver=name,
                    open_solver=lambda solver=solver: solver,  # type: ignore[misc]
                    instance=one.name,
                    budget=budget,
                    log=str(Path(folder) / "log"),
                ),
                setup,
                lambda phase, seconds: None,
            )
        solved = is_solved(record, enough, setup.known)
        below = enough if solved else -np.inf
        found.append(
            Kept(
                one.name,
                name,
                solved,
                float(counts_until(record, below).sum()),
                effort_until(record, below, n),
                claims(record),
                bool(stationary(record, budget.stationary)),
                (record.cost - setup.known.cost) / least_start if record.finite else None,
                record.digits if np.isfinite(record.digits) else None,
                record.claim or record.ending.name,
            )
        )
    return found
