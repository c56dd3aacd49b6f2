"""`workbench motion`: what a file of a motion or of markers holds; and another file of the same."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from workbench.arrays import Array, Index, Mask
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.catalogue import BODIES, load_body
from workbench.cli.motion_output import MOTIONS, refuse_suffix, write_motion
from workbench.cli.output import (
    Up,
    print_page,
    say,
    say_notes,
    warn_of,
    warn_without_effect,
)
from workbench.environment import expanded
from workbench.errors import BadArgument, some_of
from workbench.fitting.doubts import of_person
from workbench.fitting.marker_files import (
    MarkerRecording,
    holds_markers,
    read_markers,
    write_markers,
)
from workbench.geometry.guesses import UNITS
from workbench.motions import Motion, bones_of, load_tissue, read_motion
from workbench.motions.soft_tissue import betas_with_tissue, displaced_by, with_tissue
from workbench.plots import plot_motion
from workbench.plots.style import drawn, png
from workbench.reports.replays import motion_page
from workbench.writing import write_file

MARKERS = (".npz", ".trc")  # what is written of markers
NO_PAIRS = np.zeros((0, 2), dtype=np.int64)


def motion(
    file: Annotated[
        Path,
        typer.Argument(
            help="A motion: .bvh, .glb, .gltf, or .npz as of AMASS; or markers: .c3d, .trc, .npz."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write it to this file: a motion as .bvh, .npz or .glb, markers as .trc or .npz."
        ),
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Frames a second to which a motion is resampled.")
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(help="Frames a second of a motion whose file does not say it, or says wrong."),
    ] = None,
    strip: Annotated[
        Path | None, typer.Option(help="Draw some frames side by side into this .png.")
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option(help="Write a page (.html) on which a body plays the motion."),
    ] = None,
    body: Annotated[
        str | None,
        typer.Option(
            help=f"The body whose bones a motion moves ({', '.join(BODIES)}, or a file of your "
            "own); a .bvh has bones of its own."
        ),
    ] = None,
    tissue: Annotated[
        bool,
        typer.Option(
            "--tissue", help="Let soft tissue follow on --page or in a .glb; it is simulated."
        ),
    ] = False,
    exaggeration: Annotated[
        float, typer.Option(help="Multiply the displacements of the tissue by this.", min=0)
    ] = 1.0,
    unit: Annotated[
        str | None,
        typer.Option(
            help=f"Unit of a .bvh or of markers ({', '.join(UNITS)}; cmu is that of BVH "
            "conversions of CMU's recordings, 0.0564 m)."
        ),
    ] = None,
    up: Up = None,
) -> None:
    """Say what a file of a motion or of markers holds, draw it, and convert it."""
    console, path = Console(), expanded(file)
    for option, number in (("--fps", fps), ("--rate", rate)):
        if number is not None and not 0 < number < np.inf:
            raise BadArgument(f"{option} takes a number above 0, not {number:g}")
    if strip is not None and strip.suffix.lower() != ".png":
        raise BadArgument(f"--strip takes a file that ends in .png, not {strip}")
    if page is not None and page.suffix.lower() != ".html":
        raise BadArgument(f"--page takes a file that ends in .html, not {page}")
    if holds_markers(path):
        refuse_suffix(out, MARKERS, "markers")
        others = ("--fps", fps), ("--rate", rate), ("--body", body), ("--page", page)
        for option, given in (*others, ("--tissue", tissue or None)):
            if given is not None:
                warn_without_effect(console, option, f"{path.name} holds markers, and no motion")
        _markers(console, read_markers(path, unit=unit, up=up), path, out, strip)
        return
    refuse_suffix(out, MOTIONS, "a motion")
    model = None if body is None else load_body(body)
    found = read_motion(path, unit=unit, up=up, fps=rate, body=model)
    if unit is not None and path.suffix.lower() == ".npz":
        warn_without_effect(console, "--unit", "a motion in an .npz is in metres")
    _say_motion(console, found, path)
    if fps is not None:
        found = found.resampled(fps)
        say(console, f"resampled to {len(found)} frames at {fps:g} frames a second")
    wanted = "" if out is None else out.suffix.lower()
    bare = found.bones is None and (strip is not None or wanted == ".bvh")
    shown = page is not None or wanted == ".glb"
    if exaggeration != 1.0 and not tissue:
        warn_without_effect(console, "--exaggeration", "it is for --tissue")
    if tissue and not shown:
        raise BadArgument("--tissue shows on a page or in a .glb; give --page or --out WALK.glb")
    if model is None and (bare or shown):
        model = load_body("default")
        say(console, "the body is default; --body takes another")
    if model is not None:
        before = found.notes
        found = found.named(model)
        say_notes(console, found.notes[len(before) :])
        if len(found.betas):
            warn_of(console, of_person(model, found.betas_on(model)))
    if strip is not None:
        places, pairs = _stick_figure(found, model)
        _draw(strip, places, pairs, found.fps)
        say(console, f"strip: {escape(str(strip))}")
    betas, told = None, ""
    if tissue:
        assert model is not None
        found, model, betas, told = _with_tissue(console, found, model, exaggeration)
    if page is not None:
        assert model is not None
        made = motion_page(found, model, path.name, betas, [f"{told}."] if told else ())
        print_page(console, "page", made.save(page))
    if out is not None:
        write_motion(console, out, found, model, betas=betas)


def _with_tissue(
    console: Console, found: Motion, body: Body, exaggeration: float
) -> tuple[Motion, SkinnedBody, Array, str]:
    """The motion at the tissue's rate, the body with tissue, its betas in every frame; a sentence.

    The sentence says where the tissue comes from, and how far it moves.
    """
    soft = load_tissue()
    if not isinstance(body, SkinnedBody):
        raise BadArgument(f"body {body.name!r} has no soft tissue; take --body default")
    found = soft.prepared(found)
    betas = betas_with_tissue(body, soft, found, exaggeration)
    away = 1e3 * np.linalg.norm(displaced_by(soft, betas), axis=2)
    told = (
        "The soft tissue is simulated, and was learned from no measurement of people: in "
        f"{len(found)} frames at {found.fps:g} frames a second it moves vertices by "
        f"{away.mean():.1f} mm on average and {away.max():.0f} mm at most"
    )
    if exaggeration != 1.0:
        told += f", {exaggeration:g} times as far as the model says"
    say(console, told)
    return found, with_tissue(body, soft), betas, told


def _say_motion(console: Console, found: Motion, path: Path) -> None:
    moved = np.linalg.norm(np.diff(found.trans, axis=0), axis=1)
    lines = [
        f"{path.name} holds a motion of {len(found)} frames at {found.fps:g} frames a second, "
        f"{found.seconds:.2f} s",
        f"{len(found.joint_names)} joints: {some_of(found.joint_names)}",
        f"the root travels {moved.sum():.2f} m",
    ]
    if found.bones is not None:
        tall = float(np.ptp(np.concatenate([found.joints()[0], _ends(found)[0]])[:, 1]))
        lines.append(f"it has bones of its own, {tall:.2f} m tall in the first frame")
    if len(found.betas):
        lines.append(f"{len(found.betas)} betas, the largest {np.abs(found.betas).max():.2f}")
    if found.expression is not None:
        lines.append(f"{found.expression.shape[1]} coefficients of expression")
    for line in lines:
        say(console, escape(line))
    say_notes(console, found.notes)


def _ends(found: Motion) -> Array:
    assert found.bones is not None
    return found.bones.ends(found.pose[:1], found.trans[:1])


def _stick_figure(found: Motion, model: Body | None) -> tuple[Array, Index]:
    """The joints and ends of bones (T, M, 3) m, and which of them are joined by a line."""
    bones = found.bones if model is None else bones_of(model, found.betas)
    assert bones is not None  # there is one or the other by now
    K, E = len(bones.parents), len(bones.end_parents)
    joints, ends = (f(found.pose, found.trans) for f in (bones.joints, bones.ends))
    last = np.column_stack([np.arange(K, K + E), np.array(bones.end_parents, dtype=np.int64)])
    return np.concatenate([joints, ends], axis=1), np.concatenate([bones.pairs, last])


def _markers(
    console: Console, found: MarkerRecording, path: Path, out: Path | None, strip: Path | None
) -> None:
    T, M = found.markers.shape[:2]
    rate = "of an unknown rate" if found.fps is None else f"at {found.fps:g} frames a second"
    say(console, escape(f"{path.name} holds {M} markers in {T} frames {rate}"))
    say(console, escape(f"labels: {some_of(found.labels)}"))
    say_notes(console, found.notes)
    if strip is not None:
        seen: Mask = np.asarray(np.isfinite(found.markers[..., 0]).any(axis=1))
        _draw(strip, found.markers[seen], NO_PAIRS, found.fps if seen.all() else None)
        say(console, f"strip: {escape(str(strip))}")
    if out is not None:
        write_markers(out, found)
        say(console, f"markers: {escape(str(out))}")


def _draw(path: Path, places: Array, pairs: Index, fps: float | None) -> None:
    figure = drawn(lambda ax: plot_motion(places, pairs, fps, ax=ax), 10, 3)
    write_file(path, png(figure))
