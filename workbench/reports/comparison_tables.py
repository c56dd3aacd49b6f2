"""The tables of a comparison of solvers, as rows of text."""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from workbench.comparison import Comparison, TargetOutcome
from workbench.comparison.comparison import MAIN
from workbench.comparison.design import Instance
from workbench.comparison.identity import identity
from workbench.comparison.log import KINDS, LIMITED
from workbench.comparison.measured import Timing, ratios, seconds_of_runs, seconds_to
from workbench.comparison.prices import PRICES
from workbench.comparison.statistics import Interval, median
from workbench.comparison.targets import named
from workbench.comparison.words import percent
from workbench.reports.end_tables import words_of
from workbench.reports.page import Table, TextRow, number

PLURAL = {
    "residual": "residuals",
    "gradient": "gradients",
    "jacobian": "Jacobians",
    "hessian": "Hessians",
    "constraint": "constraints",
    "constraint_jacobian": "Jacobians of constraints",
    "constraint_hessian": "Hessians of constraints",
}


def success_table(comparison: Comparison) -> Table:
    """How often each solver met each target, and returned a point at the lowest cost; of several
    problems, on how many it met the target from every start.
    """
    head = [*(f"τ = {named(tau)}" for tau in comparison.taus), "ended at the lowest cost"]
    several = len(comparison.compared) > 1
    if several:
        head.append(f"problems, τ = {named(MAIN)}")

    def shares(solver: str) -> Iterator[Interval]:
        yield from (comparison.success(solver, tau) for tau in comparison.taus)
        yield comparison.reached(solver)
        if several:
            yield comparison.solved_problems(solver, MAIN)

    return _by_solver(comparison, head, lambda solver: map(percent, shares(solver)))


def verdicts_table(comparison: Comparison) -> Table:
    """How many runs got each verdict; verdicts that no run got are left out."""
    counts = {solver: comparison.counted(solver) for solver in comparison.solvers}
    there = [v for v in TargetOutcome if any(c[v] for c in counts.values())]
    head = [words_of(v) for v in there]
    return _by_solver(comparison, head, lambda solver: (str(counts[solver][v]) for v in there))


def prices_table() -> Table:
    """What an evaluation counts in effort."""
    rows = tuple((PRICES[kind].name, PRICES[kind].formula) for kind in KINDS)
    return Table(("evaluation of", "price"), rows)


def effort_table(comparison: Comparison, tau: float = MAIN) -> Table:
    """The evaluations until a target was met: medians, in which failures count as infinite."""
    kinds = _asked(comparison)
    runs = comparison.comparable

    def cells(solver: str) -> TextRow:
        met = sum(comparison.solved(i.name, solver, tau) for i in runs)
        counts = _counts(comparison, solver, tau, kinds)
        return f"{met} of {len(runs)}", *counts, _effort(comparison, solver, tau)

    return _by_solver(comparison, ["met", *(PLURAL[kind] for kind in kinds), "effort"], cells)


def seconds_table(comparison: Comparison, tau: float = MAIN) -> Table:
    """Seconds as they were measured, with their spread."""

    def cells(solver: str) -> TextRow:
        until = _spread(seconds_to(comparison, solver, tau))
        return *until, *_spread(seconds_of_runs(comparison, solver))

    spans = f"until τ = {named(tau)}", "whole run"
    head = [f"{span}, {s}" for span in spans for s in ("least", "median", "most")]
    return _by_solver(comparison, head, cells)


def _by_solver(
    comparison: Comparison, head: Sequence[str], cells: Callable[[str], Iterable[str]]
) -> Table:
    """A row for each solver: its name, and the cells below the headings, which are numbers."""
    rows = tuple((solver, *cells(solver)) for solver in comparison.solvers)
    return Table(("solver", *head), rows, tuple(range(1, len(head) + 1)))


def problem_table(comparison: Comparison, problem: str, tau: float = MAIN) -> Table:
    """Success, effort and ends of every solver on one problem; the last column has seconds."""
    chosen, kinds = comparison.of(problem), _asked(comparison)
    rows = []
    for solver in comparison.solvers:
        ends = [comparison.records[i.name, solver] for i in chosen]
        lowest = min((r.cost for r in ends if r.finite), default=np.nan)
        rows.append(
            (
                solver,
                percent(comparison.success(solver, tau, problem)),
                *_counts(comparison, solver, tau, kinds, problem),
                _effort(comparison, solver, tau, problem),
                number(lowest, 7),
                _verdicts(comparison, chosen, solver),
                " / ".join(_spread(seconds_to(comparison, solver, tau, problem))),
            )
        )
    head = (
        "solver",
        f"met τ = {named(tau)}",
        *(PLURAL[kind] for kind in kinds),
        "effort",
        "lowest end",
        "how its runs ended",
        "measured seconds",
    )
    return Table(head, tuple(rows), (*range(1, len(head) - 2), len(head) - 1))


def problems_table(comparison: Comparison) -> Table:
    """Sizes, prices beside the ratios that were measured, and the lowest cost known with its
    origin.
    """
    kinds = _asked(comparison)[1:]
    rows = []
    for problem in comparison.problems:
        chosen = comparison.of(problem)
        about = [comparison.described[i.name] for i in chosen]
        prices, measured = comparison.prices[problem], ratios(comparison, problem)
        yard = [comparison.yardsticks[i.name] for i in chosen]
        best = sorted({y.best for y in yard})
        told = number(best[0], 7) + (f" to {number(best[-1], 7)}" if len(best) > 1 else "")
        residual = 1e6 * float(np.median([d.seconds["residual"] for d in about]))
        rows.append(
            (
                problem,
                str(len(chosen)),
                f"{about[0].rows:,}",
                str(about[0].unknowns),
                *(f"{number(prices[k], 4)} ({number(measured[k], 2)})" for k in kinds),
                number(residual, 3),
                told,
                ", ".join(dict.fromkeys(y.origin for y in yard)),
            )
        )
    head = (
        "problem",
        "starts",
        "m",
        "n",
        *(PRICES[kind].name for kind in kinds),
        "residual, µs",
        "lowest cost known, f*",
        "from",
    )
    return Table(head, tuple(rows), tuple(range(1, len(head) - 1)))


def options_table(comparison: Comparison) -> Table:
    """The solvers with all their options, as they ran."""
    rows = []
    for each in comparison.named_solvers:
        told = identity(comparison.design.budget.given(each.solver))
        options = ", ".join(f"{k}={v}" for k, v in told.items() if k != "type")
        rows.append((each.name, str(told["type"]).split()[0], options, each.source))
    return Table(("solver", "class", "options", "file"), tuple(rows), ())


def _verdicts(comparison: Comparison, chosen: tuple[Instance, ...], solver: str) -> str:
    found = [comparison.outcomes[i.name, solver] for i in chosen]
    names = dict.fromkeys(found)
    if len(chosen) == 1:
        return words_of(found[0])
    return ", ".join(f"{found.count(v)} {words_of(v)}" for v in names)


def _asked(comparison: Comparison) -> tuple[str, ...]:
    """The kinds of evaluations to tell of: the problem's, and those of constraints if there are."""
    seen = [record.observed for record in comparison.records.values()]
    asked = [any(s.counts[k] for s in seen) for k in range(len(KINDS))]
    return tuple(
        kind for kind, there in zip(KINDS, asked, strict=True) if there or kind in KINDS[:LIMITED]
    )


def _counts(
    comparison: Comparison, solver: str, tau: float, kinds: TextRow, problem: str | None = None
) -> tuple[str, ...]:
    """Medians of evaluations until a target; dashes if not everything was counted."""
    chosen = comparison.starts(problem)
    if any(comparison.uncounted(i.name, solver, tau) for i in chosen):
        return ("–",) * len(kinds)
    met = [comparison.met(i.name, solver, tau) for i in chosen]
    return tuple(
        _amount(median([np.inf if row is None else row[KINDS.index(k)] for row in met]).value)
        for k in kinds
    )


def _spread(spread: Timing) -> tuple[str, str, str]:
    return number(spread.minimum, 2), number(spread.median, 2), number(spread.maximum, 2)


def _effort(comparison: Comparison, solver: str, tau: float, problem: str | None = None) -> str:
    """`23.4 (20.1–31)`, the interval where there is one."""
    interval = comparison.effort(solver, tau, problem)
    if np.isnan(interval.value):
        return "not counted" if comparison.starts(problem) else "–"
    if not interval.given or np.isinf(interval.low):
        return _amount(interval.value)
    return f"{_amount(interval.value)} ({_amount(interval.low)}–{_amount(interval.high)})"


def _amount(value: float) -> str:
    """Three digits, and no powers of ten up to a million."""
    return f"{value:,.0f}" if 1000 <= value < 1e6 else number(value, 3)
