"""What is shown while a solver works, and what is said when it is done."""

from types import TracebackType

import numpy as np
from rich.console import Console
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
from workbench.solvers import Iterate, Solution
from workbench.solvers.starts import AS_GOOD

ROWS = 12  # of the residuals with the highest cost


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
    """How each solver ended: what decides comes first, and the page has the rest."""
    columns: Columns[tuple[str, Solution]] = {
        "solver": lambda of: of[0],
        "status": lambda of: status_said(outcome, of[0]).upper(),
        "cost": lambda of: _typed(number(of[1].cost, 8)),
        "seconds": lambda of: f"{of[1].seconds:.2f}",
    }
    table = rich_table(Table.of(outcome.compared.items(), columns, (2, 3)))
    for row, (name, solution) in zip(table.rows, outcome.compared.items(), strict=True):
        good = solution.converged and outcome.excess(name) <= AS_GOOD
        row.style = "" if good else "yellow"
    return table
