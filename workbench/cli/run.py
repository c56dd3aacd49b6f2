"""`workbench run`: an experiment from its name or file to a report."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.leaving import Interrupted
from workbench.cli.progress import LiveTrace, print_outcome
from workbench.errors import BadArgument, UnknownName, WorkbenchError
from workbench.experiments import EXPERIMENTS, SUITES, Experiment, find
from workbench.experiments import run as run_experiment
from workbench.experiments.own_file import BESIDE, ENOUGH
from workbench.experiments.suites import SUMMARIES
from workbench.reports import refuse_foreign, write_report
from workbench.solvers import SOLVERS, Solver

Name = Annotated[
    str,
    typer.Argument(
        help=f"One of {', '.join(EXPERIMENTS)}, a problem of a suite (run --list), or a Python "
        f"file that defines {ENOUGH}; {BESIDE}."
    ),
]
Setting = Annotated[
    list[str] | None,
    typer.Option("--set", help="An argument of the experiment: frame=60, noise=0.001, ..."),
]
Out = Annotated[Path, typer.Option(help="Folder that the run's own folder is written into.")]
SolverName = Annotated[str, typer.Option("--solver", help=f"One of {', '.join(SOLVERS)}.")]
SOLVER = "levenberg-marquardt"  # that is taken if none is named
Compare = Annotated[bool, typer.Option(help="Solve with the other solvers as well.")]


def run(
    name: Name = "balance",
    setting: Setting = None,
    solver: SolverName = SOLVER,
    compare: Compare = True,
    out: Out = Path("runs"),
    listing: Annotated[
        bool, typer.Option("--list", help="Name the experiments, or those of a suite; run nothing.")
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
    carry_out(console, find(name, settings(setting)), solver_named(solver), compare, out)


def print_list(console: Console, suite: Sequence[Experiment] | None) -> None:
    """The problems of a suite; or the experiments, and the suites as such."""
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
        told = f"{len(members)} {SUMMARIES[name]}"
        console.print(f"[bold]{name:{width}}[/]{told}", highlight=False)


def carry_out(
    console: Console, experiment: Experiment, solver: Solver, compare: bool, out: Path
) -> None:
    """Run, print the summary, write the report, say where it is.

    After an interrupt the report holds what there was by then, and the exit code is 130.
    """
    make_folder(out)
    refuse_foreign(out / experiment.name, experiment.source)  # before the work, not after it
    with LiveTrace(console) as trace:
        outcome = run_experiment(
            experiment,
            solver,
            compare=compare,
            callback=trace,
            progress=lambda text: console.print(f"[dim]{escape(text)}[/]", highlight=False),
        )
    print_outcome(console, outcome)
    console.print("[dim]writing the report[/]")
    page = write_report(outcome, out / experiment.name)
    console.print(f"report: [bold]{escape(str(page))}[/]", soft_wrap=True)
    if outcome.interrupted:
        raise Interrupted("interrupted; the report holds what was found until then")


def solver_named(name: str) -> Solver:
    """A solver of the catalogue."""
    if name not in SOLVERS:
        raise UnknownName("solver", name, SOLVERS)
    return SOLVERS[name]


def make_folder(folder: Path) -> None:
    """Make the folder that runs go to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WorkbenchError(
            f"cannot make the folder {folder}: {error.strerror}; give another with --out"
        ) from error


def settings(texts: list[str] | None) -> dict[str, str]:
    """What was typed after each --set, by name."""
    found = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals:
            raise BadArgument(f"--set takes NAME=VALUE, such as frame=60; not {text!r}")
        found[name] = value
    return found
