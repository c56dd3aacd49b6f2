"""`workbench export`: a motion, or a function of a body, in the form that other programs take."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.bodies.catalogue import BODIES, load_body
from workbench.bodies.files.c_code import JOINTS, write_c
from workbench.cli.motion_output import (
    EXACT,
    MOTIONS,
    SHAPES,
    number_of_correctives,
    refuse_suffix,
    write_motion,
)
from workbench.cli.output import say, say_notes, warn_without_effect
from workbench.environment import expanded
from workbench.errors import BadArgument
from workbench.motions import read_motion

CODE = ".c"


def export(
    out: Annotated[
        Path,
        typer.Option(
            help=".glb: an animated skinned surface; .bvh: the skeleton; .npz: AMASS's layout; "
            ".c: C code of joints or landmarks, with a header."
        ),
    ],
    motion: Annotated[
        Path | None,
        typer.Argument(help="A motion: .bvh, .glb, .gltf, or .npz as of AMASS; none for .c."),
    ] = None,
    body: Annotated[
        str, typer.Option(help=f"The body ({', '.join(BODIES)}, or a file of your own).")
    ] = "default",
    correctives: Annotated[
        str,
        typer.Option(
            help="Morph targets of a .glb for what pose adds to the surface: a number, 0, or "
            f"{EXACT}. The error is printed, and kept in the file."
        ),
    ] = "32",
    shapes: Annotated[
        int, typer.Option(help="Shape directions that a .glb has as morph targets.", min=0)
    ] = SHAPES,
    fps: Annotated[
        float | None, typer.Option(help="Frames a second to which the motion is resampled.")
    ] = None,
    points: Annotated[
        str, typer.Option(help="What C code computes: joints, or a landmark set such as coco.")
    ] = JOINTS,
) -> None:
    """Write a motion as glTF, BVH or AMASS's .npz, or a function of a body as C code."""
    console = Console()
    count = number_of_correctives(correctives)
    refuse_suffix(out, (*MOTIONS, CODE), "a motion or C code")
    model = load_body(body)
    if out.suffix.lower() == CODE:
        if motion is not None:
            warn_without_effect(console, str(motion), "C code takes the pose as an argument")
        write_c(out, model, points)
        say(console, f"code: {escape(str(out))} and {escape(str(out.with_suffix('.h')))}")
        return
    if motion is None:
        raise BadArgument(f"name the motion that becomes {out}, such as a .bvh or an .npz of AMASS")
    if fps is not None and not 0 < fps < float("inf"):
        raise BadArgument(f"--fps takes a number above 0, not {fps:g}")
    found = read_motion(expanded(motion), body=model)
    if fps is not None:
        found = found.resampled(fps)
    found = found.named(model)
    say_notes(console, found.notes)
    say(console, f"{len(found)} frames at {found.fps:g} frames a second on body {model.name}")
    write_motion(console, out, found, model, count, shapes)
