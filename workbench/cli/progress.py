"""What is shown while a solver works, and what is said when it is done."""

from types import TracebackType

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.markup import escape
from rich.table import Table

from workbench.diagnostics import Diagnosis
from workbench.experiments.experiment import Outcome
from workbench.solvers import Iterate, Status

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
        else:
            self._console.print(f"{'iteration':>9} {'cost':>14} {'gradient':>9} {'step':>9}")
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
            self._console.print(
                f"{number:>9} {iterate.cost:>14.6g} {iterate.optimality:>9.1e} "
                f"{iterate.step_norm:>9.1e}"
            )

    def _table(self) -> Table:
        table = Table(box=None, header_style="bold")
        for column in ("iteration", "cost", "gradient", "step", "damping", "seconds"):
            table.add_column(column, justify="right")
        for number, i in self._iterates:
            table.add_row(
                str(number), f"{i.cost:.6g}", f"{i.optimality:.1e}", f"{i.step_norm:.1e}",
                f"{i.damping:.1e}", f"{i.seconds:.2f}",
            )  # fmt: skip
        return table


def print_outcome(console: Console, outcome: Outcome) -> None:
    """The summary of a run."""
    solution = outcome.solution
    colour = "green" if solution.converged else "yellow"
    console.print(
        f"[bold {colour}]{solution.status.name}[/] after {solution.iterations} iterations, "
        f"{solution.seconds:.2f} s, cost {solution.cost:.6g}: {escape(solution.message)}"
    )
    table = Table(box=None, show_header=False)
    table.add_column()
    table.add_column(justify="right")
    table.add_column()
    for measure in outcome.measures:
        value = f"{measure.value:.3g}" if np.isfinite(measure.value) else "-"
        table.add_row(escape(measure.name), value, measure.unit)
    console.print(table)
    console.print(escape(_seen("Jacobian", outcome.diagnosis)))
    if outcome.data_alone is not None:
        console.print(escape(_seen("without the priors", outcome.data_alone)))
    if outcome.compared:
        console.print(_comparison(outcome))


def _seen(what: str, d: Diagnosis) -> str:
    """Size, rank and the first directions that are not seen."""
    m, n = d.shape
    unseen = "every direction is seen"
    if d.null_directions:
        short = [direction.name for direction in d.null_directions if direction.joints][:3]
        named = f", among them {', '.join(short)}" if short else ""
        unseen = f"{len(d.null_directions)} directions are not seen{named} (see the report)"
    return f"{what}: {m} x {n}, {d.density:.0%} nonzero, rank {d.rank} of {n}; {unseen}"


def _comparison(outcome: Outcome) -> Table:
    best = min((s.cost for s in outcome.compared.values()), default=np.nan)
    table = Table(box=None, header_style="bold")
    table.add_column("solver", no_wrap=True)
    for column in ("cost", "over best", "steps", "calls", "s"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("status", no_wrap=True)
    for name, s in outcome.compared.items():
        counts = s.evaluations
        total = counts.residual + counts.gradient + counts.jacobian + counts.hessian
        above = (s.cost - best) / best if best > 0 else s.cost - best
        style = "" if s.status is Status.CONVERGED else "yellow"
        row = (name, f"{s.cost:.8g}", f"{above:.0e}", str(s.iterations), str(total))
        table.add_row(*row, f"{s.seconds:.2f}", s.status.name, style=style)
    return table
