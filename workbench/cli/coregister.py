"""`workbench coregister`: registered scans and the model that couples them, found together."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from workbench.cli.cluster import Dask, Workers, executing
from workbench.cli.leaving import interrupts_say
from workbench.cli.output import at_least_one, print_page, say, warn_of
from workbench.cli.run import Out
from workbench.cli.train import Lines
from workbench.environment import expanded
from workbench.errors import BadArgument
from workbench.registration.coregistration import Coregistration, CoregistrationPlan
from workbench.registration.coregistration.coregistering import EDGES, FILE
from workbench.registration.coregistration.folder import open_registered
from workbench.reports.folder import own_folder
from workbench.reports.registration import Coregistered, begin_folder, write_coregistration
from workbench.training.execution import Execution


def coregister(
    folder: Annotated[
        Path,
        typer.Argument(help="Folder that `workbench register SCANS/ --subjects TABLE.csv` wrote."),
    ],
    rounds: Annotated[
        int,
        typer.Option(callback=at_least_one, help="Number of rounds of registrations and model."),
    ] = CoregistrationPlan().rounds,
    coupling: Annotated[
        float,
        typer.Option(help="Sigma of a registered vertex from the model's, per coordinate, in m."),
    ] = CoregistrationPlan().sigmas.data,
    edges: Annotated[
        float,
        typer.Option(
            help="Sigma of the edges of a person's template beyond what betas explain, in m: a "
            "larger one learns more detail and slides more."
        ),
    ] = EDGES,
    betas: Annotated[
        int,
        typer.Option(
            callback=at_least_one,
            help="Number of shape directions; at most one fewer than people.",
        ),
    ] = 10,
    workers: Workers = 1,
    dask: Dask = None,
    out: Out = Path("runs"),
) -> None:
    """Coregister scans: registrations, poses, a template for each person and the model, together.

    Writes runs/coregister-NAME/ with a page, the body, and the registrations, which `workbench
    train` takes as they are. If it is interrupted or killed, the same command continues after the
    last block that ended.
    """
    console = Console()
    for option, length in (("--coupling", coupling), ("--edges", edges)):
        if not 0 < length < 1:
            raise BadArgument(f"{option} takes a length in m above 0 and below 1, not {length:g}")
    given = expanded(folder)
    body, scans = open_registered(given)
    plan = CoregistrationPlan()
    plan = replace(plan, rounds=rounds, edges=edges, sigmas=replace(plan.sigmas, data=coupling))
    problem = Coregistration(body, scans, plan)
    name = given.resolve().name.removeprefix("register-")
    place, source = out / f"coregister-{name}", str(given.resolve())
    own_folder(place, source)
    begin_folder(place, source)
    if (place / FILE).exists():
        say(console, "continuing after the last block that ended")
    fits = [scans.fitted(j, body) for j in range(len(scans.rows))]

    def told() -> str:
        if not (place / FILE).exists():
            return f"interrupted before the first block ended; there is nothing in {place} yet"
        return (
            f"interrupted; what was found until the last block is in {place}, and the same command "
            "continues from there"
        )

    with interrupts_say(told):
        with executing(console, workers, dask) as executor:
            state = problem.run(fits, folder=place, execution=Execution(executor, Lines(console)))
        learned = problem.learned(state, betas)
        page = write_coregistration(Coregistered(problem, scans, state, learned), place, source)
    for scan, told_before in scans.doubts().items():
        warn_of(console, told_before, f"{scan}, by itself: ")
    print_page(console, "body", place / "body.npz")
    print_page(console, "report", page)
