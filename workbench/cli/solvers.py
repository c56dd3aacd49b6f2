"""`workbench solvers`: the solvers, what each needs and what each can."""

from collections.abc import Mapping

import typer
from rich.console import Console
from rich.table import Table

from workbench.experiments import find
from workbench.solvers import SOLVERS, Abilities, Boxes, Derivative
from workbench.solvers.choice import recommend
from workbench.solvers.nlopt_algorithms import ALGORITHMS

ASKED = {
    Derivative.COST: "cost",
    Derivative.GRADIENT: "gradient",
    Derivative.JACOBIAN: "Jacobian",
    Derivative.HESSIAN: "Hessian",
}
WIDE = 120  # columns of a terminal, for everything in one table
BOUNDS = {Boxes.UNKNOWN: "no", Boxes.TAKEN: "yes", Boxes.NEEDED: "needed"}


def solvers(
    nlopt: bool = typer.Option(
        False, help="List the algorithms of NLopt instead, by NLopt's own names."
    ),
    problem: str | None = typer.Option(
        None, "--for", help="Recommend solvers for an experiment or a Python file, with reasons."
    ),
) -> None:
    """List the solvers: their derivatives, bounds, constraints, kind of search, and sources.

    With --for, recommend one for a problem from its size, structure, bounds and conditioning.
    benchmarks/SOLVERS.md compares solvers on problems of each kind.
    """
    if problem is not None:
        setup = find(problem).setup()
        print(recommend(setup.problem, setup.start))
        return
    listed = ALGORITHMS if nlopt else {name: s.abilities for name, s in SOLVERS.items()}
    console = Console()
    wide = console.width >= WIDE
    console.print(_abilities(listed, with_sources=wide), highlight=False, markup=False)
    if not wide:
        console.print()
        console.print(_sources(listed), highlight=False, markup=False)
    if nlopt:
        console.print('In Python: Nlopt("LD_LBFGS").', highlight=False)


def _abilities(listed: Mapping[str, Abilities], *, with_sources: bool) -> Table:
    table = _table("asks for", "bounds", "constraints", "looks")
    if with_sources:
        table.add_column("described in")
    for name, a in listed.items():
        cells = ASKED[a.derivative], BOUNDS[a.bounds], _constraints(a), _looks(a), _described(a)
        table.add_row(name, *cells[: None if with_sources else -1])
    return table


def _sources(listed: Mapping[str, Abilities]) -> Table:
    """A table of its own where a terminal is narrow."""
    table = _table()
    table.add_column("described in")
    for name, a in listed.items():
        table.add_row(name, _described(a))
    return table


def _table(*titles: str) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0))
    table.add_column("solver", style="bold", no_wrap=True)
    for title in titles:
        table.add_column(title, no_wrap=True)
    return table


def _constraints(a: Abilities) -> str:
    """`=` equations, `<` inequalities."""
    return " ".join(sign for sign, can in (("=", a.equations), ("<", a.inequalities)) if can) or "-"


def _looks(a: Abilities) -> str:
    where = "everywhere" if a.is_global else "downhill"
    return f"{where}, with dice" if a.stochastic else where


def _described(a: Abilities) -> str:
    notes = [a.source, "to teach" if a.teaching else "", a.note]
    return "; ".join(note for note in notes if note)
