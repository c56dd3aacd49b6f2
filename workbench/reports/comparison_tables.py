"""The tables of a comparison of solvers, as rows of text."""

import numpy as np

from workbench.comparison import Comparison, Verdict
from workbench.comparison.comparison import MAIN
from workbench.comparison.identity import identity
from workbench.comparison.plan import Instance
from workbench.comparison.statistics import Interval, median
from workbench.comparison.targets import named
from workbench.comparison.watch import KINDS
from workbench.comparison.words import percent
from workbench.reports.tables import Row, Table, number

PLURAL = ("residuals", "gradients", "Jacobians", "Hessians")


def success_table(comparison: Comparison) -> Table:
    """How often each solver met each target, and returned a point at the lowest cost."""
    rows = tuple(
        (
            solver,
            *(percent(comparison.success(solver, tau)) for tau in comparison.taus),
            percent(comparison.reached(solver)),
        )
        for solver in comparison.solvers
    )
    head = (
        "solver", *(f"τ = {named(tau)}" for tau in comparison.taus), "ended at the lowest cost",
    )  # fmt: skip
    return Table(head, rows, tuple(range(1, len(head))))


def verdicts_table(comparison: Comparison) -> Table:
    """How many runs came to what; verdicts that nobody met are left out."""
    counts = [comparison.counted(solver) for solver in comparison.solvers]
    there = [v for v in Verdict if any(c[v] for c in counts)]
    rows = tuple(
        (solver, *(str(c[v]) for v in there))
        for solver, c in zip(comparison.solvers, counts, strict=True)
    )
    return Table(("solver", *(_verdict(v) for v in there)), rows, tuple(range(1, len(there) + 1)))


def effort_table(comparison: Comparison, tau: float = MAIN) -> Table:
    """What it took to meet a target: medians over all starts, failures counted as infinite."""
    rows = []
    for solver in comparison.solvers:
        met = [comparison.met(i.name, solver, tau) for i in comparison.instances]
        counts = [
            median([np.inf if row is None else row[k] for row in met]).value
            for k in range(len(KINDS))
        ]
        k = comparison.solvers.index(solver)
        seconds = median(comparison.needed_seconds(tau)[:, k])
        rows.append(
            (
                solver, f"{sum(row is not None for row in met)} of {len(met)}",
                *(_amount(c) for c in counts), _told(comparison.effort(solver, tau)),
                _told(seconds),
            )
        )  # fmt: skip
    head = ("solver", "met", *PLURAL, "effort", "seconds")
    return Table(head, tuple(rows), tuple(range(1, len(head))))


def problem_table(comparison: Comparison, problem: str, tau: float = MAIN) -> Table:
    """The same for one problem."""
    chosen = comparison.of(problem)
    rows = []
    for solver in comparison.solvers:
        met = [comparison.met(i.name, solver, tau) for i in chosen]
        counts = [
            median([np.inf if row is None else row[k] for row in met]).value
            for k in range(len(KINDS))
        ]
        ends = [comparison.records[i.name, solver] for i in chosen]
        lowest = min((r.cost for r in ends if r.finite), default=np.nan)
        rows.append(
            (
                solver, percent(comparison.success(solver, tau, problem)),
                *(_amount(c) for c in counts),
                _told(comparison.effort(solver, tau, problem)), number(lowest, 7),
                _verdicts(comparison, chosen, solver),
            )
        )  # fmt: skip
    head = (
        "solver", f"met τ = {named(tau)}", *PLURAL, "effort", "lowest end",
        "what its runs came to",
    )  # fmt: skip
    return Table(head, tuple(rows), tuple(range(1, len(head) - 1)))


def problems_table(comparison: Comparison) -> Table:
    """Sizes, prices, and the lowest cost known with its origin."""
    rows = []
    for problem in comparison.problems:
        chosen = comparison.of(problem)
        about = [comparison.described[i.name] for i in chosen]
        prices = comparison.prices[problem]
        yard = [comparison.yardsticks[i.name] for i in chosen]
        best = sorted({y.best for y in yard})
        told = number(best[0], 7) + (f" to {number(best[-1], 7)}" if len(best) > 1 else "")
        residual = 1e6 * float(np.median([d.seconds["residual"] for d in about]))
        rows.append(
            (
                problem, str(len(chosen)), f"{about[0].rows:,}", str(about[0].unknowns),
                number(residual, 3), *(number(prices[kind], 3) for kind in KINDS[1:]), told,
                ", ".join(dict.fromkeys(y.origin for y in yard)),
            )
        )  # fmt: skip
    head = (
        "problem", "starts", "m", "n", "residual, µs", "gradient", "Jacobian", "Hessian",
        "lowest cost known, f*", "from",
    )  # fmt: skip
    return Table(head, tuple(rows), tuple(range(1, len(head) - 1)))


def failures_table(comparison: Comparison) -> Table:
    """Every run that did not end at the lowest cost, with what it said."""
    rows = []
    for instance in comparison.instances:
        for solver in comparison.solvers:
            verdict = comparison.verdicts[instance.name, solver]
            if verdict is Verdict.REACHED:
                continue
            record = comparison.records[instance.name, solver]
            said = f"{record.claim.lower().replace('_', ' ')}: " if record.claim else ""
            rows.append(
                (
                    instance.name, solver, verdict.value, number(record.cost, 6),
                    number(record.optimality, 2), f"{said}{record.message}",
                )
            )  # fmt: skip
    head = ("start", "solver", "it", "cost at its end", "optimality", "what it said itself")
    return Table(head, tuple(rows), (3, 4))


def basins_table(comparison: Comparison, problem: str) -> Table:
    """The basins that ends of a problem lead to, of each data set by itself."""
    rows: list[Row] = []
    seen: set[int] = set()
    for instance in comparison.of(problem):
        judgement = comparison.judgement(instance.name)
        if id(judgement) in seen:
            continue
        seen.add(id(judgement))
        best = comparison.yardsticks[instance.name].best
        same = [i for i in comparison.of(problem) if comparison.judgement(i.name) is judgement]
        names = {i.name for i in same}
        of = problem if len(names) > 1 else instance.name
        for k, cost in enumerate(judgement.costs):
            who = [s for (name, s), b in comparison.basins.items() if b == k and name in names]
            each = ", ".join(f"{s} {who.count(s)}" for s in dict.fromkeys(who))
            rows.append(
                (
                    of, str(k + 1), number(cost, 8), number(cost - best, 3),
                    number(judgement.optimality[k], 2), str(len(who)), each,
                )
            )  # fmt: skip
    head = ("start", "basin", "cost", "above f*", "optimality", "ends", "whose")
    if len(seen) == 1:  # of the problem as a whole
        return Table(head[1:], tuple(row[1:] for row in rows), (0, 1, 2, 3, 4))
    return Table(head, tuple(rows), (1, 2, 3, 4, 5))


def options_table(comparison: Comparison) -> Table:
    """The solvers with all their options, as they ran."""
    rows = []
    for entrant in comparison.entrants:
        told = identity(comparison.plan.budget.given(entrant.solver))
        options = ", ".join(f"{k}={v}" for k, v in told.items() if k != "type")
        rows.append((entrant.name, str(told["type"]).split()[0], options, entrant.source))
    return Table(("solver", "class", "options", "file"), tuple(rows), ())


def _verdicts(comparison: Comparison, chosen: tuple[Instance, ...], solver: str) -> str:
    found = [comparison.verdicts[i.name, solver] for i in chosen]
    names = dict.fromkeys(found)
    if len(chosen) == 1:
        return _verdict(found[0])
    return ", ".join(f"{found.count(v)} {_verdict(v)}" for v in names)


def _verdict(verdict: Verdict) -> str:
    return verdict.name.lower().replace("_", " ")


def _told(interval: Interval) -> str:
    """`23.4 (20.1–31)`."""
    if np.isnan(interval.low) or np.isinf(interval.low):
        return _amount(interval.value)
    return f"{_amount(interval.value)} ({_amount(interval.low)}–{_amount(interval.high)})"


def _amount(value: float) -> str:
    """Three digits, and no powers of ten up to a million."""
    return f"{value:,.0f}" if 1000 <= value < 1e6 else number(value, 3)
