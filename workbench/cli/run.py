"""`workbench run`: an experiment from its name or file to a report."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.blocks import Values
from workbench.cli.leaving import Interrupted
from workbench.cli.output import folder_to_write, print_page
from workbench.cli.progress import LiveTrace, print_outcome
from workbench.comparison.named_solvers import named_solvers
from workbench.errors import BadArgument, BadFile, joined
from workbench.experiments import EXPERIMENTS, SUITES, Experiment, find
from workbench.experiments import run as run_experiment
from workbench.experiments.own_file import BESIDE, ENOUGH
from workbench.experiments.suites import SUMMARIES
from workbench.fitting.setup import Setup
from workbench.reports import write_report
from workbench.solvers import DEFAULT, SOLVERS, Solver

Name = Annotated[
    str,
    typer.Argument(
        help=f"One of {', '.join(EXPERIMENTS)}, a problem of a suite (run --list), or a Python "
        f"file that defines {ENOUGH}; {BESIDE}."
    ),
]
Setting = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="An argument of the experiment, such as frame=60 or noise=0.001; may be repeated.",
    ),
]
Out = Annotated[
    Path, typer.Option(help="Folder in which the command makes a folder for its results.")
]
SolverName = Annotated[
    str,
    typer.Option(
        "--solver", help=f"One of {', '.join(SOLVERS)}, or a Python file that defines one solver."
    ),
]
Compare = Annotated[
    bool,
    typer.Option(
        help="Also solve with other solvers that are named for this problem, and compare."
    ),
]


def run(
    name: Name = "balance",
    setting: Setting = None,
    solver: SolverName = DEFAULT,
    compare: Compare = True,
    out: Out = Path("runs"),
    listing: Annotated[
        bool,
        typer.Option(
            "--list", help="List the experiments, or the problems of a suite, and run nothing."
        ),
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print a line for each iterate.")
    ] = False,
) -> None:
    """Run an experiment and write its report to runs/NAME/."""
    console = Console()
    if listing:
        if name not in (*SUITES, *EXPERIMENTS):
            raise BadArgument(
                f"no suite is called {name!r}; there are {', '.join(SUITES)}; without a name, "
                "--list names the experiments"
            )
        print_list(console, SUITES.get(name))
        return
    carry_out(console, find(name, settings(setting)), solver_named(solver), compare, out, verbose)


def print_list(console: Console, suite: Sequence[Experiment] | None) -> None:
    """Print the problems of a suite, or else the experiments and the suites."""
    shown = EXPERIMENTS.values() if suite is None else suite
    width = 2 + max(len(experiment.name) for experiment in shown)
    for experiment in shown:
        console.print(f"[bold]{experiment.name:{width}}[/]{experiment.summary}", highlight=False)
    if suite is not None:
        return
    console.print(
        "\nsuites, to compare solvers on (workbench run SUITE --list names their problems)"
    )
    for name, members in SUITES.items():
        text = f"{len(members)} {SUMMARIES[name]}"
        console.print(f"[bold]{name:{width}}[/]{text}", highlight=False)


def carry_out(
    console: Console,
    experiment: Experiment,
    solver: Solver | None,
    compare: bool,
    out: Path,
    verbose: bool = False,
) -> tuple[Values, Path]:
    """Run an experiment, print its summary, and write its report: the values, and the folder.

    After an interrupt the report holds what was found until then, and the exit code is 130.
    """
    folder = folder_to_write(out, experiment.name, experiment.source)
    with LiveTrace(console, verbose) as trace:
        outcome = run_experiment(
            experiment,
            solver,
            compare=compare,
            callback=trace,
            progress=lambda text: console.print(f"[dim]{escape(text)}[/]", highlight=False),
        )
    print_outcome(console, outcome)
    console.print("[dim]writing the report[/]")
    print_page(console, "report", write_report(outcome, folder))
    if outcome.interrupted:
        raise Interrupted("interrupted; the report holds what was found until then")
    return outcome.values, folder


def solved(console: Console, setup: Setup, solver: Solver) -> Values:
    """Solve a setup, say how that ended, and return the values of all blocks at the end."""
    console.print("[dim]solving[/]")
    solution = solver.solve(setup.problem, setup.start)
    said = f"{solution.status.name}, cost {solution.cost:.6g}"
    console.print(f"[dim]{said}: {escape(solution.message)}[/]", soft_wrap=True)
    return setup.start | solution.values


def solver_named(name: str) -> Solver:
    """A solver of the catalogue, or that of a Python file. Raises UnknownName or BadFile."""
    first, *others = named_solvers((name,))
    if others:
        several = joined([first.called, *(one.called for one in others)])
        raise BadFile(f"{name} defines several solvers: {several}; say `solver = ...` for one")
    return first.solver


def settings(texts: list[str] | None) -> dict[str, str]:
    """The values typed after each --set, by name. Raises BadArgument without an equals sign."""
    found = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals:
            raise BadArgument(f"--set takes NAME=VALUE, such as frame=60; not {text!r}")
        found[name] = value
    return found
