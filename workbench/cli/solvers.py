"""`workbench solvers`: the solvers, what each needs and what each can do."""

import typer
from rich.console import Console

from workbench.cli.output import solver_table
from workbench.experiments import find
from workbench.reports.page import Columns, Table
from workbench.solvers import SOLVERS, Abilities, Boxes, Derivative
from workbench.solvers.choice import recommend
from workbench.solvers.nlopt import ALGORITHMS

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
    """List the solvers: derivatives, bounds, constraints, kind of search, first step, and sources.

    With --for, recommend one for a problem from its size, structure, bounds and conditioning.
    benchmarks/SOLVERS.md compares solvers on problems of each kind.
    """
    if problem is not None:
        setup = find(problem).setup()
        print(recommend(setup.problem, setup.start))
        return
    listed = ALGORITHMS if nlopt else {name: s.abilities for name, s in SOLVERS.items()}
    console, heads = Console(), [*COLUMNS]
    wide = console.width >= WIDE
    tables = [heads] if wide else [heads[:-2], [heads[0], *heads[-2:]]]
    for i, shown in enumerate(tables):
        if i:
            console.print()
        table = Table.of(listed.items(), {head: COLUMNS[head] for head in shown}, ())
        console.print(solver_table(table), highlight=False)
    console.print("constraints: = equations, < inequalities", highlight=False)
    if nlopt:
        console.print('In Python: Nlopt("LD_LBFGS").', highlight=False)


def _constraints(a: Abilities) -> str:
    """`=` equations, `<` inequalities."""
    return " ".join(sign for sign, can in (("=", a.equations), ("<", a.inequalities)) if can) or "-"


def _looks(a: Abilities) -> str:
    where = "everywhere" if a.is_global else "downhill"
    return f"{where}, at random" if a.stochastic else where


def _described(a: Abilities) -> str:
    notes = [a.source, "for teaching" if a.teaching else "", a.note]
    return "; ".join(note for note in notes if note)


COLUMNS: Columns[tuple[str, Abilities]] = {
    "solver": lambda of: of[0],
    "evaluates": lambda of: ASKED[of[1].derivative],
    "bounds": lambda of: BOUNDS[of[1].bounds],
    "constraints": lambda of: _constraints(of[1]),
    "searches": lambda of: _looks(of[1]),
    "first step": lambda of: of[1].first_step,
    "described in": lambda of: _described(of[1]),
}
