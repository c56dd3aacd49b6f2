"""`workbench motion` and `convert`: motions read, written and moved to other bodies."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from workbench import conversion
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body, why_not_skinned
from workbench.bodies.catalogue import BODIES, load_body
from workbench.cli.console import (
    Bars,
    Up,
    above_zero,
    print_page,
    rich_table,
    say,
    say_notes,
    warn_of,
    warn_unused,
    warn_without_effect,
)
from workbench.conversion import PointFit, correspond, motion_from_points, motion_from_skeleton
from workbench.conversion.converting import doubts_of, skeleton_errors
from workbench.conversion.points_in_space import SIGMA
from workbench.environment import expanded
from workbench.errors import BadArgument, BadBody, some_of
from workbench.fitting.doubts import of_person
from workbench.fitting.marker_files import (
    MarkerRecording,
    holds_markers,
    read_markers,
    write_markers,
)
from workbench.geometry.guesses import UNITS, sizes_of
from workbench.motions import Motion, load_tissue, read_motion, save_motion, write_bvh, write_glb
from workbench.motions.skeleton_names import renamed
from workbench.motions.smpl_files import LAYOUTS
from workbench.motions.soft_tissue import betas_with_tissue, displaced_by, with_dmpls, with_tissue
from workbench.reports.page import Table
from workbench.reports.replays import motion_page

MARKER_SUFFIXES = (".npz", ".trc")  # what is written of markers
MOTION_SUFFIXES = (".bvh", ".npz", ".glb", ".smpl")  # and of a motion
EXACT = "exact"
OF_MOTIONS = ("--fps", "--rate", "--body", "--page", "--tissue", "--animation")
Rate = Annotated[
    float | None,
    typer.Option(callback=above_zero, help="Frames a second, if the file does not say."),
]
Person = Annotated[
    str | None, typer.Option(help="Which of several people in a file; else who is in most frames.")
]
Animation = Annotated[str | None, typer.Option(help="Animation of a .glb, by its name or number.")]


def motion(
    ctx: typer.Context,
    file: Annotated[
        Path,
        typer.Argument(
            help="A motion: .bvh, .glb, .gltf; .npz, .npy, .pkl, .pt, .json or .smpl of AMASS or "
            "of an estimator, or a folder of these; or markers: .c3d, .trc, .npz."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="Write a motion as .bvh, .npz, .smpl or .glb, markers as .trc or .npz."),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(callback=above_zero, help="Resample a motion to so many frames a second."),
    ] = None,
    rate: Rate = None,
    layout: Annotated[
        str,
        typer.Option(
            help="Names of arrays in an .npz: amass, or smplx, those of the arguments of smplx."
        ),
    ] = LAYOUTS[0],
    page: Annotated[
        Path | None, typer.Option(help="Write a page (.html) on which a body plays the motion.")
    ] = None,
    correctives: Annotated[
        str,
        typer.Option(
            help="Morph targets of a .glb for the pose blend shapes: a number of them, or "
            f"{EXACT}; their error is printed."
        ),
    ] = "0",
    shapes: Annotated[
        int, typer.Option(help="Shape directions that a .glb has as morph targets.", min=0)
    ] = 0,
    body: Annotated[
        str | None,
        typer.Option(
            help=f"The body whose bones a motion moves ({', '.join(BODIES)}, or a file of your "
            "own); a .bvh has bones of its own."
        ),
    ] = None,
    tissue: Annotated[
        bool, typer.Option("--tissue", help="Simulate soft tissue on --page or in a .glb.")
    ] = False,
    dmpls: Annotated[
        Path | None,
        typer.Option(help="DMPL's model.npz, for the dmpls of a motion of AMASS on --body."),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            help=f"Unit of a .bvh, of markers or of a translation ({', '.join(UNITS)}; cmu is that "
            "of BVH conversions of CMU's recordings, 0.0564 m)."
        ),
    ] = None,
    up: Up = None,
    person: Person = None,
    animation: Animation = None,
) -> None:
    """Say what a file of a motion or of markers holds, show it on a page, and convert it."""
    console, path = Console(), expanded(file)
    count = number_of_correctives(correctives)
    if page is not None and page.suffix.lower() != ".html":
        raise BadArgument(f"--page takes a file that ends in .html, not {page}")
    if holds_markers(path):
        refuse_suffix(out, MARKER_SUFFIXES, "markers")
        warn_unused(console, ctx, OF_MOTIONS, f"{path.name} holds markers, and no motion")
        _say_markers(console, read_markers(path, unit=unit, up=up), path, out)
        return
    refuse_suffix(out, MOTION_SUFFIXES, "a motion")
    model = None if body is None else load_body(body)
    motion = read_motion(
        path, unit=unit, up=up, fps=rate, body=model, person=person, animation=animation
    )
    _say_motion(console, motion, path)
    if fps is not None:
        motion = motion.resampled(fps)
        say(console, f"resampled to {len(motion)} frames at {fps:g} frames a second")
    suffix = "" if out is None else out.suffix.lower()
    needs_body = page is not None or suffix == ".glb"
    if tissue and not needs_body:
        raise BadArgument("--tissue shows on a page or in a .glb; give --page or --out WALK.glb")
    if model is None and (needs_body or (suffix == ".bvh" and motion.bones is None)):
        model = load_body("default")
        say(console, "the body is default; --body takes another")
    if model is not None:
        before = motion.notes
        motion = motion.named(model)
        say_notes(console, motion.notes[len(before) :])
        if len(motion.betas):
            warn_of(console, of_person(model, motion.betas_on(model)))
    betas, sentence = None, ""
    if dmpls is not None:
        if not isinstance(model, SkinnedBody) or motion.dmpls is None or not needs_body or tissue:
            raise BadArgument(
                "--dmpls moves the --body of an SMPL file by the dmpls of a motion of AMASS, on "
                "--page or in a .glb, and not together with --tissue"
            )
        model = with_dmpls(model, expanded(dmpls))
        betas = motion.betas_on(model)
    if tissue:
        assert model is not None
        motion, model, betas, sentence = _with_tissue(console, motion, model)
    if page is not None:
        assert model is not None
        replay = motion_page(motion, model, path.name, betas, [f"{sentence}."] if sentence else ())
        print_page(console, "page", replay.save(page))
    if out is not None:
        write_motion(console, out, motion, model, count, shapes, betas, layout)


def _with_tissue(
    console: Console, motion: Motion, body: Body
) -> tuple[Motion, SkinnedBody, Array, str]:
    """The motion at the tissue's rate, the body with tissue, its betas in every frame; a sentence.

    The sentence says where the tissue comes from, and how far it moves.
    """
    soft = load_tissue()
    model = with_tissue(body, soft)
    motion = soft.prepared(motion)
    betas = betas_with_tissue(body, soft, motion)
    away = 1e3 * np.linalg.norm(displaced_by(soft, betas), axis=2)
    sentence = (
        "The soft tissue is simulated, and was not learned from measurements of people: in "
        f"{len(motion)} frames at {motion.fps:g} frames a second it moves vertices by "
        f"{away.mean():.1f} mm on average and {away.max():.0f} mm at most"
    )
    say(console, sentence)
    return motion, model, betas, sentence


def _say_motion(console: Console, motion: Motion, path: Path) -> None:
    steps = np.linalg.norm(np.diff(motion.trans, axis=0), axis=1)
    lines = [
        f"{path.name} holds a motion of {len(motion)} frames at {motion.fps:g} frames a second, "
        f"{motion.seconds:.2f} s",
        f"{len(motion.joint_names)} joints: {some_of(motion.joint_names)}",
        f"the root travels {steps.sum():.2f} m",
    ]
    if motion.bones is not None:
        ends = motion.bones.ends(motion.pose[:1], motion.trans[:1])
        tall = float(np.ptp(np.concatenate([motion.joints()[0], ends[0]])[:, 1]))
        lines.append(f"its own skeleton is {tall:.2f} m tall in the first frame")
    if len(motion.betas):
        lines.append(f"{len(motion.betas)} betas, the largest {np.abs(motion.betas).max():.2f}")
    if motion.dmpls is not None:
        lines.append(f"{motion.dmpls.shape[1]} coefficients of dynamic blend shapes (dmpls)")
    if motion.expression is not None:
        lines.append(f"{motion.expression.shape[1]} coefficients of expression")
    for line in lines:
        say(console, escape(line))
    say_notes(console, motion.notes)


def _say_markers(
    console: Console, recording: MarkerRecording, path: Path, out: Path | None
) -> None:
    T, M = recording.markers.shape[:2]
    fps = recording.fps
    rate = "of an unknown rate" if fps is None else f"at {fps:g} frames a second"
    say(console, escape(f"{path.name} holds {M} markers in {T} frames {rate}"))
    say(console, escape(f"labels: {some_of(recording.labels)}"))
    say_notes(console, recording.notes)
    if out is not None:
        write_markers(out, recording)
        say(console, f"markers: {escape(str(out))}")


def refuse_suffix(out: Path | None, suffixes: tuple[str, ...], what: str) -> None:
    """Raise BadArgument for an output that ends in none of the suffixes."""
    if out is not None and out.suffix.lower() not in suffixes:
        raise BadArgument(f"{what} can be written as {' or '.join(suffixes)}, and not as {out}")


def number_of_correctives(text: str) -> int | None:
    """The number that `--correctives` gives; None for `exact`. Raises BadArgument."""
    if text.strip().lower() == EXACT:
        return None
    if not text.strip().isdecimal() or len(text) > 9:
        raise BadArgument(
            f"--correctives takes {EXACT}, or a whole number from 0, not {text!r:.40}"
        )
    return int(text)


def write_motion(
    console: Console,
    out: Path,
    motion: Motion,
    body: Body | None,
    correctives: int | None = 0,
    shapes: int = 0,
    betas: Array | None = None,
    layout: str = LAYOUTS[0],
) -> None:
    """Write a motion as .bvh, .npz, .smpl or .glb, and say where; a .glb needs a body.

    `betas` (T, B) take the place of the motion's own in a .glb.
    """
    suffix = out.suffix.lower()
    if suffix == ".bvh":
        write_bvh(out, motion, body)
    elif suffix in (".npz", ".smpl"):
        save_motion(out, motion, layout)
    else:
        if not isinstance(body, SkinnedBody):
            raise BadBody(
                why_not_skinned(body, "a .glb", "write .npz or .bvh, or take another body")
            )
        if correctives != 0 or shapes:
            used = min(shapes, body.n_betas)
            fit = write_glb(out, motion, body, correctives=correctives, shapes=used)
            say(console, f"{used} shape directions, {fit}")
            say(console, f"size: {out.stat().st_size / 1e6:.2f} MB")
        else:
            write_glb(out, motion, body, betas=betas)
    say(console, f"motion: {escape(str(out))}")


MOST_POINTS = 8  # points that are listed
FAR_FROM_SKELETON = 0.1  # m, of joints from those of a skeleton: proportions explain less
SKELETON_DIFFERS = (
    "the joints are far from those of the skeleton in the file: its proportions, its rest pose or "
    "the axes of its joints are others than those of --from; look at both with `workbench motion`"
)
KNOWN_BODIES = f"{', '.join(BODIES)}, or a file of your own"


def convert(
    file: Annotated[
        Path,
        typer.Argument(
            help="A motion: .bvh, .glb, .gltf, or .npz as of AMASS; or named points: .trc, .c3d, "
            "or .npz."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="A .npz, .bvh or .glb; else FILE-BODY.npz.")
    ] = None,
    to: Annotated[str, typer.Option(help=f"The body to convert to ({KNOWN_BODIES}).")] = "default",
    source: Annotated[
        str | None, typer.Option("--from", help="The motion's own body; else a skeleton is fitted.")
    ] = None,
    names: Annotated[
        Path | None,
        typer.Option(
            help="A .csv with lines such as Arm_L,left_shoulder: names in the file, and the joints "
            "or points that they stand for, unless they are those of Mixamo, CMU, Xsens or others "
            "that are known."
        ),
    ] = None,
    points: Annotated[
        str | None, typer.Option(help="What named points are: joints, hand, or a set such as coco.")
    ] = None,
    sigma: Annotated[
        float, typer.Option(help="Standard deviation of the named points in mm.")
    ] = 1e3 * SIGMA,
    rate: Rate = None,
    unit: Annotated[
        str | None, typer.Option(help=f"Unit of the points ({', '.join(UNITS)}).")
    ] = None,
    up: Up = None,
    person: Person = None,
    animation: Animation = None,
) -> None:
    """Turn a motion, a skeleton that moves, or points in space into the motion of a body."""
    console, path = Console(), expanded(file)
    refuse_suffix(out, MOTION_SUFFIXES, "a motion")
    target = load_body(to)
    written = out or Path(f"{path.stem}-{target.name}.npz")
    table = None if names is None else expanded(names)
    if holds_markers(path):
        if source is not None:
            warn_without_effect(console, "--from", f"{path.name} holds points, and no motion")
        sizes = sizes_of(target.joint_names)
        recording = read_markers(path, unit=unit, up=up, sizes=sizes, labels=table)
        say_notes(console, recording.notes)
        fps = recording.fps if rate is None else rate
        if fps is None:
            raise BadArgument(f"{path.name} does not say its rate; give it with --rate")
        with Bars(console) as bars:
            fit = motion_from_points(
                recording.markers,
                recording.labels,
                target,
                fps,
                kind=points,
                sigma=1e-3 * sigma,
                progress=bars,
            )
        converted = _from_points(console, fit, target, "points")
        write_motion(console, written, converted, target)
        return
    if points is not None:
        warn_without_effect(console, "--points", f"{path.name} holds a motion")
    model = None if source is None else load_body(source)
    motion = read_motion(
        path, unit=unit, up=up, fps=rate, body=model, person=person, animation=animation
    )
    if model is not None:
        if names is not None:
            warn_without_effect(console, "--names", "with --from, joints have the body's names")
        converted = _from_body(console, motion, model, target)
    elif motion.bones is not None:
        say_notes(console, motion.notes)
        labels = motion.joint_names
        if table is not None:
            labels, notes = renamed(labels, table)
            say_notes(console, notes)
        with Bars(console) as bars:
            fit = motion_from_skeleton(
                motion, target, names=labels, sigma=1e-3 * sigma, progress=bars
            )
        converted = _from_points(console, fit, target, "joints")
    else:
        raise BadArgument(f"say with --from which body {path.name} is a motion of: {KNOWN_BODIES}")
    write_motion(console, written, converted, target)


def _from_body(console: Console, motion: Motion, source: Body, target: Body) -> Motion:
    correspondence = correspond(
        source, target, lambda text: say(console, f"[dim]{escape(text)}[/]")
    )
    say(console, escape(str(correspondence)))
    with Bars(console) as bars:
        fit = conversion.convert(
            motion, source, target, correspondence=correspondence, progress=bars
        )
    say_notes(console, fit.motion.notes)
    surface = f"the surface of {source.name}"
    warn_of(console, doubts_of(fit.motion, target, fit.errors, surface))
    own = skeleton_errors(fit.motion, target, motion)
    if own is not None:
        mean = 1e3 * float(own.mean())
        if mean > 1e3 * FAR_FROM_SKELETON:
            warn_of(console, [SKELETON_DIFFERS])
        say(console, f"joints are {mean:.1f} mm from those of the file's skeleton on average")
    rows = tuple(
        (part, f"{1e3 * mean:.1f}", f"{1e3 * largest:.1f}")
        for part, (mean, largest) in fit.by_part.items()
    )
    console.print(rich_table(Table(("part", "mean mm", "largest mm"), rows, (1, 2))))
    say(console, f"vertices are {1e3 * fit.mean():.2f} mm from the other surface on average")
    return fit.motion


def _from_points(console: Console, fit: PointFit, target: Body, what: str) -> Motion:
    """Print how far points or joints (`what`) are off, those of joints all; give the motion."""
    say_notes(console, fit.motion.notes)
    each = 1e3 * np.nanmean(fit.errors, axis=0)
    order = np.argsort(-each, kind="stable")
    rows = tuple(
        (fit.names[i], fit.labels[i], f"{each[i]:.1f}")
        for i in (order if what == "joints" else order[:MOST_POINTS])
    )
    console.print(rich_table(Table((what.removesuffix("s"), "in the file", "mean mm"), rows, (2,))))
    warn_of(console, doubts_of(fit.motion, target, fit.errors, f"the {what}"))
    mean = 1e3 * float(np.nanmean(fit.errors))
    say(console, f"{what} are {mean:.2f} mm from those of the body on average")
    return fit.motion
