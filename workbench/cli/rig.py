"""`workbench rig`: bones, weights, joints, a tree and a body from meshes in motion."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from workbench.bodies.files.saving import save_body
from workbench.cli.bars import Bars
from workbench.cli.leaving import interrupts_say
from workbench.cli.output import print_page, rich_table, say
from workbench.errors import BadArgument
from workbench.motions import save_motion
from workbench.reports.page import Table
from workbench.training.rigging.mesh_sequences import read_meshes
from workbench.training.rigging.rig import TOLERANCE, Rigged, pose_rms
from workbench.training.rigging.rig import rig as find_rig
from workbench.training.rigging.words import in_words

MOST_HELD_OUT = 20  # meshes on which the body is measured


def rig(
    meshes: Annotated[
        list[Path],
        typer.Argument(
            help="Meshes of one topology in motion, in metres: a folder of them (with a "
            "registrations.csv or without), a stack (T, N, 3) as .npy, or one file for each frame."
        ),
    ],
    out: Annotated[Path, typer.Option(help="The body is written here, as .npz or .pkl.")] = Path(
        "rigged.npz"
    ),
    rest: Annotated[
        str | None,
        typer.Option(
            help="The mesh whose pose becomes the body's rest pose: a mesh file, or a body; else "
            "the first mesh."
        ),
    ] = None,
    bones: Annotated[
        int | None,
        typer.Option(help="Number of bones; else as many as the motion and --tolerance ask for."),
    ] = None,
    tolerance: Annotated[
        float,
        typer.Option(help="Error, rms in m, below which no further bone is looked for."),
    ] = TOLERANCE,
    frames: Annotated[
        int, typer.Option(help="Learn from at most so many meshes, spread evenly.")
    ] = 200,
    motion: Annotated[
        Path | None,
        typer.Option(help="Write the motion of the meshes that were learned from to this .npz."),
    ] = None,
    fps: Annotated[float, typer.Option(help="Meshes a second, for --motion.")] = 30.0,
) -> None:
    """Find the skeleton and the skinning weights of meshes in motion, and write them as a body.

    The last fifth of the meshes is held out, and the body is measured on up to 20 of them. The
    command says which joints the motion leaves undetermined, and in which direction.
    """
    console = Console()
    if out.suffix not in (".npz", ".pkl"):
        raise BadArgument(f"--out takes a file that ends in .npz or .pkl, not {out}")
    if motion is not None and motion.suffix != ".npz":
        raise BadArgument(f"--motion takes a file that ends in .npz, not {motion}")
    if frames < 2:
        raise BadArgument(f"--frames takes 2 or more, not {frames}")
    if not 0 < fps < np.inf:
        raise BadArgument(f"--fps takes a number above 0, not {fps:g}")
    given = read_meshes(meshes, rest)
    T = len(given.meshes)
    learned = T - T // 5
    rows = np.unique(np.linspace(0, learned - 1, min(learned, frames)).round().astype(int))
    others = np.unique(np.linspace(learned, T - 1, min(T // 5, MOST_HELD_OUT)).round().astype(int))
    first = given.meshes[0] if given.rest is None else given.rest
    say(
        console,
        f"{T} meshes of {given.meshes.shape[1]} vertices: learning from {len(rows)}, the last "
        f"{T // 5} are held out",
    )
    card = {"provenance": [f"Rigged from the meshes in {', '.join(p.name for p in meshes[:3])}."]}
    bars = Bars(console)
    with interrupts_say(lambda: f"interrupted at {bars.last}; nothing was written"), bars:
        found = find_rig(
            given.meshes[rows],
            given.faces,
            rest=first,
            bones=bones,
            tolerance=tolerance,
            report=bars,
            card=card,
        )
    save_body(found.body, out)
    if motion is not None:
        step = (rows[-1] - rows[0]) / (len(rows) - 1)  # meshes between two that were learned from
        save_motion(motion, found.motion(fps / float(step)))
    console.print(rich_table(_joints(found)))
    say(console, f"{found.body.n_joints} bones; {1e3 * found.rms:.3g} mm from the meshes (rms)")
    if len(others):
        rms = pose_rms(found.body, given.meshes[others])
        say(console, f"{1e3 * rms:.3g} mm from {len(others)} meshes that were held out (rms)")
    for note in found.notes:
        say(console, f"note: {escape(note)}")
    print_page(console, "body", out)
    if motion is not None:
        print_page(console, "motion", motion)


def _joints(found: Rigged) -> Table:
    """A line for each joint: its place, how well it is determined, and along what it may slide."""
    names = found.body.joint_names
    rows = tuple(
        (
            names[joint.bones[1]],
            names[joint.bones[0]],
            " ".join(f"{x:.3f}" for x in joint.place),
            " ".join(f"{10 * parted:.2g}" for parted in joint.parting[::-1]),
            " and ".join(in_words(direction) for direction in joint.free) or "-",
        )
        for joint in found.joints
    )
    head = ("joint of", "with", "at rest, m", "1 cm off parts them, mm", "may slide along")
    return Table(head, rows, ())
