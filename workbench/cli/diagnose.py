"""`workbench diagnose` and `workbench design`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench import diagnostics
from workbench.cli.console import (
    Bars,
    folder_to_write,
    print_page,
    say,
    warn_unused,
    warn_without_effect,
)
from workbench.cli.run import (
    Name,
    Out,
    Setting,
    SolverName,
    build_setup,
    prepare,
    settings,
    solve_setup,
    solver_named,
)
from workbench.diagnostics.design import CRITERIA
from workbench.errors import BadArgument, check_known
from workbench.experiments import Experiment, find
from workbench.fitting.candidates import CANDIDATES, OWN, QUANTITIES, sd_named
from workbench.fitting.refits import laplace_points, other_minima, profile_likelihood
from workbench.fitting.setup import Setup
from workbench.reports import write_design, write_diagnosis
from workbench.solvers import DEFAULT, Solver

EXIT_WARNED = 1  # the exit code if there are warnings


def diagnose(
    ctx: typer.Context,
    name: Name = "balance",
    setting: Setting = None,
    against: Annotated[
        str | None, typer.Option(help="A second experiment or file to compare with.")
    ] = None,
    at_start: Annotated[
        bool, typer.Option("--at-start", help="Diagnose at the start instead of at the solution.")
    ] = False,
    data_alone: Annotated[
        bool, typer.Option("--data-alone", help="Leave the priors out of the Jacobian.")
    ] = False,
    draws: Annotated[
        int, typer.Option(min=0, help="Diagnose at so many draws of the priors too.")
    ] = 0,
    profile: Annotated[
        list[str] | None,
        typer.Option(help="Follow the lowest cost along this entry, such as betas[0]."),
    ] = None,
    minima: Annotated[
        int,
        typer.Option(min=0, help="Look for other minima along so many of the weakest directions."),
    ] = 0,
    solver: SolverName = DEFAULT,
    out: Out = Path("runs"),
) -> None:
    """Diagnose a fit's Jacobian: its rank, what it cannot determine, and what to do about it.

    Gauges (translations, rotations, scale, offsets, factors) are found by themselves; a FILE.py may
    declare others in `gauges`.

    The exit code is 1 if there are warnings.
    """
    console = Console()
    if (profile or minima) and (at_start or data_alone):
        raise BadArgument(
            f"{'--profile' if profile else '--minima'} begins at the minimum of the whole cost, "
            "which --at-start and --data-alone leave; give it without them"
        )
    experiment = find(name, settings(setting))
    other = find(against) if against is not None else None
    by = solver_named(solver)
    if at_start:
        warn_unused(console, ctx, ["--solver"], "with --at-start nothing is solved")
    folder = folder_to_write(out, f"{experiment.name}-diagnosis", experiment.source)
    solving = None if at_start else by
    first, setup, doubted = _diagnosed(console, experiment, solving, data_alone)
    if draws and not setup.priors:
        raise BadArgument(
            f"--draws takes its points from the priors, and {experiment.name} names no residual as "
            "one; name them in `priors` of the file or its Setup"
        )
    second = _diagnosed(console, other, solving, data_alone)[0] if other else None
    say(console, escape(first.report()))
    if draws:
        say(console, escape(_over_draws(console, first, setup, draws)))
    if minima:
        console.print("[dim]fitting from starts along the weakest directions[/]")
        others = other_minima(first.problem, first.values, directions=minima, solver=by)
        say(console, escape(str(others)))
    profiles = []
    for entry in profile or ():
        console.print(f"[dim]following the lowest cost along {escape(entry)}[/]")
        profiles.append(profile_likelihood(first.problem, first.values, entry, solver=by))
        say(console, escape(str(profiles[-1])))
    console.print("[dim]writing the page[/]")
    page = write_diagnosis(
        first,
        folder,
        title=experiment.name,
        question=setup.question,
        body=setup.body,
        views=setup.views,
        against=second,
        profiles=profiles,
        source=experiment.source,
    )
    print_page(console, "report", page)
    if first.warnings or doubted:
        raise typer.Exit(EXIT_WARNED)


def _diagnosed(
    console: Console, experiment: Experiment, solver: Solver | None, data_alone: bool
) -> tuple[diagnostics.Diagnosis | diagnostics.SequenceDiagnosis, Setup, tuple[str, ...]]:
    """At the end of the solver, with what speaks against it, or at the start if there is none."""
    setup = build_setup(console, experiment)
    if data_alone:
        _mind_priors(console, experiment, setup)
    values, doubted = (setup.start, ()) if solver is None else solve_setup(console, setup, solver)
    console.print("[dim]looking at the Jacobian[/]")
    problem, priors = setup.problem, setup.priors
    if data_alone:
        problem, priors = problem.without(*priors), ()
    diagnosis = diagnostics.diagnose(problem, values, priors=priors, gauges=setup.gauges)
    return diagnosis, setup, doubted


def _over_draws(
    console: Console,
    diagnosis: diagnostics.Diagnosis | diagnostics.SequenceDiagnosis,
    setup: Setup,
    draws: int,
) -> str:
    """The problem of a diagnosis at draws of the setup's priors, in words."""
    console.print(f"[dim]diagnosing at {draws} draws of the priors[/]")
    over = diagnostics.diagnose_over(
        diagnosis.problem,
        diagnostics.prior_draws(setup.problem, setup.start, setup.priors, draws),
        priors=[name for name in setup.priors if name in diagnosis.problem.rows],
        gauges=setup.gauges,
    )
    return f"\nAt draws of the priors ({', '.join(setup.priors)}):\n{over.report()}"


def _mind_priors(console: Console, experiment: Experiment, setup: Setup) -> None:
    """Say that there are no priors to leave out. Raises BadArgument where nothing would be left."""
    if not setup.priors:
        because = f"{experiment.name} names no residual as a prior"
        if experiment.source.endswith(".py"):
            several = ", ".join(setup.problem.rows)
            because += f"; name those of {several} that are, in `priors` of the file or its Setup"
        warn_without_effect(console, "--data-alone", because)
    if set(setup.priors) == set(setup.problem.rows):
        raise BadArgument(
            f"--data-alone leaves nothing to diagnose: every residual of {experiment.name} is a "
            "prior; leave the option out"
        )


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
            help="What to minimise: d (volume), a (mean variance) or e (worst direction)."
        ),
    ] = "d",
    sd_of: Annotated[
        str | None,
        typer.Option(
            "--sd-of",
            help="Minimise instead the standard deviation of this: "
            f"{', '.join(QUANTITIES)}, or an entry such as trans[z].",
        ),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(help="With --criterion, a block or entry that matters; may be repeated."),
    ] = None,
    points: Annotated[
        int,
        typer.Option(min=1, help="Average over this number of points, drawn from the posterior."),
    ] = 1,
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
    if sd_of is not None and over:
        raise BadArgument("--over goes with --criterion; --sd-of says itself what matters")
    by = solver_named(solver)
    experiment, setup, folder = prepare(console, name, setting, out, "design")
    values, _ = solve_setup(console, setup, by)
    kind = candidates or (OWN if setup.candidates else "cameras")
    offered = CANDIDATES[kind](setup, values)
    objective = CRITERIA[criterion].over(*over) if over else CRITERIA[criterion]
    if sd_of is not None:
        objective = sd_named(sd_of, setup, values)
    points_at = [values]
    with Bars(console) as bars:
        if points > 1:
            points_at = laplace_points(setup.problem, values, points, seed)
        ranking = diagnostics.design(
            setup.problem,
            offered,
            points_at,
            choose=choose,
            criterion=objective,
            progress=partial(bars, "comparing candidates"),
        )
    say(console, escape(ranking.report()))
    console.print("[dim]writing the page[/]")
    page = write_design(
        ranking, folder, title=experiment.name, question=setup.question, source=experiment.source
    )
    print_page(console, "report", page)
