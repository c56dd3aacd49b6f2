"""What is shown while a solver works, and what is said when it is done."""

from types import TracebackType

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.markup import escape
from rich.table import Table as RichTable

from workbench.cli.output import rich_table, warn_of
from workbench.diagnostics import Diagnosis
from workbench.experiments.running import Outcome
from workbench.reports.page import Columns, Table, number
from workbench.reports.run import (
    better_said,
    interrupted_said,
    priors_said,
    residuals_table,
    status_said,
)
from workbench.solvers import Iterate
from workbench.solvers.starts import AS_GOOD

ROWS = 12  # of the live table; the whole trace is in the report


class LiveTrace:
    """A table of the last iterates, redrawn as they come; plain lines where nobody watches."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._iterates: list[tuple[int, Iterate]] = []
        self._count = 0
        self._live = Live(console=console, auto_refresh=False) if console.is_terminal else None

    def __enter__(self) -> "LiveTrace":
        if self._live:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        if self._live:
            self._live.stop()

    def __call__(self, iterate: Iterate) -> None:
        """Show one more iterate."""
        number, self._count = self._count, self._count + 1
        if self._live:
            self._iterates = [*self._iterates[-ROWS + 1 :], (number, iterate)]
            self._live.update(self._table(), refresh=True)
        else:
            if number == 0:
                self._console.print(f"{'iteration':>9} {'cost':>14} {'optimality':>10} {'step':>9}")
            self._console.print(
                f"{number:>9} {iterate.cost:>14.6g} {iterate.optimality:>10.1e} "
                f"{iterate.step_norm:>9.1e}"
            )

    def _table(self) -> RichTable:
        columns: Columns[tuple[int, Iterate]] = {
            "iteration": lambda of: str(of[0]),
            "cost": lambda of: f"{of[1].cost:.6g}",
            "optimality": lambda of: f"{of[1].optimality:.1e}",
            "step": lambda of: f"{of[1].step_norm:.1e}",
            "damping": lambda of: f"{of[1].damping:.1e}",
            "seconds": lambda of: f"{of[1].seconds:.2f}",
        }
        return rich_table(Table.of(self._iterates, columns, tuple(range(6))))


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
    for said in (better_said(outcome), interrupted_said(outcome)):
        if said:
            console.print(f"[bold yellow]{escape(_typed(said))}[/]", highlight=False)
    if outcome.setup.synthetic:
        console.print(f"synthetic data: {escape(outcome.setup.synthetic)}", highlight=False)
    for note in outcome.setup.notes:
        console.print(f"note: {escape(note)}", highlight=False)
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
    _print_residuals(console, outcome)
    console.print(escape(_seen("Jacobian", outcome.diagnosis)))
    if outcome.data_alone is not None:
        console.print(escape(_seen("without the priors", outcome.data_alone)))
    if len(outcome.compared) > 1:
        console.print(_comparison(outcome))


def _print_residuals(console: Console, outcome: Outcome) -> None:
    """Print the cost of each residual; if there are many, only of those with the highest cost."""
    found = residuals_table(outcome)
    rows = sorted(zip(outcome.costs.values(), found.rows, strict=True), key=lambda row: -row[0])
    shown = {row for _, row in rows[:ROWS]}
    typed = tuple(tuple(map(_typed, row)) for row in found.rows if row in shown)
    console.print(rich_table(Table(found.head, typed, found.numbers)))
    if len(rows) > ROWS:
        console.print(f"and {len(rows) - ROWS} residuals with less cost (see the report)")
    console.print(escape(priors_said(outcome)), highlight=False)


def _typed(text: str) -> str:
    """As every terminal can show it."""
    return text.replace("−", "-").replace("–", "-").replace("∞", "inf")


def _seen(what: str, d: Diagnosis) -> str:
    """Size and rank, and the first null and weak directions."""
    m, n = d.shape
    said = "every direction changes a residual"
    if d.null_directions:
        said = f"{len(d.null_directions)} directions change no residual"
    if d.weak_count:
        said += (
            f"; along {d.weak_count} more, a change by a whole characteristic scale (such as 1 "
            "rad) changes the residuals by less than one sigma"
        )
    named = [x.name for x in (*d.null_directions, *d.weak_directions) if x.joints]
    short = list(dict.fromkeys(named))[:3]
    if short:
        said += f"; among them {', '.join(short)} (see the report)"
    return f"{what}: {m} x {n}, {d.density:.0%} nonzero, rank {d.rank} of {n}; {said}"


def _comparison(outcome: Outcome) -> RichTable:
    table = RichTable(box=None, header_style="bold")
    table.add_column("solver", no_wrap=True)
    for column in ("cost", "over best", "steps", "calls", "s"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("status")
    for name, s in outcome.compared.items():
        table.add_row(
            name,
            _typed(number(s.cost, 8)),
            _typed(number(outcome.excess(name), 1)),
            str(s.iterations),
            str(s.evaluations.total),
            f"{s.seconds:.2f}",
            status_said(outcome, name).upper(),
            style="" if s.converged and outcome.excess(name) <= AS_GOOD else "yellow",
        )
    return table
