"""`workbench convert`: the motion of one body, or of named points, as that of another body."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from workbench import conversion
from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.catalogue import BODIES, load_body
from workbench.cli.motion_output import MOTIONS, refuse_suffix, write_motion
from workbench.cli.output import Up, say, say_notes, timed_lines, warn_of, warn_without_effect
from workbench.conversion import conversion_errors, correspond, motion_from_points
from workbench.conversion.converting import Converted, doubts_of, skeleton_errors
from workbench.conversion.points_in_space import SIGMA
from workbench.environment import expanded
from workbench.errors import BadArgument
from workbench.fitting.marker_files import holds_markers, read_markers
from workbench.fitting.tracking import Progress
from workbench.geometry.guesses import UNITS, sizes_of
from workbench.motions import Motion, read_motion

TIMES = 10  # how often progress is told
APART = 0.1  # m, of joints from those of a skeleton: proportions explain less
SKELETON = (
    "the joints are far from those of the skeleton in the file: its proportions, its rest pose or "
    "the axes of its joints are others than those of --from; look at both with `workbench motion`"
)
KNOWN = f"{', '.join(BODIES)}, or a file of your own"


def convert(
    file: Annotated[
        Path,
        typer.Argument(
            help="A motion: .bvh, .glb, .gltf, or .npz as of AMASS; or named points: .trc, .c3d, "
            "or .npz."
        ),
    ],
    out: Annotated[Path, typer.Option(help="The motion of the other body: .npz, .bvh or .glb.")],
    to: Annotated[str, typer.Option(help=f"The body that it becomes a motion of ({KNOWN}).")],
    source: Annotated[
        str | None, typer.Option("--from", help=f"The body that the motion is one of ({KNOWN}).")
    ] = None,
    points: Annotated[
        str | None,
        typer.Option(
            help="What the named points are: joints, a landmark set such as coco, or hand; "
            "otherwise whichever has most of the names."
        ),
    ] = None,
    sigma: Annotated[
        float, typer.Option(help="Standard deviation of the named points in mm.")
    ] = 1e3 * SIGMA,
    rate: Annotated[
        float | None,
        typer.Option(help="Frames a second, where the file does not say it, or says wrong."),
    ] = None,
    unit: Annotated[
        str | None, typer.Option(help=f"Unit of the points ({', '.join(UNITS)}).")
    ] = None,
    up: Up = None,
) -> None:
    """Turn the motion of one body, or points in space, into the motion of another body."""
    console, path = Console(), expanded(file)
    refuse_suffix(out, MOTIONS, "a motion")
    if rate is not None and not 0 < rate < np.inf:
        raise BadArgument(f"--rate takes a number above 0, not {rate:g}")
    target = load_body(to)
    if holds_markers(path):
        if source is not None:
            warn_without_effect(console, "--from", f"{path.name} holds points, and no motion")
        found = _from_points(console, path, target, points, sigma, rate, unit, up)
    else:
        if points is not None:
            warn_without_effect(console, "--points", f"{path.name} holds a motion")
        if source is None:
            raise BadArgument(f"say with --from which body {path.name} is a motion of: {KNOWN}")
        model = load_body(source)
        motion = read_motion(path, unit=unit, up=up, fps=rate, body=model)
        found = _from_body(console, motion, model, target)
    write_motion(console, out, found, target)


def _from_body(console: Console, motion: Motion, source: Body, target: Body) -> Motion:
    report = timed_lines(console)
    correspondence = correspond(source, target, report)
    say(console, escape(str(correspondence)))
    found = conversion.convert(
        motion, source, target, correspondence=correspondence, progress=_told(console)
    )
    say_notes(console, found.motion.notes)
    warn_of(console, doubts_of(found.motion, target, found.errors, f"the surface of {source.name}"))
    own = skeleton_errors(found.motion, target, motion)
    if own is not None:
        mean = 1e3 * float(own.mean())
        if mean > 1e3 * APART:
            warn_of(console, [SKELETON])
        say(console, f"joints are {mean:.1f} mm from those of the file's skeleton on average")
    _print_errors(console, found)
    joints = {*source.joint_names} & {*target.joint_names}
    copied = conversion_errors(
        motion.named(source).named(target), target, motion, source, correspondence
    )
    say(
        console,
        f"vertices are {1e3 * found.mean():.2f} mm from the other surface on average, and would be "
        f"{1e3 * float(np.nanmean(copied)):.2f} mm if the angles of {len(joints)} joints were "
        "copied",
    )
    return found.motion


def _print_errors(console: Console, found: Converted) -> None:
    table = Table(box=None, header_style="bold")
    for name, justify in (("part", "left"), ("mean mm", "right"), ("largest mm", "right")):
        table.add_column(name, justify=justify)  # type: ignore[arg-type]
    for part, (mean, largest) in found.by_part.items():
        table.add_row(escape(part), f"{1e3 * mean:.1f}", f"{1e3 * largest:.1f}")
    console.print(table)


def _from_points(
    console: Console,
    path: Path,
    target: Body,
    kind: str | None,
    sigma: float,
    rate: float | None,
    unit: str | None,
    up: str | None,
) -> Motion:
    recording = read_markers(path, unit=unit, up=up, sizes=sizes_of(target.joint_names))
    say_notes(console, recording.notes)
    fps = recording.fps if rate is None else rate
    if fps is None:
        raise BadArgument(f"{path.name} does not say its rate; give it with --rate")
    found = motion_from_points(
        recording.markers,
        recording.labels,
        target,
        fps,
        kind=kind,
        sigma=1e-3 * sigma,
        progress=_told(console),
    )
    say_notes(console, found.motion.notes)
    table = Table(box=None, header_style="bold")
    table.add_column("point")
    table.add_column("mean mm", justify="right")
    for name, error in _worst(found.names, found.errors):
        table.add_row(escape(name), f"{error:.1f}")
    console.print(table)
    warn_of(console, doubts_of(found.motion, target, found.errors, "the points"))
    mean = 1e3 * float(np.nanmean(found.errors))
    say(console, f"points are {mean:.2f} mm from those of the body on average")
    return found.motion


def _worst(names: tuple[str, ...], errors: Array) -> list[tuple[str, float]]:
    each = 1e3 * np.nanmean(errors, axis=0)
    return [(names[i], float(each[i])) for i in np.argsort(-each, kind="stable")[:8]]


def _told(console: Console) -> Progress:
    """Progress as a line for every tenth of the work, with the seconds since now before it."""
    report = timed_lines(console)

    def told(what: str, done: int, all_of: int) -> None:
        every = max(1, all_of // TIMES)
        if done % every == 0 or done == all_of:
            report(f"{what}: {done} of {all_of}")

    return told
