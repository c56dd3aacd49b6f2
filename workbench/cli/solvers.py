"""`workbench solvers`: who there is, what each needs and what it can."""

from collections.abc import Mapping

import typer
from rich.console import Console
from rich.table import Table

from workbench.solvers import SOLVERS, Abilities, Boxes, Derivative
from workbench.solvers.nlopt_algorithms import ALGORITHMS

ASKED = {
    Derivative.COST: "cost",
    Derivative.GRADIENT: "gradient",
    Derivative.JACOBIAN: "Jacobian",
    Derivative.HESSIAN: "Hessian",
}
BOUNDS = {Boxes.UNKNOWN: "no", Boxes.TAKEN: "yes", Boxes.NEEDED: "needed"}


def solvers(
    nlopt: bool = typer.Option(False, help="The algorithms of NLopt, by NLopt's own names."),
) -> None:
    """List the solvers: derivatives asked for, bounds, constraints, where they look, sources."""
    listed = ALGORITHMS if nlopt else {name: s.abilities for name, s in SOLVERS.items()}
    console = Console()
    console.print(_table(listed), highlight=False, markup=False)
    if nlopt:
        console.print('In Python: Nlopt("LD_LBFGS").', highlight=False)


def _table(listed: Mapping[str, Abilities]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0))
    table.add_column("solver", style="bold", no_wrap=True)
    for title in ("asks for", "bounds", "constraints", "looks"):
        table.add_column(title, no_wrap=True)
    table.add_column("described in", overflow="fold")
    for name, a in listed.items():
        table.add_row(
            name, ASKED[a.derivative], BOUNDS[a.bounds], _constraints(a), _looks(a), _described(a)
        )
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
