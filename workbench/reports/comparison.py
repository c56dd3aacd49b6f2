"""A comparison of solvers as a folder: its page, the tidy table, and how it was made."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.comparison import Comparison, EndAnalysis, TargetOutcome
from workbench.comparison.advice import advice, basin_sentence, percent, reliable
from workbench.comparison.comparison import MAIN_TAU
from workbench.comparison.design import Instance
from workbench.comparison.record import KINDS, LIMITED_KINDS
from workbench.comparison.statistics import FEWEST, Interval, median
from workbench.comparison.store import MARK, RUNS
from workbench.comparison.tables import (
    evaluation_seconds,
    relative_seconds,
    seconds_of_runs,
    seconds_to,
    write_csv,
)
from workbench.comparison.targets import PRICES, PRICES_SOURCE, ended_by_clock, tau_text
from workbench.identity import code_version, identity
from workbench.plots import comparison as figures
from workbench.reports.folder import MAKER
from workbench.reports.page import (
    Columns,
    Shown,
    Table,
    TextRow,
    as_json,
    drawn,
    number,
    of_solvers,
    page,
    shown,
    versions,
)
from workbench.writing import write_file

RESULTS = "results.csv"
FILES = {
    "index.html": "this page",
    RESULTS: "one row per run: costs, evaluations, times, verdict, and each target",
    MARK: "machine, versions, options, fixed and measured prices, targets and basins, for programs",
}


def write_comparison(comparison: Comparison, folder: str | Path) -> Path:
    """Write page, table and JSON into the folder of a comparison, each whole or not at all.

    Returns the page. Raises BadFile if the folder cannot be written.
    """
    folder = Path(folder)
    write_csv(comparison, folder / RESULTS)
    texts = {
        MARK: as_json(comparison_data(comparison)),
        "index.html": comparison_page(comparison, (folder / RUNS).is_dir()),
    }
    for name, text in texts.items():
        write_file(folder / name, text)
    return folder / "index.html"


def comparison_data(comparison: Comparison) -> dict[str, Any]:
    """Everything but the runs, as plain data."""
    design = comparison.design
    return {
        "made_by": MAKER,
        "kind": "comparison",
        "problems": comparison.problems,
        "solvers": {
            e.name: identity(design.budget.applied_to(e.solver)) | {"file": e.source}
            for e in comparison.design.named_solvers
        },
        "budget": asdict(design.budget),
        "seeds": design.seeds,
        "targets": comparison.taus,
        "prices": comparison.prices,
        "measured_prices": {p: relative_seconds(comparison, p) for p in comparison.problems},
        "starts": {name: asdict(costs) for name, costs in comparison.references.items()},
        "basins": [
            {
                "starts": group,
                "costs": end_analysis.costs,
                "optimality": end_analysis.optimality,
                "saddles": end_analysis.saddles,
                "message": end_analysis.message,
            }
            for group, end_analysis in zip(comparison.groups, comparison.end_analyses, strict=True)
        ],
        "unbuilt": comparison.unbuilt,
        "machines": machines(comparison),
        "code": code_version(),
        "versions": versions(),
        "files": list(FILES),
    }


def machines(comparison: Comparison) -> list[str]:
    """The machines on which the runs were measured, each listed once."""
    return sorted({record.machine for record in comparison.records.values()})


def comparison_page(comparison: Comparison, kept: bool) -> str:
    """The page; `kept` if the runs themselves are beside it."""
    taus = comparison.taus[1], comparison.taus[-1]
    files = FILES | (
        {f"{RUNS}/": "every run with its trace; the same command continues from them"}
        if kept
        else {}
    )
    pairs = len(comparison.solvers) > 1 and len(comparison.comparable) > 0
    return page(
        "comparison.html",
        title="Solvers compared",
        comparison=comparison,
        advice=advice(comparison),
        main=tau_text(MAIN_TAU),
        verdicts=drawn(figures.verdicts_sheet, figures.caption_verdicts, comparison),
        meanings={outcome_words(v): v.value for v in TargetOutcome},
        success=success_table(comparison),
        effort=effort_table(comparison),
        prices=Table(
            ("evaluation of", "price"),
            tuple((PRICES[kind].name, PRICES[kind].formula) for kind in KINDS),
        ),
        price_source=PRICES_SOURCE,
        seconds=seconds_table(comparison),
        fewest=FEWEST,
        sure=bool(reliable(comparison, comparison.compared)) and bool(comparison.compared),
        data_profile=_profiles(
            comparison, taus, figures.plot_data_profile, figures.caption_data_profile
        ),
        performance_profile=_profiles(
            comparison, taus, figures.plot_performance_profile, figures.caption_performance_profile
        )
        if pairs
        else None,
        each=[_problem_section(comparison, problem) for problem in comparison.problems],
        table=problems_table(comparison),
        failed=any(
            comparison.outcomes[i.name, s] not in AT_LOWEST
            for i in comparison.comparable
            for s in comparison.solvers
        ),
        budget=comparison.design.budget,
        taus=", ".join(tau_text(tau) for tau in comparison.taus),
        machines=machines(comparison),
        by_clock=sum(ended_by_clock(r) for r in comparison.records.values()),
        files=files,
    )


def _profiles(
    comparison: Comparison,
    taus: Sequence[float],
    plot: Callable[..., object],
    caption: Callable[[Comparison], str],
) -> Shown:
    """The profiles at several targets, side by side."""
    plots = [partial(plot, comparison, tau) for tau in taus]
    return of_solvers(shown(figures.curves_sheet(comparison, plots), caption(comparison)))


def _problem_section(comparison: Comparison, problem: str) -> dict[str, Any]:
    """What the page says of one problem."""
    instances = comparison.instances_of(problem)
    analyses = end_analyses(comparison, problem)
    return {
        "name": problem,
        "question": comparison.described[instances[0].name].question,
        "table": problem_table(comparison, problem),
        "traces": of_solvers(
            drawn(figures.cost_traces_sheet, figures.caption_cost_traces, comparison, problem)
        ),
        "sentence": basin_sentence(comparison, problem).removeprefix(f"{problem}: "),
        "unjudged": [analysis.message for _, analysis in analyses if analysis.message],
    }


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
    head = [*(f"τ = {tau_text(tau)}" for tau in comparison.taus), "ended at the lowest cost"]
    several = len(comparison.compared) > 1
    if several:
        head.append(f"problems, τ = {tau_text(MAIN_TAU)}")

    def shares(solver: str) -> Iterator[Interval]:
        yield from (comparison.success(solver, tau) for tau in comparison.taus)
        yield comparison.reached(solver)
        if several:
            yield comparison.solved_problems(solver, MAIN_TAU)

    return _by_solver(comparison, head, lambda solver: map(percent, shares(solver)))


def effort_table(comparison: Comparison, tau: float = MAIN_TAU) -> Table:
    """The evaluations until a target was met: medians, in which failures count as infinite."""
    kinds = _evaluated_kinds(comparison)
    runs = comparison.comparable

    def cells(solver: str) -> Iterator[str]:
        rows = [comparison.reached_at(i.name, solver, tau) for i in runs]
        yield f"{sum(comparison.solved(i.name, solver, tau) for i in runs)} of {len(runs)}"
        counted = not any(comparison.uncounted(i.name, solver, tau) for i in runs)
        for k in map(KINDS.index, kinds):
            until = median([np.inf if row is None else row[k] for row in rows]).value
            yield _amount(until) if counted else "–"
        yield _effort(comparison, solver, tau)

    return _by_solver(comparison, ["met", *(PLURAL[kind] for kind in kinds), "effort"], cells)


def seconds_table(comparison: Comparison, tau: float = MAIN_TAU) -> Table:
    """Seconds as they were measured, with their spread."""

    def cells(solver: str) -> TextRow:
        until = _spread(seconds_to(comparison, solver, tau))
        return *until, *_spread(seconds_of_runs(comparison, solver))

    spans = f"until τ = {tau_text(tau)}", "whole run"
    head = [f"{span}, {s}" for span in spans for s in ("least", "median", "most")]
    return _by_solver(comparison, head, cells)


def _by_solver(
    comparison: Comparison, head: Sequence[str], cells: Callable[[str], Iterable[str]]
) -> Table:
    """A row for each solver: its name, and the cells below the headings, which are numbers."""
    rows = tuple((solver, *cells(solver)) for solver in comparison.solvers)
    return Table(("solver", *head), rows, tuple(range(1, len(head) + 1)))


def problem_table(comparison: Comparison, problem: str) -> Table:
    """Success, effort and ends of every solver on one problem; the last column has seconds."""
    chosen = comparison.instances_of(problem)

    def lowest(solver: str) -> float:
        ends = (comparison.records[i.name, solver] for i in chosen)
        return min((end.cost for end in ends if end.finite), default=np.nan)

    columns: Columns[str] = {
        "solver": str,
        f"met τ = {tau_text(MAIN_TAU)}": lambda s: percent(
            comparison.success(s, MAIN_TAU, problem)
        ),
        "effort": lambda s: _effort(comparison, s, MAIN_TAU, problem),
        "lowest end": lambda s: number(lowest(s), 7),
        "how its runs ended": lambda s: _verdicts(comparison, chosen, s),
        "measured seconds": lambda s: " / ".join(
            _spread(seconds_to(comparison, s, MAIN_TAU, problem))
        ),
    }
    return Table.of(comparison.solvers, columns, (1, 2, 3, 5))


def problems_table(comparison: Comparison) -> Table:
    """Sizes, prices beside the ratios that were measured, and the lowest cost known."""
    about = {
        p: comparison.described[comparison.instances_of(p)[0].name] for p in comparison.problems
    }

    def price(problem: str, kind: str) -> str:
        measured = relative_seconds(comparison, problem)[kind]
        return f"{number(comparison.prices[problem][kind], 4)} ({number(measured, 2)})"

    def best(problem: str) -> str:
        costs = {comparison.references[i.name].best for i in comparison.instances_of(problem)}
        return " to ".join(number(cost, 7) for cost in sorted({min(costs), max(costs)}))

    columns: dict[str, Callable[[str], str]] = {
        "problem": str,
        "starts": lambda p: str(len(comparison.instances_of(p))),
        "m": lambda p: f"{about[p].rows:,}",
        "n": lambda p: str(about[p].unknowns),
        **{PRICES[k].name: partial(price, kind=k) for k in _evaluated_kinds(comparison)[1:]},
        "residual, µs": lambda p: number(1e6 * evaluation_seconds(comparison, p)["residual"], 3),
        "lowest cost known, f*": best,
    }
    return Table.of(comparison.problems, columns, tuple(range(1, len(columns))))


def _verdicts(comparison: Comparison, chosen: tuple[Instance, ...], solver: str) -> str:
    outcomes = [comparison.outcomes[i.name, solver] for i in chosen]
    names = dict.fromkeys(outcomes)
    if len(chosen) == 1:
        return outcome_words(outcomes[0])
    return ", ".join(f"{outcomes.count(v)} {outcome_words(v)}" for v in names)


def _evaluated_kinds(comparison: Comparison) -> tuple[str, ...]:
    """The kinds of evaluations to tell of: the problem's, and those of constraints if there are."""
    observed = [record.observed for record in comparison.records.values()]
    evaluated = [any(s.counts[k] for s in observed) for k in range(len(KINDS))]
    return tuple(
        kind
        for kind, used in zip(KINDS, evaluated, strict=True)
        if used or kind in KINDS[:LIMITED_KINDS]
    )


def _spread(seconds: Array) -> tuple[str, ...]:
    return tuple(number(s, 2) for s in seconds)


def _effort(comparison: Comparison, solver: str, tau: float, problem: str | None = None) -> str:
    """`23.4 (20.1–31)`, the interval where there is one."""
    interval = comparison.effort(solver, tau, problem)
    if np.isnan(interval.value):
        return "not counted" if comparison.starts(problem) else "–"
    if not interval.bounded or np.isinf(interval.low):
        return _amount(interval.value)
    return f"{_amount(interval.value)} ({_amount(interval.low)}–{_amount(interval.high)})"


def _amount(value: float) -> str:
    """Three digits, and no powers of ten up to a million."""
    return f"{value:,.0f}" if 1000 <= value < 1e6 else number(value, 3)


AT_LOWEST = TargetOutcome.REACHED, TargetOutcome.ALONE


def end_analyses(comparison: Comparison, problem: str) -> list[tuple[tuple[str, ...], EndAnalysis]]:
    """The analyses of a problem's ends, one for each data set, with the names of its instances."""
    names = {i.name for i in comparison.instances_of(problem)}
    analyses = zip(comparison.groups, comparison.end_analyses, strict=True)
    return [(group, analysis) for group, analysis in analyses if group[0] in names]


def outcome_words(outcome: TargetOutcome) -> str:
    """The name of an outcome in words."""
    return outcome.name.lower().replace("_", " ")
