"""`workbench blendshapes`: all predictors of blend shapes in one table, from seeds."""

import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.run import make_folder
from workbench.cli.without_effect import changes_nothing
from workbench.reports.blend_shapes import table_text, write_blend_shapes
from workbench.reports.folder import refuse_foreign
from workbench.training.blend_shapes.comparison import Plan, compare_blend_shapes

PLAN = Plan()


def blendshapes(
    mocap: Annotated[
        Path | None,
        typer.Option(help="A recording (.npz) whose every fifth clip is tested on; else draws."),
    ] = None,
    body: Annotated[str, typer.Option(help="default or small.")] = PLAN.body,
    lesson: Annotated[int, typer.Option(help="Poses to learn from.")] = PLAN.lesson,
    trial: Annotated[int, typer.Option(help="Poses to make choices on.")] = PLAN.trial,
    test: Annotated[int, typer.Option(help="Poses drawn if there is no recording.")] = PLAN.test,
    examples: Annotated[int, typer.Option(help="Poses to interpolate between.")] = PLAN.examples,
    seed: Annotated[int, typer.Option(help="Of every draw.")] = PLAN.seed,
    out: Annotated[Path, typer.Option(help="Folder that the page's own is written into.")] = Path(
        "runs"
    ),
) -> None:
    """Compare what predicts the errors of linear blending: minutes; one with --body small."""
    console, began = Console(), time.perf_counter()
    plan = Plan(body, lesson, trial, test, examples, seed)
    if mocap is not None and test != PLAN.test:
        changes_nothing(console, "--test", "the poses of the recording are tested on")
    make_folder(out)
    refuse_foreign(out / "blendshapes", "")

    def report(text: str) -> None:
        took = time.perf_counter() - began
        console.print(f"[dim]{took:6.0f} s  {escape(text)}[/]", highlight=False)

    found = compare_blend_shapes(plan, mocap, report)
    console.print(table_text(found), highlight=False, markup=False, soft_wrap=True)
    console.print(f"tested on {found.n_test} {found.test}", highlight=False, soft_wrap=True)
    page = write_blend_shapes(found, out / "blendshapes")
    console.print(f"page: [bold]{escape(str(page))}[/]", soft_wrap=True)
