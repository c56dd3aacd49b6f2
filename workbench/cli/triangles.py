"""`workbench triangles`: SMPL beside SCAPE and BlendSCAPE, from seeds to a page."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.blendshapes import Mocap, Seed
from workbench.cli.output import folder_to_write, print_page, say, timed_lines
from workbench.cli.run import Out
from workbench.studies.triangles.page import triangles_text, write_triangles
from workbench.studies.triangles.people import TrianglePlan
from workbench.studies.triangles.study import triangle_study

PLAN = TrianglePlan()


def triangles(
    made: Annotated[
        Path,
        typer.Argument(metavar="FOLDER", help="People that `python -m builder.sets` made."),
    ],
    mocap: Mocap = None,
    body: Annotated[str, typer.Option(help="The body: small or default.")] = PLAN.body,
    people: Annotated[
        int, typer.Option(help="Number of people at rest to learn shape from.")
    ] = PLAN.people,
    subjects: Annotated[
        int, typer.Option(help="Number of them who are also posed.")
    ] = PLAN.subjects,
    poses: Annotated[int, typer.Option(help="Number of poses of each subject.")] = PLAN.poses,
    held_out: Annotated[
        int, typer.Option(help="Number of held-out people to test on.")
    ] = PLAN.held_out,
    test: Annotated[
        int, typer.Option(help="Number of meshes of held-out people to test on.")
    ] = PLAN.test,
    betas: Annotated[
        int, typer.Option(help="Number of shape directions of posed models.")
    ] = PLAN.betas,
    seed: Seed = PLAN.seed,
    out: Out = Path("runs"),
) -> None:
    """Learn SMPL, SCAPE and BlendSCAPE from the same synthetic people, and compare them."""
    console = Console()
    plan = TrianglePlan(body, people, subjects, poses, held_out, test, betas, seed)
    folder = folder_to_write(out, "triangles", "")
    found = triangle_study(plan, made, mocap, timed_lines(console))
    say(console, escape(triangles_text(found)))
    print_page(console, "page", write_triangles(found, folder))
