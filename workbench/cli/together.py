"""`workbench together`: scans registered one by one and together, by their number and holes."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.blendshapes import Seed
from workbench.cli.cluster import Workers
from workbench.cli.output import folder_to_write, print_page, say, timed_lines
from workbench.cli.run import Out
from workbench.studies.coregistration.page import together_text, write_together
from workbench.studies.coregistration.study import TogetherPlan, together_study
from workbench.training.execution import Processes

PLAN = TogetherPlan()


def together(
    scans: Annotated[
        list[int], typer.Option(help="Number of scans in a set; give the option again for more.")
    ] = list(PLAN.scans),  # noqa: B006 - Typer reads it once
    holes: Annotated[
        list[int], typer.Option(help="Number of holes in each scan; give it again for more.")
    ] = list(PLAN.holes),  # noqa: B006 - Typer reads it once
    people: Annotated[int, typer.Option(help="Number of people.")] = PLAN.people,
    rounds: Annotated[int, typer.Option(help="Number of rounds of coregistration.")] = PLAN.rounds,
    workers: Workers = 1,
    seed: Seed = PLAN.seed,
    out: Out = Path("runs"),
) -> None:
    """Compare registering scans one by one with registering them together, on simulated scans.

    The defaults take about half an hour of one core. Ctrl-C ends it, and nothing is written.
    """
    console = Console()
    plan = TogetherPlan(tuple(sorted(scans)), tuple(sorted(holes)), people, rounds, seed)
    folder = folder_to_write(out, "together", "")
    found = together_study(plan, Processes(workers), timed_lines(console))
    say(console, escape(together_text(found)))
    print_page(console, "page", write_together(found, folder))
