"""`workbench design`: what to measure next, and how well everything will be known then."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench import diagnostics
from workbench.cli.bars import Bars
from workbench.cli.output import folder_to_write, print_page, say
from workbench.cli.run import Name, Out, Setting, SolverName, settings, solved, solver_named
from workbench.diagnostics.design import CRITERIA, with_candidates
from workbench.errors import BadArgument, check_known
from workbench.experiments import find
from workbench.fitting.candidates import CANDIDATES, OWN, QUANTITIES, sd_named
from workbench.fitting.refits import checked_by_fits, repeated_fits
from workbench.reports import write_design
from workbench.solvers import DEFAULT


def design(
    name: Name = "balance-monocular",
    setting: Setting = None,
    candidates: Annotated[
        str | None,
        typer.Option(
            help=f"What could be measured, one of {', '.join(CANDIDATES)}. `{OWN}` are the "
            "`candidates` of the file, which are taken where there are any; otherwise cameras."
        ),
    ] = None,
    choose: Annotated[int, typer.Option(help="How many candidates to choose.")] = 1,
    criterion: Annotated[
        str,
        typer.Option(
            help="What should become small: d (the volume of all uncertainty), a (the mean "
            "variance) or e (the worst direction)."
        ),
    ] = "d",
    sd_of: Annotated[
        str | None,
        typer.Option(
            "--sd-of",
            help="Instead, the standard deviation of this: "
            f"{', '.join(QUANTITIES)}, or an entry such as trans\\[z].",
        ),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(help="With --criterion, a block or entry that matters; may be repeated."),
    ] = None,
    points: Annotated[
        int,
        typer.Option(help="Average over this number of points, drawn from the posterior."),
    ] = 1,
    check: Annotated[
        int,
        typer.Option(help="Check --sd-of by so many simulated fits, before and after the choice."),
    ] = 0,
    seed: Annotated[int, typer.Option(help="The same seed gives the same draws.")] = 0,
    solver: SolverName = DEFAULT,
    out: Out = Path("runs"),
) -> None:
    """Say which candidate, or which few, to measure next so that most is known.

    The fit is solved, and every candidate's information is added to it. The page in
    runs/NAME-design/ ranks the candidates, with the standard deviations that they lead to.
    """
    console = Console()
    check_known("criterion", criterion, CRITERIA)
    if candidates is not None:
        check_known("list of candidates", candidates, CANDIDATES)
    _refuse_contradictions(sd_of, over, points, check)
    experiment = find(name, settings(setting))
    by = solver_named(solver)
    folder = folder_to_write(out, f"{experiment.name}-design", experiment.source)
    console.print(f"[dim]building {escape(experiment.name)}[/]")
    setup = experiment.setup()
    values = solved(console, setup, by)
    known = candidates or (OWN if setup.candidates else "cameras")
    given = CANDIDATES[known](setup, values)
    wanted = CRITERIA[criterion].over(*over) if over else CRITERIA[criterion]
    if sd_of is not None:
        wanted = sd_named(sd_of, setup, values)
    several = [values]
    with Bars(console) as bars:
        if points > 1:
            drawing = partial(bars, "drawing points")
            drawn = repeated_fits(setup.problem, values, points, seed=seed, progress=drawing)
            several = [drawn.values(i, values) for i in range(points)]
        found = diagnostics.design(
            setup.problem,
            given,
            several,
            choose=choose,
            criterion=wanted,
            progress=partial(bars, "comparing candidates"),
        )
    say(console, escape(found.report()))
    told = ""
    if check:
        both = (setup.problem, with_candidates(setup.problem, given, found.chosen))
        with Bars(console) as bars:
            told = checked_by_fits(found, both, wanted, values, check, seed=seed, progress=bars)
        say(console, escape(told))
    console.print("[dim]writing the page[/]")
    page = write_design(
        found,
        folder,
        title=experiment.name,
        question=setup.question,
        check=told,
        source=experiment.source,
    )
    print_page(console, "report", page)


def _refuse_contradictions(
    sd_of: str | None, over: list[str] | None, points: int, check: int
) -> None:
    if sd_of is not None and over:
        raise BadArgument("--over goes with --criterion; --sd-of says itself what matters")
    if points < 1 or check < 0:
        raise BadArgument("--points is 1 or more, and --check is 0 or more")
    if check == 1:
        raise BadArgument("one simulated fit has no standard deviation; --check takes 2 or more")
    if check and (sd_of is None or points > 1):
        raise BadArgument(
            "--check compares one standard deviation at one point; give --sd-of with it, and no "
            "--points"
        )
