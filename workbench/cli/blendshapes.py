"""`workbench blendshapes`: all predictors of blend shapes in one table, from seeds."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.output import folder_to_write, print_page, say, timed_lines, warn_without_effect
from workbench.cli.run import Out
from workbench.studies.blend_shapes.page import table_text, write_predictor_study
from workbench.studies.blend_shapes.study import PredictorPlan, predictor_study

PLAN = PredictorPlan()
Mocap = Annotated[
    Path | None,
    typer.Option(
        help="A recording (.npz), tested on every fifth clip; without it, poses are drawn."
    ),
]
Seed = Annotated[int, typer.Option(help="Seed of every draw.")]


def blendshapes(
    mocap: Mocap = None,
    body: Annotated[str, typer.Option(help="The body: default or small.")] = PLAN.body,
    training: Annotated[int, typer.Option(help="Number of poses to learn from.")] = PLAN.training,
    validation: Annotated[
        int, typer.Option(help="Number of poses to make choices on.")
    ] = PLAN.validation,
    test: Annotated[
        int, typer.Option(help="Number of test poses that are drawn without a recording.")
    ] = PLAN.test,
    examples: Annotated[
        int, typer.Option(help="Number of poses to interpolate between.")
    ] = PLAN.examples,
    seed: Seed = PLAN.seed,
    out: Out = Path("runs"),
) -> None:
    """Compare predictors of the errors of linear blending.

    This takes several minutes, or one minute with --body small.
    """
    console = Console()
    plan = PredictorPlan(body, training, validation, test, examples, seed)
    if mocap is not None and test != PLAN.test:
        warn_without_effect(console, "--test", "the poses of the recording are tested on")
    folder = folder_to_write(out, "blendshapes", "")
    found = predictor_study(plan, mocap, timed_lines(console))
    say(console, escape(table_text(found)))
    say(console, f"tested on {found.n_test} {found.test}")
    print_page(console, "page", write_predictor_study(found, folder))
