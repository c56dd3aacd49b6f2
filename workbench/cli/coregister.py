"""`workbench coregister`: registered scans and the model that couples them, found together."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from workbench.cli.cluster import cluster
from workbench.cli.leaving import Interrupted
from workbench.cli.output import print_page, say, warn_without_effect
from workbench.cli.run import Out
from workbench.cli.train import Lines
from workbench.errors import BadArgument
from workbench.homes import expanded
from workbench.interrupts import caused_by
from workbench.registration.coregistration import Coregistration, CoregistrationPlan
from workbench.registration.coregistration.folder import open_registered
from workbench.registration.coregistration.plan import EDGES
from workbench.registration.coregistration.state import FILE
from workbench.reports.coregistration_page import Coregistered, begin_folder, write_coregistration
from workbench.reports.folder import own_folder
from workbench.training.executor import Execution, Executor, Processes, by_backend


def coregister(
    folder: Annotated[
        Path,
        typer.Argument(help="Folder that `workbench register SCANS/ --subjects TABLE.csv` wrote."),
    ],
    rounds: Annotated[
        int, typer.Option(help="Number of rounds of registrations and model.")
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
        int, typer.Option(help="Number of shape directions; at most one fewer than people.")
    ] = 10,
    workers: Annotated[
        int, typer.Option(help="Number of processes; the result does not depend on it.")
    ] = 1,
    dask: Annotated[
        str | None,
        typer.Option(
            help="Address of a Dask scheduler, to register on its workers, which read the folder "
            "at the same path."
        ),
    ] = None,
    out: Out = Path("runs"),
) -> None:
    """Coregister scans: registrations, poses, a template for each person and the model, together.

    Writes runs/coregister-NAME/ with a page, the body, and the registrations, which `workbench
    train` takes as they are. If it is interrupted or killed, the same command continues after the
    last block that ended.
    """
    console = Console()
    for option, value in (("--rounds", rounds), ("--betas", betas), ("--workers", workers)):
        if value < 1:
            raise BadArgument(f"{option} takes 1 or more, not {value}")
    for option, length in (("--coupling", coupling), ("--edges", edges)):
        if not 0 < length < 1:
            raise BadArgument(f"{option} takes a length in m above 0 and below 1, not {length:g}")
    if workers > 1 and dask is not None:
        warn_without_effect(
            console, "--workers", "with --dask, the cluster says how many there are"
        )
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
    executor: Executor = Processes(workers) if dask is None else by_backend
    try:
        with cluster(dask):
            state = problem.run(fits, folder=place, execution=Execution(executor, Lines(console)))
    except (KeyboardInterrupt, SystemError) as error:
        if not caused_by(error, KeyboardInterrupt):
            raise
        raise Interrupted(
            f"interrupted; what was found until the last block is in {place}, and the same command "
            "continues from there"
            if (place / FILE).exists()
            else f"interrupted before the first block ended; there is nothing in {place} yet"
        ) from error
    learned = problem.learned(state, betas)
    page = write_coregistration(Coregistered(problem, scans, state, learned), place, source)
    print_page(console, "body", place / "body.npz")
    print_page(console, "report", page)
