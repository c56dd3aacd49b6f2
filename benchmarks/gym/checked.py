"""`python -m benchmarks.gym --ends`: ends of solvers that are called converged, judged again.

The runs are drawn from all pairs of a case for tuning and a solver that takes it, by the hash of
their names, so that the same number of runs is always the same runs. Each is judged by `verdicts`,
which computes no derivative as the solver did. A line is written for every run as soon as its case
is done, and runs that the file already holds are not repeated.
"""

import csv
import hashlib
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from benchmarks.gym.case import Case
from benchmarks.gym.verdicts import KINDS, judge
from workbench.comparison import Budget
from workbench.errors import NotSupported
from workbench.fitting.setup import Setup
from workbench.problem import Problem
from workbench.solvers import Status
from workbench.solvers.abilities import refuse
from workbench.threads import limited_threads

BUDGET = Budget(max_evaluations=2_000, max_seconds=10.0, gradient_tolerance=1e-6)
RUNS = 2_000
JUDGE = ("arithmetic", "high_precision", "verdicts", "checked")  # modules beside this one
BROKEN, UNJUDGED = "BROKEN", "not judged"


@dataclass(frozen=True)
class End:
    """A run and what was found of its end.

    Attributes:
        case: the name of the case.
        family: the family of the case.
        solver: the name of the solver.
        status: the status that the solver returned, or `BROKEN` if it raised.
        cost: the cost at the end.
        optimality: `Problem.optimality` there, as the solver says.
        arithmetic: in which the end was judged; empty if it is not called converged.
        cosine: as in `Verdict`, and so are the next fields.
        unexplained: the cosine, less what rounding explains.
        lost: the labels of lost unknowns.
        curvature: the least over the largest one.
        fall: by how much the cost is lower beside a saddle, as a share of it.
        violations: their kinds, separated by spaces.
        message: what the solver says of its end beyond its status.
    """

    case: str
    family: str
    solver: str
    status: str
    cost: str
    optimality: str
    arithmetic: str = ""
    cosine: str = ""
    unexplained: str = ""
    lost: str = ""
    curvature: str = ""
    fall: str = ""
    violations: str = ""
    message: str = ""


COLUMNS = tuple(field.name for field in fields(End))


def version() -> str:
    """A hash of what runs and judges, so that no verdict of an earlier judge is kept."""
    files = (Path(__file__).with_name(f"{name}.py") for name in JUDGE)
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:8]


def draw(cases: Sequence[Case], solvers: Mapping[str, Any], runs: int) -> dict[str, list[str]]:
    """By the name of a case the solvers that run on it, `runs` pairs together or all there are."""
    pairs = []
    for one in cases:
        problem = one.experiment.setup().problem
        pairs += [(one.name, n) for n, solver in solvers.items() if _takes(n, solver, problem)]
    chosen = set(sorted(pairs, key=_drawn)[:runs])
    found: dict[str, list[str]] = {}
    for case, solver in pairs:
        if (case, solver) in chosen:
            found.setdefault(case, []).append(solver)
    return found


def check(
    cases: Sequence[Case],
    solvers: Mapping[str, Any],
    file: Path,
    runs: int = RUNS,
    workers: int = 1,
    budget: Budget = BUDGET,
    progress: Callable[[str], object] = lambda line: None,
) -> list[End]:
    """The ends of the runs that are drawn, in the order of the cases and the solvers."""
    drawn = draw(cases, solvers, runs)
    there = {(end.case, end.solver): end for end in read(file)} if file.exists() else {}
    jobs = [
        delayed(_of_case)(one, {name: solvers[name] for name in left}, budget)
        for one in cases
        if (left := [n for n in drawn.get(one.name, ()) if (one.name, n) not in there])
    ]
    parallel = Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)
    for done, found in enumerate(parallel(jobs), 1):
        there |= {(end.case, end.solver): end for end in found}
        _append(file, found)
        progress(f"{done} of {len(jobs)}: {found[0].case}")
    return [there[one.name, name] for one in cases for name in drawn.get(one.name, ())]


def read(file: Path) -> Iterator[End]:
    """The ends that a file holds."""
    with file.open(newline="", encoding="utf-8") as lines:
        for row in csv.DictReader(lines):
            yield End(**row)


def write(file: Path, ends: Sequence[End]) -> None:
    """All ends in a new file."""
    file.unlink(missing_ok=True)
    _append(file, ends)


def lines(ends: Sequence[End], shown: int = 60) -> Iterator[str]:
    """The table in Markdown: ends by status and solver, then the violations one by one."""
    claimed = [end for end in ends if end.status == Status.CONVERGED.name]
    violating = [end for end in claimed if end.violations]
    kinds = Counter(kind for end in violating for kind in end.violations.split())
    in_doubles = sum(end.arithmetic == "doubles" for end in claimed)
    unjudged = sum(end.arithmetic == UNJUDGED for end in claimed)
    yield (
        f"{len(ends):,} runs, of which {len(claimed):,} end as CONVERGED; {len(violating)} of "
        f"these ends {'is' if len(violating) == 1 else 'are'} not what CONVERGED claims. Of the "
        f"{len(claimed):,}, {in_doubles} (those of bodies) were judged by differences in double "
        f"precision, and {unjudged} could not be judged.\n"
    )
    shallow = [end for end in claimed if not end.violations and float(end.fall or 0) > 0]
    if shallow:
        told = ", ".join(f"{end.solver} on {end.case}, by {end.fall} of it" for end in shallow)
        at = "One of them lies" if len(shallow) == 1 else f"{len(shallow)} of them lie"
        yield (
            f"{at} at a saddle all the same: the cost falls to both sides, but by no more than 10 "
            f"times the square of the tolerance, which CONVERGED does not exclude ({told}).\n"
        )
    statuses = [name for name, _ in Counter(end.status for end in ends).most_common()]
    yield "| solver | runs | " + " | ".join([*statuses, *KINDS]) + " |"
    yield "| --- |" + " --: |" * (1 + len(statuses) + len(KINDS))
    for solver in sorted({end.solver for end in ends}):
        of = [end for end in ends if end.solver == solver]
        yield _row(solver, of, statuses)
    yield _row("all", ends, statuses)
    if violating:
        yield "\n| kind | case | solver | cosine | curvature | fall | lost |"
        yield "| --- | --- | --- | --: | --: | --: | --- |"
        for end in sorted(violating, key=lambda end: (end.violations, end.case))[:shown]:
            yield (
                f"| {end.violations} | {end.case} | {end.solver} | {end.unexplained} | "
                f"{end.curvature} | {end.fall} | {end.lost} |"
            )
        if len(violating) > shown:
            yield f"\nand {len(violating) - shown} more: {dict(kinds)}"


def _row(name: str, ends: Sequence[End], statuses: Sequence[str]) -> str:
    by = Counter(end.status for end in ends)
    kinds = Counter(kind for end in ends for kind in end.violations.split())
    counts = [len(ends), *(by[one] for one in statuses), *(kinds[one] for one in KINDS)]
    return f"| {name} | " + " | ".join(map(str, counts)) + " |"


def _takes(name: str, solver: Any, problem: Problem) -> bool:
    try:
        refuse(name, solver.abilities, problem)
    except NotSupported:
        return False
    return True


def _drawn(pair: tuple[str, str]) -> bytes:
    return hashlib.sha256("\n".join(pair).encode()).digest()


def _append(file: Path, ends: Sequence[End]) -> None:
    fresh = not file.exists()
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", newline="", encoding="utf-8") as rows:
        writer = csv.DictWriter(rows, COLUMNS, lineterminator="\n")
        if fresh:
            writer.writeheader()
        writer.writerows(asdict(end) for end in ends)


def _of_case(case: Case, solvers: Mapping[str, Any], budget: Budget) -> list[End]:
    setup = case.experiment.setup()
    found = []
    for name, solver in solvers.items():
        with warnings.catch_warnings(), limited_threads():
            warnings.simplefilter("ignore")
            found.append(end_of(case, setup, name, solver, budget))
    return found


def end_of(case: Case, setup: Setup, name: str, solver: Any, budget: Budget = BUDGET) -> End:
    """Run a solver on a case, and judge its end if it is called converged."""
    problem = setup.problem
    try:
        solution = budget.given(solver).solve(problem, setup.start)
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        return End(case.name, case.family, name, BROKEN, "", "", message=_line(said))
    known = (case.name, case.family, name, solution.status.name)
    numbers = (f"{solution.cost:.9g}", f"{solution.optimality:.2e}")
    said = _line(solution.message) if solution.message != solution.status.value else ""
    if solution.status is not Status.CONVERGED:
        return End(*known, *numbers, message=said)
    start, fixed = problem.split(setup.start)
    pack = problem.free.pack
    iterates = [start, *(pack(one.values) for one in solution.trace)]
    try:
        told = judge(problem, fixed, pack(solution.values), iterates, budget.gradient_tolerance)
    except ArithmeticError as error:
        return End(*known, *numbers, UNJUDGED, message=_line(str(error)))
    return End(
        *known,
        *numbers,
        told.arithmetic,
        f"{told.cosine:.1e}",
        f"{told.unexplained:.1e}",
        " ".join(told.lost),
        f"{told.curvature:.1e}",
        f"{told.fall:.1e}",
        " ".join(told.violations),
        said,
    )


def _line(text: str) -> str:
    return " ".join(text.split())[:160]
