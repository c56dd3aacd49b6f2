"""`workbench compare` and `workbench solvers`."""

from math import isnan
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench import comparison
from workbench.cli import interrupts_say
from workbench.cli.console import Bars, print_page, rich_table, say
from workbench.cli.options import Dask, Workers, executing
from workbench.cli.run import Setting, settings
from workbench.comparison.advice import advice, prices_sentence
from workbench.comparison.comparison import MAIN_TAU
from workbench.comparison.design import chosen
from workbench.comparison.targets import TargetOutcome, tau_text
from workbench.experiments import SUITES, find
from workbench.experiments.experiment import REQUIRED_NAMES
from workbench.reports import write_comparison
from workbench.reports.page import Columns, Table, number
from workbench.solvers import DEFAULT, SOLVERS, Abilities, Boxes, Derivative
from workbench.solvers.choice import recommend
from workbench.solvers.nlopt import ALGORITHMS

USUAL_SOLVERS = (DEFAULT, "gauss-newton", "levenberg-marquardt", "ipopt", "nlopt-lbfgs")
Names = Annotated[
    list[str],
    typer.Argument(
        help=f"Experiments, suites ({', '.join(SUITES)}), problems of a suite (`run --list` names "
        f"them), and Python files, each of which defines {REQUIRED_NAMES}."
    ),
]
Limits = comparison.Budget()
EFFORT_NOTE = (
    "Effort is the median over starts, and then over problems; ∞ where at least half of the starts "
    "failed on at least half of the problems. The page says how the other runs ended."
)


def compare(
    names: Names,
    solver: Annotated[
        list[str] | None,
        typer.Option(
            "--solver", help="A solver, or a Python file that defines some; may be repeated."
        ),
    ] = None,
    setting: Setting = None,
    seeds: Annotated[
        int, typer.Option(help="Number of starts, for problems with an argument start or seed.")
    ] = 1,
    workers: Workers = 1,
    dask: Dask = None,
    max_evaluations: Annotated[
        int, typer.Option(help="Limit of each run on evaluations of all kinds together.")
    ] = Limits.max_evaluations,
    max_seconds: Annotated[
        float, typer.Option(help="Limit of each run, in seconds.")
    ] = Limits.max_seconds,
    out: Annotated[Path, typer.Option(help="Folder of the comparison.")] = Path("runs/comparison"),
) -> None:
    """Compare solvers on problems; an interrupted comparison continues where it stopped.

    Runs that the folder already holds are not repeated. The page says which solver to choose. It
    counts evaluations, each kind at a fixed price; times are shown separately and rank no solver.
    """
    console = Console()
    experiments = chosen(names, settings(setting))
    budget = comparison.Budget(max_evaluations=max_evaluations, max_seconds=max_seconds)
    bars = Bars(console)

    def interruption() -> str:
        return (
            f"interrupted while {bars.last}; what was finished is stored in {out}, and the same "
            "command continues from there"
        )

    with interrupts_say(interruption):
        with executing(console, workers, dask), bars:
            result = comparison.compare(
                experiments,
                solver or USUAL_SOLVERS,
                seeds=seeds,
                budget=budget,
                workers=workers,
                folder=out,
                progress=bars,
            )
        console.print(rich_table(_table(result)))
        for text in (prices_sentence(), *advice(result)):
            say(console, escape(text))
        say(console, EFFORT_NOTE)
        console.print("[dim]writing the page[/]")
        print_page(console, "report", write_comparison(result, out))


def _table(result: comparison.Comparison) -> Table:
    """The success of each solver by counts alone, to fit a terminal; the page has intervals."""
    runs = result.comparable

    def cells(solver: str) -> tuple[str, ...]:
        met = sum(result.solved(i.name, solver, MAIN_TAU) for i in runs)
        lowest = sum(result.outcomes[i.name, solver] is TargetOutcome.REACHED for i in runs)
        effort = result.effort(solver, MAIN_TAU).value
        shares = (f"{count}/{len(runs)}" if runs else "–" for count in (met, lowest))
        return solver, *shares, "unknown" if isnan(effort) else number(effort)

    head = ("solver", f"met {tau_text(MAIN_TAU)}", "lowest cost", "effort")
    return Table(head, tuple(map(cells, result.solvers)), (1, 2, 3))


DERIVATIVE_WORDS = {
    Derivative.COST: "cost",
    Derivative.GRADIENT: "gradient",
    Derivative.JACOBIAN: "Jacobian",
    Derivative.HESSIAN: "Hessian",
}
BOUNDS_WORDS = {Boxes.REFUSED: "no", Boxes.TAKEN: "yes", Boxes.NEEDED: "needed"}


def solvers(
    nlopt: bool = typer.Option(False, help="List the algorithms of NLopt instead."),
    problem: str | None = typer.Option(
        None, "--for", help="Recommend solvers for a problem, with reasons."
    ),
) -> None:
    """List the solvers: derivatives, bounds, constraints, kind of search, and sources.

    With --for, recommend one for a problem from its size, structure, bounds and conditioning.
    benchmarks/SOLVERS.md compares solvers on problems of each kind.
    """
    if problem is not None:
        setup = find(problem).setup()
        say(Console(), escape(str(recommend(setup.problem, setup.start))))
        return
    catalogue = ALGORITHMS if nlopt else {name: s.abilities for name, s in SOLVERS.items()}
    console, heads = Console(), [*COLUMNS]
    for shown in (heads[:-2], [heads[0], *heads[-2:]]):  # 80 columns hold either
        table = Table.of(catalogue.items(), {head: COLUMNS[head] for head in shown}, ())
        console.print(rich_table(table), highlight=False)
        console.print()
    console.print("constraints: = equations, < inequalities", highlight=False)
    if nlopt:
        console.print('In Python: Nlopt("LD_LBFGS").', highlight=False)


COLUMNS: Columns[tuple[str, Abilities]] = {
    "solver": lambda of: of[0],
    "evaluates": lambda of: DERIVATIVE_WORDS[of[1].derivative],
    "bounds": lambda of: BOUNDS_WORDS[of[1].bounds],
    "constraints": lambda of: " ".join("=" * of[1].equations + "<" * of[1].inequalities) or "-",
    "searches": lambda of: (
        ("everywhere" if of[1].is_global else "downhill")
        + (", at random" if of[1].stochastic else "")
    ),
    "described in": lambda of: "; ".join(
        filter(None, (of[1].source, "for teaching" if of[1].teaching else "", of[1].note))
    ),
}
