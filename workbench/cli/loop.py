"""`workbench loop`: what learning from fits and fitting from what was learned is worth."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.blendshapes import Mocap, Seed
from workbench.cli.output import folder_to_write, print_page, say, timed_lines
from workbench.cli.run import Out
from workbench.studies.fitting_loop.page import loop_text, write_loop
from workbench.studies.fitting_loop.study import LoopPlan, loop_study

PLAN = LoopPlan()


def loop(
    mocap: Mocap = None,
    images: Annotated[int, typer.Option(help="Number of images in the loop.")] = PLAN.images,
    held_out: Annotated[
        int, typer.Option(help="Number of images that the loop never sees.")
    ] = PLAN.held_out,
    rounds: Annotated[int, typer.Option(help="Number of rounds.")] = PLAN.rounds,
    noise: Annotated[float, typer.Option(help="Noise of a keypoint in px.")] = PLAN.noise,
    body: Annotated[str, typer.Option(help="The body: default or small.")] = PLAN.body,
    seed: Seed = PLAN.seed,
    out: Out = Path("runs"),
) -> None:
    """Let fits teach a regressor of poses which begins the next fits, as SPIN does; made-up images.

    It needs scikit-learn and takes about a minute of one core. Ctrl-C ends it; nothing is written.
    """
    console = Console()
    plan = LoopPlan(
        images=images, held_out=held_out, rounds=rounds, noise=noise, body=body, seed=seed
    )
    folder = folder_to_write(out, "loop", "")
    found = loop_study(plan, mocap, timed_lines(console))
    say(console, escape(loop_text(found)))
    print_page(console, "page", write_loop(found, folder))
