"""`workbench run` and `workbench live`, and what they print."""

import webbrowser
from pathlib import Path
from types import TracebackType
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from workbench.blocks import Values
from workbench.cli import Interrupted
from workbench.cli.console import folder_to_write, print_page, rich_table, say_notes, warn_of
from workbench.comparison.design import named_solvers
from workbench.diagnostics import Diagnosis
from workbench.diagnostics.words import counted
from workbench.errors import BadArgument, BadFile, joined
from workbench.experiments import EXPERIMENTS, SUITES, Experiment, find
from workbench.experiments import run as run_experiment
from workbench.experiments.catalogue import SUMMARIES
from workbench.experiments.experiment import REQUIRED_NAMES
from workbench.experiments.running import Outcome
from workbench.fitting.doubts import doubts
from workbench.fitting.setup import Setup
from workbench.reports import write_report
from workbench.reports.page import Columns, Table, number
from workbench.reports.replays import live_server
from workbench.reports.run import (
    better_sentence,
    interruption_sentence,
    measurements_table,
    priors_sentence,
    residuals_table,
    status_in_words,
)
from workbench.solvers import DEFAULT, Iterate, Solution, Solver
from workbench.solvers.starts import AS_GOOD

Name = Annotated[
    str,
    typer.Argument(
        help="An experiment, a problem of a suite (`run --list` names them), or a Python file that "
        f"defines {REQUIRED_NAMES}."
    ),
]
Setting = Annotated[
    list[str] | None,
    typer.Option("--set", help="An argument of it, such as noise=0.001; may be repeated."),
]
Out = Annotated[Path, typer.Option(help="Folder in which the results get a folder.")]
SolverName = Annotated[
    str, typer.Option("--solver", help="A solver, or a Python file that defines one.")
]
Compare = Annotated[
    bool,
    typer.Option(help="Also solve with the other solvers that the problem names, and compare."),
]


def run(
    name: Name = "balance",
    setting: Setting = None,
    solver: SolverName = DEFAULT,
    compare: Compare = True,
    out: Out = Path("runs"),
    listing: Annotated[
        bool, typer.Option("--list", help="Only list the experiments, or the problems of a suite.")
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
        lines = [(entry.name, entry.summary) for entry in SUITES.get(name, EXPERIMENTS.values())]
        if name not in SUITES:
            lines.append(("suites", "run SUITE --list names their problems:"))
            lines += [(s, f"{len(several)} {SUMMARIES[s]}") for s, several in SUITES.items()]
        width = 2 + max(len(entry) for entry, _ in lines)
        for entry, text in lines:
            console.print(f"[bold]{entry:{width}}[/]{text}", highlight=False)
        return
    carry_out(console, find(name, settings(setting)), solver_named(solver), compare, out, verbose)


def carry_out(
    console: Console,
    experiment: Experiment,
    solver: Solver | None,
    compare: bool,
    out: Path,
    verbose: bool = False,
) -> Values:
    """Run an experiment, print its summary, and write its report into a folder of its name.

    Returns the values of all blocks. After an interrupt the report holds the best point until
    then, and the exit code is 130.
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
    return outcome.values


def prepare(
    console: Console, name: str, setting: list[str] | None, out: Path, kind: str
) -> tuple[Experiment, Setup, Path]:
    """An experiment, its setup, and the folder of what a command of a kind writes about it."""
    experiment = find(name, settings(setting))
    folder = folder_to_write(out, f"{experiment.name}-{kind}", experiment.source)
    return experiment, build_setup(console, experiment), folder


def build_setup(console: Console, experiment: Experiment) -> Setup:
    """The setup of an experiment; says that it is being built, which may take long."""
    console.print(f"[dim]building {escape(experiment.name)}[/]", highlight=False)
    return experiment.setup()


def solve_setup(console: Console, setup: Setup, solver: Solver) -> tuple[Values, tuple[str, ...]]:
    """Solve a setup and say how that ended: the values of all blocks at the end, and doubts."""
    console.print("[dim]solving[/]")
    solution = solver.solve(setup.problem, setup.start)
    outcome = f"{solution.status.name}, cost {solution.cost:.6g}"
    console.print(f"[dim]{outcome}: {escape(solution.message)}[/]", soft_wrap=True)
    values = setup.start | solution.values
    doubted = doubts(setup, values, solution, again=False)
    warn_of(console, doubted)
    return values, doubted


def solver_named(name: str) -> Solver:
    """A solver of the catalogue, or that of a Python file. Raises UnknownName or BadFile."""
    first, *others = named_solvers((name,))
    if others:
        several = joined([first.called, *(solver.called for solver in others)])
        raise BadFile(f"{name} defines several solvers: {several}; say `solver = ...` for one")
    return first.solver


def settings(texts: list[str] | None) -> dict[str, str]:
    """The values typed after each --set, by name. Raises BadArgument without an equals sign."""
    values_by_name = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals:
            raise BadArgument(f"--set takes NAME=VALUE, such as frame=60; not {text!r}")
        values_by_name[name] = value
    return values_by_name


MOST_RESIDUALS = 12  # of the residuals with the highest cost


class LiveTrace:
    """The latest iterate in one line that is written over; nothing where nobody watches.

    With `every`, a line for each iterate stays.
    """

    def __init__(self, console: Console, every: bool = False) -> None:
        self._console, self._every, self._count = console, every, 0
        watched = console.is_terminal and not every
        self._status = console.status("solving") if watched else None

    def __enter__(self) -> "LiveTrace":
        if self._status:
            self._status.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        if self._status:
            self._status.stop()

    def __call__(self, iterate: Iterate) -> None:
        """Show one more iterate."""
        number, self._count = self._count, self._count + 1
        line = (
            f"iteration {number:>5}  cost {iterate.cost:<12.6g} optimality "
            f"{iterate.optimality:.1e}  step {iterate.step_norm:.1e}"
        )
        if self._status:
            self._status.update(line)
        elif self._every:
            self._console.print(line, highlight=False)


def print_outcome(console: Console, outcome: Outcome) -> None:
    """The summary of a run."""
    solution = outcome.solution
    good = solution.converged and outcome.better is None and not outcome.doubts
    warn_of(console, outcome.doubts)
    console.print(
        f"[bold {'green' if good else 'yellow'}]{solution.status.name}[/] after "
        f"{solution.iterations} iterations, {solution.seconds:.2f} s, cost {solution.cost:.6g}: "
        f"{escape(solution.message)}"
    )
    for sentence in (better_sentence(outcome), interruption_sentence(outcome)):
        if sentence:
            console.print(f"[bold yellow]{escape(sentence)}[/]", highlight=False)
    if outcome.setup.synthetic:
        console.print(f"synthetic data: {escape(outcome.setup.synthetic)}", highlight=False)
    say_notes(console, outcome.setup.notes)
    table = RichTable(box=None, show_header=False)
    table.add_column()
    table.add_column(justify="right")
    table.add_column()
    table.add_column(style="dim")
    for measure in outcome.measures:
        value = f"{measure.value:.3g}" if np.isfinite(measure.value) else "-"
        over = f"over {measure.over}" if measure.over else ""
        table.add_row(escape(measure.name), value, measure.unit, escape(over))
    console.print(table)
    if outcome.measurements:
        console.print(rich_table(measurements_table(outcome.measurements)))
    _print_residuals(console, outcome)
    console.print(escape(_rank_line("Jacobian", outcome.diagnosis)))
    if outcome.data_alone is not None:
        console.print(escape(_rank_line("without the priors", outcome.data_alone)))
    if len(outcome.compared) > 1:
        console.print(_comparison(outcome))


def _print_residuals(console: Console, outcome: Outcome) -> None:
    """Print the residuals with the highest costs."""
    table = residuals_table(outcome)
    rows = sorted(zip(outcome.costs.values(), table.rows, strict=True), key=lambda row: -row[0])
    shown = {row for _, row in rows[:MOST_RESIDUALS]}
    kept = tuple(row for row in table.rows if row in shown)
    console.print(rich_table(Table(table.head, kept, table.numbers)))
    if len(rows) > MOST_RESIDUALS:
        console.print(f"and {len(rows) - MOST_RESIDUALS} residuals with less cost (see the report)")
    console.print(escape(priors_sentence(outcome)), highlight=False)


def _rank_line(what: str, d: Diagnosis) -> str:
    """Size and rank, and the first null and weak directions."""
    m, n = d.shape
    sentence = "every direction changes a residual"
    if d.null_directions:
        sentence = f"no residual changes along {counted(len(d.null_directions), 'direction')}"
    if d.weak_count:
        sentence += (
            f"; along {d.weak_count} more, a change by a whole characteristic scale (such as 1 "
            "rad) changes the residuals by less than one sigma"
        )
    directions = (*d.null_directions, *d.weak_directions)
    named = [x.name.partition(":")[0] for x in directions if x.joints]  # without their entries
    short = list(dict.fromkeys(named))[:3]
    if short:
        sentence += f"; among them {', '.join(short)} (see the report)"
    return f"{what}: {m} x {n}, {d.density:.0%} nonzero, rank {d.rank} of {n}; {sentence}"


def _comparison(outcome: Outcome) -> RichTable:
    """How each solver ended: what decides comes first, and the page has the rest."""
    columns: Columns[tuple[str, Solution]] = {
        "solver": lambda of: of[0],
        "status": lambda of: status_in_words(outcome, of[0]).upper(),
        "cost": lambda of: number(of[1].cost, 8),
        "seconds": lambda of: f"{of[1].seconds:.2f}",
    }
    table = rich_table(Table.of(outcome.compared.items(), columns, (2, 3)))
    for row, (name, solution) in zip(table.rows, outcome.compared.items(), strict=True):
        good = solution.converged and outcome.excess(name) <= AS_GOOD
        row.style = "" if good else "yellow"
    return table


def live(
    name: Name = "balance",
    setting: Setting = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Of the page; 0 takes a free one.")
    ] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Move a body by hand, pick a solver, and watch its iterates come in; until Ctrl-C."""
    console = Console()
    experiment = find(name, settings(setting))
    setup = build_setup(console, experiment)
    try:
        server = live_server(experiment.name, setup, port)
    except OSError as error:
        raise BadArgument(
            f"port {port} cannot be used ({error.strerror}); leave --port out to take a free one"
        ) from error
    console.print(f"open {server.address}", soft_wrap=True, highlight=False)
    console.print("[dim]Ctrl-C ends it[/]")
    if browser:
        webbrowser.open(server.address)
    try:
        server.serve()
    except KeyboardInterrupt:
        console.print("[dim]ended[/]")
