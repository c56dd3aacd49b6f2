"""A comparison of solvers as a folder: one page, the tidy table, and how it was made."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from workbench.comparison import Cause, Comparison
from workbench.comparison.comparison import MAIN
from workbench.comparison.identity import code_version, identity
from workbench.comparison.measured import ratios
from workbench.comparison.prices import SOURCE
from workbench.comparison.statistics import FEWEST, LEVEL
from workbench.comparison.store import MARK, RUNS
from workbench.comparison.targets import TargetOutcome, ended_by_clock, named
from workbench.comparison.tidy import write_csv
from workbench.comparison.words import advice, basin_sentence, reliable
from workbench.plots import comparison_sheets as sheets
from workbench.plots.accuracy import caption_accuracy
from workbench.plots.cost_traces import caption_cost_traces, caption_waterfall
from workbench.plots.pairwise_wins import caption_pairwise_wins
from workbench.plots.profiles import caption_data_profile, caption_performance_profile
from workbench.plots.verdicts import caption_basins, caption_verdicts
from workbench.reports import comparison_tables as tables
from workbench.reports import end_tables as ends
from workbench.reports.folder import MAKER
from workbench.reports.page import Shown, as_json, drawn, of_solvers, page, shown, versions
from workbench.writing import write_file

RESULTS = "results.csv"
FILES = {
    "index.html": "this page",
    RESULTS: "one row per run: costs, evaluations, times, verdict, and each target",
    MARK: "machine, versions, options, fixed and measured prices, targets and basins, for programs",
}
FEW = 3  # runs that a waterfall needs


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
            e.name: identity(design.budget.given(e.solver)) | {"file": e.source}
            for e in comparison.named_solvers
        },
        "budget": asdict(design.budget),
        "seeds": design.seeds,
        "targets": comparison.taus,
        "prices": comparison.prices,
        "measured_prices": {p: ratios(comparison, p) for p in comparison.problems},
        "starts": {name: asdict(yardstick) for name, yardstick in comparison.yardsticks.items()},
        "basins": [
            {
                "starts": group,
                "costs": end_analysis.costs,
                "optimality": end_analysis.optimality,
                "curvatures": end_analysis.curvatures,
                "explanations": {k + 1: e.data() for k, e in end_analysis.explanations.items()},
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
        main=named(MAIN),
        verdicts=drawn(sheets.verdicts_sheet, caption_verdicts, comparison),
        outcomes=tables.verdicts_table(comparison),
        meanings={ends.words_of(v): v.value for v in TargetOutcome},
        success=tables.success_table(comparison),
        effort=tables.effort_table(comparison),
        prices=tables.prices_table(),
        price_source=SOURCE,
        seconds=tables.seconds_table(comparison),
        fewest=FEWEST,
        level=f"{LEVEL:.0%}",
        sure=bool(reliable(comparison, comparison.compared)) and bool(comparison.compared),
        data_profile=of_solvers(
            shown(sheets.data_profile_sheet(comparison, taus), caption_data_profile(comparison))
        ),
        performance_profile=of_solvers(
            shown(
                sheets.performance_profile_sheet(comparison, taus),
                caption_performance_profile(comparison),
            )
        )
        if pairs
        else None,
        pairwise=drawn(sheets.pairwise_wins_sheet, caption_pairwise_wins, comparison)
        if pairs
        else None,
        accuracy=_accuracy(comparison),
        each=[_of(comparison, problem) for problem in comparison.problems],
        table=tables.problems_table(comparison),
        ends=ends.ends_table(comparison),
        causes={ends.words_of(c): c.value for c in Cause},
        failures=ends.failures_table(comparison),
        options=tables.options_table(comparison),
        budget=comparison.design.budget,
        taus=", ".join(named(tau) for tau in comparison.taus),
        machines=machines(comparison),
        by_clock=sum(ended_by_clock(r) for r in comparison.records.values()),
        files=files,
    )


def _accuracy(comparison: Comparison) -> Shown | None:
    if not any(d.certified for d in comparison.described.values()):
        return None
    return of_solvers(drawn(sheets.accuracy_sheet, caption_accuracy, comparison))


def _of(comparison: Comparison, problem: str) -> dict[str, Any]:
    """What the page says of one problem."""
    instances = comparison.of(problem)
    analyses = ends.end_analyses(comparison, problem)
    several = any(len(analysis.costs) > 1 for _, analysis in analyses)
    own = len(analyses) > 1  # data for each start
    explained = {
        (f"{group[0]}, basin {k + 1}" if own else f"basin {k + 1}"): str(e)
        for group, analysis in analyses
        for k, e in analysis.explanations.items()
    }
    return {
        "name": problem,
        "question": comparison.described[instances[0].name].question,
        "table": tables.problem_table(comparison, problem),
        "traces": of_solvers(
            drawn(sheets.cost_traces_sheet, caption_cost_traces, comparison, problem)
        ),
        "waterfall": of_solvers(
            drawn(sheets.waterfall_sheet, caption_waterfall, comparison, problem)
        )
        if len(instances) >= FEW
        else None,
        "sentence": basin_sentence(comparison, problem),
        "basins": ends.basins_table(comparison, problem) if several else None,
        "bars": drawn(sheets.basins_sheet, caption_basins, comparison, problem)
        if several
        else None,
        "explained": explained,
        "unjudged": [analysis.message for _, analysis in analyses if analysis.message],
    }
