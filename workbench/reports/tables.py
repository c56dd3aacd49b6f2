"""The tables of a report, as rows of text."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from workbench.blocks import Block
from workbench.diagnostics import Diagnosis, Direction
from workbench.diagnostics.structure import TermBlock
from workbench.diagnostics.words import gathered
from workbench.diagnostics.words import table as lines_of
from workbench.errors import joined, some_of
from workbench.experiments.running import Outcome, ending_in_words
from workbench.fitting.setup import Measure
from workbench.residuals import Residual
from workbench.solvers import Hypothesis, Solution, Status
from workbench.solvers.starts import AS_GOOD

SMALL = 24  # entries of a block that is listed number by number
MOST = 3000  # entries of one that is listed row by row; what is larger is in the .npz alone
MOST_STARTS = 12  # that are listed by number
Row = tuple[str, ...]
T = TypeVar("T")
Columns = Mapping[str, Callable[[T], str]]


@dataclass(frozen=True)
class Table:
    """Headings and rows of text, and which columns hold numbers: those stand to the right."""

    head: Row
    rows: tuple[Row, ...]
    numbers: tuple[int, ...] = (1,)

    @classmethod
    def of(cls, things: Iterable[T], columns: Columns[T], numbers: tuple[int, ...] = (1,)) -> Table:
        """A row for each of the things; a column is a heading and the function of its cells."""
        rows = tuple(tuple(cell(thing) for cell in columns.values()) for thing in things)
        return cls(tuple(columns), rows, numbers)

    def lines(self) -> list[str]:
        """The table for a terminal: its columns two spaces apart."""
        return [line.replace("−", "-") for line in lines_of(self.head, self.rows, self.numbers)]


def number(value: float, digits: int = 4) -> str:
    """A number as text, such as `12.35` or `3.1e-11`; a dash if it is not a number."""
    if not math.isfinite(value):
        return "∞" if value == math.inf else "–"
    return f"{value:.{digits}g}".replace("-", "−")


def measures_table(measures: tuple[Measure, ...]) -> Table:
    """The measures with their units, and what each is a mean over."""
    rows = tuple((m.name, number(m.value), _told(m.unit), m.over) for m in measures)
    if any(m.over for m in measures):
        return Table(("measure", "value", "unit", "mean over"), rows)
    return Table(("measure", "value", "unit"), tuple(row[:3] for row in rows))


def residuals_table(outcome: Outcome) -> Table:
    """The part of the cost that each residual makes up, and which residuals are priors."""
    setup, costs, whole = outcome.setup, outcome.costs, sum(outcome.costs.values())
    columns: Columns[Residual] = {
        "residual": lambda r: r.name,
        "kind": lambda r: "prior" if r.name in setup.priors else "data",
        "rows": lambda r: f"{r.size:,}",
        "sigma": lambda r: _sigma(r.sigma),
        "unit": lambda r: _told(r.unit),
        "cost": lambda r: number(costs[r.name]),
        "share": lambda r: f"{costs[r.name] / whole:.1%}" if whole else "–",
    }
    return Table.of(setup.problem.residuals, columns, (2, 3, 5, 6))


def priors_said(outcome: Outcome) -> str:
    """Which residuals are priors, and their share of the cost, in a sentence."""
    priors = outcome.setup.priors
    if not priors:
        return "The setup names no residual as a prior."
    prior, make = ("prior", "makes") if len(priors) == 1 else ("priors", "make")
    share = f"{outcome.prior_share:.1%}" if math.isfinite(outcome.prior_share) else "nothing"
    return f"The {prior}, {joined(priors)}, {make} up {share} of the cost at the end."


def better_said(outcome: Outcome) -> str:
    """That another solver found a lower cost, and by how much; empty if none did."""
    if outcome.better is None:
        return ""
    own, other = outcome.solution.cost, outcome.compared[outcome.better].cost
    return (
        f"{outcome.better} found a lower cost from the same start: {number(other, 6)}, which is "
        f"{number(own - other)} ({(own - other) / own:.1%}) less than {outcome.solver} found. This "
        "end is not the best one known."
    )


def interrupted_said(outcome: Outcome) -> str:
    """That an interrupt ended the run early, and what is missing; empty if none did."""
    if not outcome.interrupted:
        return ""
    lacks = f"; not run: {', '.join(outcome.skipped)}" if outcome.skipped else ""
    what = "run" if outcome.solution.status is Status.STOPPED else "comparison of solvers"
    return f"The {what} was cut short from the keyboard{lacks}."


def status_said(outcome: Outcome, solver: str) -> str:
    """How a solver ended, in words: `converged, not lowest` if another one found a lower cost."""
    return ending_in_words(outcome.compared[solver].status, outcome.excess(solver) > AS_GOOD)


def solvers_table(outcome: Outcome) -> Table:
    """How each solver ended, with its time and its evaluations."""
    columns: Columns[tuple[str, Solution]] = {
        "solver": lambda of: of[0],
        "status": lambda of: status_said(outcome, of[0]),
        "seconds": lambda of: f"{of[1].seconds:.2f}",
        "cost": lambda of: number(of[1].cost, 8),
        "above the best": lambda of: number(outcome.excess(of[0]), 2),
        "optimality": lambda of: number(of[1].optimality, 2),
        "iterations": lambda of: str(of[1].iterations),
        "residuals": lambda of: str(of[1].evaluations.residual),
        "gradients": lambda of: str(of[1].evaluations.gradient),
        "Jacobians": lambda of: str(of[1].evaluations.jacobian),
        "Hessians": lambda of: str(of[1].evaluations.hessian),
    }
    return Table.of(outcome.compared.items(), columns, tuple(range(2, 11)))


def ending_said(solution: Solution) -> tuple[str, str]:
    """How a run ended: what its status means, and what the solver adds to that.

    The message of a run that has converged says itself what was found out, which is less after a
    large gradient tolerance.
    """
    advice, message = solution.status.value, solution.message
    if message.startswith(advice):
        return advice, message.removeprefix(advice).lstrip("; ")
    return (message, "") if solution.converged else (advice, message)


def hypotheses_table(solution: Solution) -> Table:
    """The minima that several starts led to."""
    columns: Columns[tuple[int, Hypothesis]] = {
        "minimum": lambda of: str(of[0]),
        "cost": lambda of: number(of[1].cost, 8),
        "starts": lambda of: str(len(of[1].starts)),
        "their numbers": lambda of: some_of(list(map(str, sorted(of[1].starts))), MOST_STARTS),
        "best run": lambda of: ending_in_words(of[1].status, of[0] > 1),
    }
    return Table.of(enumerate(solution.hypotheses, 1), columns, (0, 1, 2))


def terms_table(diagnosis: Diagnosis) -> Table:
    """The Jacobian by term and block, without pairs that do not depend on each other."""
    columns: Columns[TermBlock] = {
        "term": lambda t: t.residual,
        "block": lambda t: t.block,
        "rows": lambda t: f"{t.rows:,}",
        "columns": lambda t: f"{t.columns:,}",
        "nonzeros": lambda t: f"{t.nonzeros:,}",
        "density": lambda t: f"{t.nonzeros / max(1, t.rows * t.columns):.1%}",
        "norm": lambda t: number(t.norm),
    }
    some = [term for term in diagnosis.terms if term.nonzeros]
    return Table.of(some, columns, (2, 3, 4, 5, 6))


def directions_table(diagnosis: Diagnosis) -> Table:
    """The null directions, by name."""
    rows = tuple((d.name, d.kind, number(d.change, 2)) for d in diagnosis.null_directions)
    return Table(("null direction", "kind", "change of the whitened residual"), rows, (2,))


def gathered_directions_table(directions: Sequence[Direction], per: str = "unit") -> Table:
    """Single entries in one row, other directions one by one; `per` is the unit of a change."""
    entries = [x for x in directions if x.kind == "entry"]
    rows = []
    if entries:
        worst = max(x.change for x in entries)
        names = ", ".join(gathered([x.name for x in entries]))
        how_many = "1 single entry" if len(entries) == 1 else f"{len(entries)} single entries"
        rows.append((f"{how_many}: {names}", "entry", f"≤ {number(worst, 2)}"))
    rows += [(x.name, x.kind, number(x.change, 2)) for x in directions if x.kind != "entry"]
    return Table(("direction", "kind", f"|J d|, sigmas per {per}"), tuple(rows), (2,))


def value_tables(outcome: Outcome) -> list[Table]:
    """The free numbers of each small block, one by one."""
    found = []
    for block in outcome.diagnosis.free.blocks:
        if block.size <= SMALL:
            rows = tuple(
                (block.name + block.entry(i), number(float(value)))
                for i, value in enumerate(block.taken(outcome.values[block.name]).ravel())
            )
            found.append(Table((block.name, "value" + _unit(block)), rows))
    return found


def array_tables(outcome: Outcome) -> dict[str, Table]:
    """A table by its title for each free block with rows of three numbers, such as a pose."""
    found = {}
    for block in outcome.diagnosis.free.blocks:
        if SMALL < block.size <= MOST and len(block.shape) == 2 and block.shape[1] == 3:
            unit = _unit(block)
            value = block.taken(outcome.values[block.name])
            labels = None if block.framed else block.labels  # those of a frame's rows
            names = labels or [str(k) for k in range(len(value))]
            rows = tuple(
                (name, *(number(float(x), 3) for x in (*row, np.linalg.norm(row))))
                for name, row in zip(names, value, strict=True)
            )
            head = (block.name, *(axis + unit for axis in "xyz"), "length" + unit)
            found[f"{block.name}: {' × '.join(map(str, block.shape))}{unit}"] = Table(
                head, rows, (1, 2, 3, 4)
            )
    return found


def fixed_table(outcome: Outcome) -> Table:
    """The blocks of which all or some entries are fixed."""
    problem = outcome.setup.problem
    partly_free = " (but for the free entries)"
    columns: Columns[Block] = {
        "block": lambda b: b.name + (partly_free if b.name in problem.free.names else ""),
        "shape": lambda b: " × ".join(map(str, b.shape)) or "1",
        "unit": lambda b: _told(b.unit),
    }
    return Table.of(problem.fixed.blocks, columns, ())


def _unit(block: Block) -> str:
    return "" if block.unit == "1" else f" ({block.unit})"


def _told(unit: str) -> str:
    return "" if unit == "1" else unit


def _sigma(sigma: float | np.ndarray) -> str:
    low, high = float(np.min(sigma)), float(np.max(sigma))
    return number(low, 3) if low == high else f"{number(low, 3)} to {number(high, 3)}"
