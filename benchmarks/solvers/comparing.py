"""Each case and each problem of a kind by `workbench.comparison`, judged and counted.

A run has solved a case if it ends at a cost of at most (1 + 1e-6) f* + 1e-12 f_0, where f* is the
cost of the known answer and f_0 the least cost at any start of the problem: a start that is a
hundred times farther away makes a problem no easier. Where NIST certified the parameters, each of
them must agree to four digits as well (McCullough, The American Statistician 52, 1998). What a
solver says of itself is not asked.

Finished runs are stored in a folder, so that an interrupted measurement continues.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.optimize

from benchmarks.measuring import measured_on, table
from benchmarks.solvers.case import Case
from benchmarks.solvers.cases import look, tuning
from benchmarks.solvers.kinds import KINDS, WITHOUT, Kind
from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.comparison import Budget, Comparison, Record, compare
from workbench.comparison.record import KINDS as EVALUATIONS
from workbench.comparison.statistics import performance_profile, rate
from workbench.comparison.targets import claims, units
from workbench.problem import Problem
from workbench.problem.storage import dense
from workbench.solvers import DEFAULT, SOLVERS, Solver, Status

PARTS = ("kinds", "tuning", "held-out")  # the last only where it is asked for, with a purpose
RUNS = Path("runs") / "solvers"
OF_CASES = Budget(max_evaluations=2_000, max_seconds=30.0)
OF_KINDS = Budget(max_seconds=20.0)
ROUGH = Budget(max_evaluations=300, max_seconds=2.0)
EVERY = 60  # of the cases of a quick run
RELATIVE, SHARE, CERTIFIED = 1e-6, 1e-12, 4
FACTORS = (1, 1.25, 1.5, 2, 3, 5, 10)
TIGHT = 1e-15


@dataclass(frozen=True)
class Answer:
    """What a peer returns, with the attributes that a comparison reads of a solution."""

    values: Values
    cost: float
    status: Status
    message: str


@dataclass(frozen=True)
class Peer:
    """`scipy.optimize.least_squares` as a user calls it, with an exact Jacobian and tight
    tolerances.

    Attributes:
        method: `trf`, `dogbox` or `lm`.
        x_scale: None for the method's default, or `jac`.
    """

    method: str
    x_scale: Any = None

    def solve(self, problem: Problem, start: Values, **_: Any) -> Answer:
        """Solve from `start`. Raises what SciPy raises."""
        x, fixed = problem.split(start)
        missing = max(0, x.size - problem.size) if self.method == "lm" else 0
        rows = np.zeros((missing, x.size))
        tolerances = {"ftol": TIGHT, "xtol": TIGHT, "gtol": TIGHT, "max_nfev": 100_000}
        options: dict[str, Any] = {"method": self.method, "x_scale": self.x_scale, **tolerances}

        def residual(x: Array) -> Array:
            return np.append(problem.residual(x, fixed), rows[:, 0])

        def jacobian(x: Array) -> Array:
            return np.vstack([dense(problem.linearize_at(x, fixed).jacobian), rows])

        with np.errstate(all="ignore"):
            found: Any = scipy.optimize.least_squares(residual, x, jacobian, **options)
        status = Status.CONVERGED if found.success else Status.MAX_EVALUATIONS
        return Answer(problem.values(found.x, fixed), float(found.cost), status, found.message)


@dataclass(frozen=True)
class AsItComes:
    """A solver with its own limits and tolerance: a comparison sees no options to set."""

    solver: Solver

    def solve(self, problem: Problem, start: Values, **_: Any) -> Any:
        """Solve from `start`."""
        return self.solver.solve(problem, start)


PEERS = {
    f"peer {method}{', jac' if scale else ''}": Peer(method, scale)
    for method, scale in (
        *(("trf", None), ("trf", "jac"), ("dogbox", None), ("dogbox", "jac"), ("lm", None)),
    )
}
PROFILED = (  # a profile depends on who takes part
    *(DEFAULT, "levenberg-marquardt", "levenberg-marquardt-columns", "gauss-newton", "dogleg"),
    *PEERS,
)
ENTRANTS: dict[str, Any] = {
    **{name: one for name, one in SOLVERS.items() if name != "nlopt-mlsl"},  # it needs bounds
    f"{DEFAULT}, as it comes": AsItComes(SOLVERS[DEFAULT]),
    **PEERS,
}


def measured(
    quick: bool, parts: Sequence[str] = (), purpose: str = "", workers: int = 1
) -> dict[str, Any]:
    """The parts that are asked for; those for tuning and by kind if none is."""
    asked = parts or PARTS[:2]
    if quick and "held-out" in asked:
        raise ValueError("the held-out cases are not for a quick look")
    found: dict[str, Any] = {}
    if "kinds" in asked:
        found["kinds"] = {name: of_kind(one, quick, workers) for name, one in KINDS.items()}
    if "tuning" in asked:
        cases = tuning()[::EVERY] if quick else tuning()
        found["tuning"] = of_cases(cases, quick, workers)
    if "held-out" in asked:
        found["held-out"] = of_cases(look(purpose), quick, workers)
    return found


def compared(what: str, quick: bool, budget: Budget, *arguments: Any, **options: Any) -> Comparison:
    """Compare, and tell how far it is."""
    return compare(
        *arguments,
        **options,
        budget=ROUGH if quick else budget,
        folder=None if quick else RUNS / what.replace(" ", "-"),
        progress=lambda doing, done, of: print(f"{what}: {doing} {done}/{of}", flush=True),
    )


# Cases with known answers


def of_cases(cases: Sequence[Case], quick: bool, workers: int) -> dict[str, Any]:
    """By solver what was solved, claimed and evaluated, in all and by family; and the profiles."""
    names = (DEFAULT, "peer trf", "peer lm") if quick else tuple(ENTRANTS)
    entrants = {name: ENTRANTS[name] for name in names}
    experiments = [one.experiment for one in cases]
    return counted(
        cases, compared("cases", quick, OF_CASES, experiments, entrants, workers=workers)
    )


def counted(cases: Sequence[Case], comparison: Comparison) -> dict[str, Any]:
    """What `of_cases` returns, of runs that have been made."""
    instances = {i.experiment.name: i.name for i in comparison.instances}
    about = [comparison.described[instances[one.name]] for one in cases]
    least: dict[str, float] = {}  # cost at any start, by problem
    for one, facts in zip(cases, about, strict=True):
        least[one.problem] = min(least.get(one.problem, np.inf), facts.start_cost)
    runs = [[comparison.records[instances[c.name], s] for s in comparison.solvers] for c in cases]
    shape = len(cases), len(comparison.solvers)
    solved, claimed = np.zeros(shape, bool), np.zeros(shape, bool)
    evaluations, effort = np.full(shape, np.inf), np.full(shape, np.inf)
    for p, (one, facts) in enumerate(zip(cases, about, strict=True)):
        enough = target(facts.known_cost, least[one.problem])
        for s, record in enumerate(runs[p]):
            claimed[p, s] = claims(record)
            solved[p, s] = is_solved(record, enough, one.family.startswith("nist"))
            if solved[p, s]:
                counts = counts_until(record, enough)
                evaluations[p, s] = counts.sum()
                effort[p, s] = float(units(counts, facts.unknowns))
    return tabulated(cases, comparison.solvers, solved, claimed, evaluations, effort)


def target(known: float, least_start: float) -> float:
    """The highest cost of a solution, for the known cost and the least cost at any start."""
    return (1 + RELATIVE) * known + SHARE * least_start


def is_solved(record: Record, enough: float, certified: bool) -> bool:
    """Whether a run ended at a solution; `enough` is the target."""
    return record.at_end and record.cost <= enough and not (certified and record.digits < CERTIFIED)


def counts_until(record: Record, enough: float) -> Array:
    """(kinds,) how often each kind was evaluated when a cost first was low enough.

    Where no such point was seen by the counter, all evaluations of the run.
    """
    rows = record.observed.trace
    below = np.flatnonzero(rows[:, -1] <= enough) if rows.size else np.zeros(0, int)
    row = rows[below[0], : len(EVALUATIONS)] if below.size else record.observed.counts
    return np.asarray(row, dtype=float)


def tabulated(
    cases: Sequence[Case],
    solvers: Sequence[str],
    solved: Mask,
    claimed: Mask,
    evaluations: Array,
    effort: Array,
) -> dict[str, Any]:
    """The numbers of the page, from (P, S) arrays; evaluations and effort infinite if unsolved."""
    families = Counter(one.family for one in cases)
    of = np.array([one.family for one in cases])
    shown = [name for name in PROFILED if name in solvers]
    columns = [list(solvers).index(name) for name in shown]
    trf = [k for k, name in enumerate(solvers) if name.startswith("peer trf")]
    missed = solved[:, trf].any(axis=1) & ~solved[:, list(solvers).index(DEFAULT)]
    return {
        "families": dict(families),
        "solvers": {
            name: {
                "solved": int(solved[:, k].sum()),
                "false claims": int((claimed[:, k] & ~solved[:, k]).sum()),
                "evaluations": float(np.median(evaluations[solved[:, k], k]))
                if solved[:, k].any()
                else None,
                "by family": [int(solved[of == family, k].sum()) for family in families],
            }
            for k, name in enumerate(solvers)
        },
        "profiles": {
            what: dict(
                zip(shown, performance_profile(t[:, columns], FACTORS).T.tolist(), strict=True)
            )
            for what, t in (("evaluations", evaluations), ("effort", effort))
        },
        "missed": [one.name for one, is_missed in zip(cases, missed, strict=True) if is_missed],
    }


# Problems by kind


def of_kind(kind: Kind, quick: bool, workers: int) -> dict[str, Any]:
    """By solver: starts solved, all starts, and the median effort, null where most are unsolved."""
    if quick:
        kind = replace(kind, problems=kind.problems[:1], solvers=kind.solvers[:2], seeds=1)
    options = {"seeds": kind.seeds, "workers": workers}
    comparison = compared(kind.name, quick, OF_KINDS, kind.problems, kind.solvers, **options)
    starts, rows = comparison.starts(), {}
    for solver in comparison.solvers:
        median = float(np.median(efforts(kind, comparison, solver)))
        rows[solver] = {
            "solved": sum(comparison.solved(i.name, solver, kind.tau) for i in starts),
            "starts": len(starts),
            "effort": median if np.isfinite(median) else None,
        }
    return {
        "problems": [one.name for one in kind.problems],
        "seeds": kind.seeds,
        "tau": kind.tau,
        "unbuilt": dict(comparison.unbuilt),
        "solvers": rows,
    }


def efforts(kind: Kind, comparison: Comparison, solver: str) -> Array:
    """Evaluations of the residual until the target, by start; infinite where it was not met."""
    if kind.name != WITHOUT:
        needed = comparison.needed(kind.tau)[:, comparison.solvers.index(solver)]
        return np.where(np.isnan(needed), np.inf, needed)
    found = []
    for instance in comparison.starts():  # a gradient costs n + 1 residuals without derivatives
        counts = comparison.reached_at(instance.name, solver, kind.tau)
        n = comparison.unknowns[instance.problem]
        prices = {"gradient": n + 1.0, "jacobian": n + 1.0}
        each = np.array([prices.get(name, 1.0) for name in EVALUATIONS])
        found.append(np.inf if counts is None else float(counts[: len(EVALUATIONS)] @ each))
    return np.array(found)


# The page


def tables(found: Mapping[str, Any]) -> str:
    """Every kind with its solvers, and both halves of the cases."""
    return "\n".join(_lines(found))


def _lines(found: Mapping[str, Any]) -> Iterator[str]:
    for name, one in found.get("kinds", {}).items():
        if name == "machine":
            yield measured_on(one) + "\n"
            continue
        meaning = KINDS[name].meaning
        yield f"## {name.capitalize()}\n"
        yield f"{meaning[0].upper()}{meaning[1:]}.\n"
        count, seeds = len(one["problems"]), one["seeds"]
        starts = f"{seeds} starts" if seeds > 1 else "one start"
        each = f"{count} problems, {starts} each" if count > 1 else f"1 problem, {starts}"
        yield f"{each}; tau = {one['tau']:g}.\n"
        yield table(("solver", "solved", "95 % interval", "effort"), _of_kind(one["solvers"]))
    for half, title in (("tuning", "for tuning"), ("held-out", "held out")):
        if half in found:
            yield f"## Cases with known answers, {title}\n"
            yield from _half(found[half])


def _of_kind(rows: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """The solvers that solved most first; among equals the one with the least effort."""
    order = sorted(
        rows.items(), key=lambda item: (-item[1]["solved"], item[1]["effort"] or float("inf"))
    )
    for solver, row in order:
        share = rate(row["solved"], row["starts"])
        effort = "–" if row["effort"] is None else f"{row['effort']:,.0f}"
        between = f"{share.low:.0%} to {share.high:.0%}"
        yield solver, f"{row['solved']} of {row['starts']}", between, effort


def _half(found: Mapping[str, Any]) -> Iterator[str]:
    count, solvers = sum(found["families"].values()), found["solvers"]
    rows = sorted(solvers.items(), key=lambda item: -item[1]["solved"])
    yield table(
        ("solver", "solved", "false claims", "evaluations"),
        (
            (name, f"{row['solved']} of {count}", row["false claims"], _number(row["evaluations"]))
            for name, row in rows
        ),
    )
    for what, profile in found["profiles"].items():
        yield f"The performance profile, by factors of the least {what}:\n"
        shares = ((name, *(f"{one:.1%}" for one in row)) for name, row in profile.items())
        yield table(("solver", *(f"{factor:g}" for factor in FACTORS)), shares)
    yield "Solved cases by family:\n"
    shown = list(found["profiles"]["evaluations"])
    yield table(
        ("family", "cases", *shown),
        (
            (family, number, *(solvers[name]["by family"][k] for name in shown))
            for k, (family, number) in enumerate(found["families"].items())
        ),
    )
    if found["missed"]:
        missed = "; ".join(found["missed"])
        yield "Cases that SciPy's trf solves with one of its scalings, and the default does not: "
        yield f"{missed}.\n"
    if "machine" in found:
        yield measured_on(found["machine"]) + "\n"


def _number(number: float | None) -> str:
    return "–" if number is None else f"{number:,.0f}"
