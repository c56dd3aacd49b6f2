"""`workbench train` and `workbench rig`: bodies from registrations, skeletons from meshes."""

import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from workbench.bodies import SkinnedBody
from workbench.bodies.files.saving import save_body
from workbench.cli import interrupts_say
from workbench.cli.console import (
    Bars,
    above_zero,
    at_least_one,
    print_page,
    rich_table,
    say,
    say_notes,
    warn_unused,
)
from workbench.cli.options import Workers
from workbench.cli.run import Out
from workbench.errors import BadArgument, BadFile, check_known
from workbench.motions import save_motion
from workbench.reading.facts import json_in
from workbench.reports import write_card
from workbench.reports.folder import make_folder
from workbench.reports.page import Table
from workbench.synthetic.made_up import noisy_tubes
from workbench.threads import limited_threads
from workbench.training.blocks import REACH, alternation, without_blend_shapes
from workbench.training.checkpoint import FILE as CHECKPOINT
from workbench.training.evaluation import CARD, check_held_out, held_out_errors, shapes_explained
from workbench.training.execution import Execution, Processes, Progress, Report
from workbench.training.first_guess import Start, read_start
from workbench.training.folder import GENDERS, FolderRegistrations, open_folder, read_meshes
from workbench.training.registrations import Registrations
from workbench.training.rigging.joints import in_words
from workbench.training.rigging.rig import Rigged, pose_rms
from workbench.training.rigging.rig import rig as find_rig
from workbench.training.rigging.steps import RigSteps, silent
from workbench.training.training import train as train_body

START_FILE = "start.npz"
LINE_SECONDS = 5.0  # between two lines on parts of a block
UNUSED_BY_TUBES = {  # options that change nothing where synthetic tubes are trained from, and why
    "--start": "the synthetic tube has its own template",
    "--gender": "the synthetic tubes have no gender",
    "--reach": "every joint of the synthetic tube changes its whole surface",
}


def train(
    ctx: typer.Context,
    folder: Annotated[
        Path | None,
        typer.Argument(
            help="Folder with registrations.csv (file, subject, gender, set) and meshes in metres; "
            "without one, a synthetic tube with bones is trained from synthetic registrations."
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            help="The template, its tree of joints and its division into segments: an embedded "
            "body, a body's file, or an .npz; "
            f"{START_FILE} in the folder if there is one, else default."
        ),
    ] = None,
    gender: Annotated[
        str | None, typer.Option(help=f"Use registrations of one gender ({', '.join(GENDERS)}).")
    ] = None,
    held_out: Annotated[
        Path | None, typer.Option(help="Folder of other people, on whom the body is measured.")
    ] = None,
    betas: Annotated[
        int, typer.Option(callback=at_least_one, help="Number of shape directions.")
    ] = 10,
    rounds: Annotated[
        int, typer.Option(callback=at_least_one, help="Number of rounds of the alternation.")
    ] = 2,
    reach: Annotated[
        int, typer.Option(min=0, help="Number of bones between a vertex and joints that change it.")
    ] = REACH,
    blend_shapes: Annotated[
        bool,
        typer.Option(help="Learn pose blend shapes, or only templates, joints, weights and poses."),
    ] = True,
    jobs: Workers = 2,
    out: Out = Path("runs"),
) -> None:
    """Train a body model from registrations; a run that was killed continues where it stopped.

    Writes runs/NAME/: checkpoint.npz after every block (a step of the alternation), body.npz and
    its model card at the end.
    """
    console = Console()
    if gender is not None:
        check_known("gender", gender, GENDERS)
    if folder is None:
        for option, because in UNUSED_BY_TUBES.items():
            warn_unused(console, ctx, [option], because)
        gender = None
    name, guess, poses, shapes = _data(console, folder, start, gender)
    others = None if held_out is None else _held_out(held_out, guess)
    plan = without_blend_shapes(rounds=rounds)
    if blend_shapes:
        plan = alternation(rounds=rounds, reach=None if folder is None else reach)
    else:
        warn_unused(console, ctx, ["--reach"], "there are no blend shapes to reach anywhere")
    place = out / f"train-{name}{f'-{gender}' if gender else ''}"
    make_folder(place)

    def interruption() -> str:
        if not any(place.rglob(CHECKPOINT)):
            return f"interrupted; there is no checkpoint in {place}, so no result was kept"
        return (
            f"interrupted; what was found until the last block is in {place}, and the same "
            "command continues from there"
        )

    with interrupts_say(interruption):
        trained = train_body(
            poses,
            guess,
            multi_shape=shapes,
            plan=plan,
            n_betas=betas,
            folder=place,
            report=Lines(console),
            card=_origin(folder),
            executor=Processes(jobs),
        )
        body = trained.body
        if others is not None:
            console.print("[dim]fitting the held-out people[/]")
            errors = _errors(body, others, Execution(Processes(jobs)))
            body = replace(body, card={**body.card, "held_out": errors})
            for what, number in errors.items():
                console.print(f"  {what}: {number:g}")
        save_body(body, place / "body.npz")
        page = write_card(body, place / "card", str((place / "body.npz").resolve()))
    print_page(console, "body", place / "body.npz")
    print_page(console, "card", page)


def _data(
    console: Console, folder: Path | None, start: str | None, gender: str | None
) -> tuple[str, Start, Registrations, Registrations | None]:
    """The run's name, its start, and the registrations of the two sets, poses and shapes."""
    if folder is None:
        console.print(
            "no folder was given: training a synthetic tube with bones from data with 1 mm of "
            "noise; nothing here was measured"
        )
        return "made-up", *noisy_tubes(noise=0.001), None
    own = folder / START_FILE
    guess = read_start(start or (own if own.is_file() else "default"))
    console.print("[dim]reading every registration[/]")
    every = open_folder(folder, len(guess.template), guess.faces)
    poses, shapes = every.only("poses", gender), every.only("shapes", gender)
    if not poses.rows:
        raise BadArgument(
            f"{folder} has no registrations of the set 'poses'"
            f"{f' and gender {gender!r}' if gender else ''}; training learns from them how the "
            "pose changes the surface"
        )
    console.print(
        f"{len(poses.rows)} registrations of {len(poses.subjects)} subjects in poses, "
        f"{len(shapes.rows)} people for shape"
    )
    return folder.resolve().name, guess, poses, shapes if shapes.rows else None


def _held_out(folder: Path, guess: Start) -> FolderRegistrations:
    """The registrations of other people, on whom the body is measured. Raises BadArgument."""
    every = open_folder(folder, len(guess.template), guess.faces)
    poses = every.only("poses")
    if not poses.rows:
        raise BadArgument(
            f"{folder} has no registrations of the set 'poses', on which a body is measured; give "
            "a folder that has some, or leave --held-out out"
        )
    check_held_out(poses, len(guess.template))
    return every


def _errors(
    body: SkinnedBody, others: FolderRegistrations, execution: Execution
) -> dict[str, float]:
    """The errors of the body on other people: in poses, and, where there are some, at rest."""
    shapes = others.only("shapes")
    with limited_threads():
        errors = held_out_errors(body, others.only("poses"), execution)
        return errors | (shapes_explained(body, shapes, execution) if shapes.rows else {})


def _origin(folder: Path | None) -> dict[str, Any]:
    """What is known about where the registrations come from."""
    if folder is None:
        return {
            "provenance": ["Synthetic: random arrays on a tube with bones. Nothing was measured."]
        }
    card = folder / CARD
    if not card.is_file():
        return {"provenance": [f"Trained on the registrations in {folder.name}."]}
    try:
        data = json_in(card)
    except BadFile as error:
        raise BadFile(f"{error}; remove it or correct it") from error
    return {"provenance": ["Synthetic: see registrations."], "registrations": data}


class Lines(Report):
    """A line for each block, and further lines within blocks that take long."""

    def __init__(self, console: Console) -> None:
        self._console, self._printed = console, time.monotonic()

    def block(self, progress: Progress) -> None:
        """The cost before and after a block, and its terms."""
        entry = progress.entry
        before, after = sum(entry.before.values()), sum(entry.after.values())
        terms = ", ".join(f"{name} {cost:.4g}" for name, cost in entry.after.items())
        self._print(
            f"{progress.number:>3}/{progress.of} {entry.block:<9} cost {before:.6g} -> "
            f"{after:.6g}  ({terms})  {entry.seconds:.1f} s, about "
            f"{progress.seconds_left:.0f} s left"
        )

    def part(self, doing: str, done: int, of: int) -> None:
        """How much of a block is done, every few seconds."""
        if time.monotonic() - self._printed > LINE_SECONDS:
            self._print(f"        {doing}: {done} of {of}")

    def _print(self, line: str) -> None:
        self._printed = time.monotonic()
        self._console.print(line, highlight=False, soft_wrap=True)


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
        str | None, typer.Option(help="A mesh, or a body, in the rest pose; else the first mesh.")
    ] = None,
    bones: Annotated[
        int | None,
        typer.Option(help="Number of bones; else as many as the motion and --tolerance ask for."),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(help="Error, rms in m, below which no further bone is looked for."),
    ] = None,
    frames: Annotated[
        int, typer.Option(help="Learn from at most so many meshes, spread evenly.")
    ] = 200,
    motion: Annotated[
        Path | None,
        typer.Option(help="Write the motion of the meshes that were learned from to this .npz."),
    ] = None,
    fps: Annotated[
        float, typer.Option(callback=above_zero, help="Meshes a second, for --motion.")
    ] = 30.0,
) -> None:
    """Find the skeleton and the skinning weights of meshes in motion, and write them as a body.

    The last fifth of the meshes is held out, and the body is measured on up to 20 of them. The
    command says which joints the motion leaves undetermined, and in which direction. If it is
    interrupted, it writes the body so far, and the same command continues from a checkpoint.
    """
    console = Console()
    if out.suffix not in (".npz", ".pkl"):
        raise BadArgument(f"--out takes a file that ends in .npz or .pkl, not {out}")
    if motion is not None and motion.suffix != ".npz":
        raise BadArgument(f"--motion takes a file that ends in .npz, not {motion}")
    if frames < 2:
        raise BadArgument(f"--frames takes 2 or more, not {frames}")
    every, faces, own = read_meshes(meshes, rest)
    T = len(every)
    learned = T - T // 5
    rows = np.unique(np.linspace(0, learned - 1, min(learned, frames)).round().astype(int))
    others = np.unique(np.linspace(learned, T - 1, min(T // 5, MOST_HELD_OUT)).round().astype(int))
    first = every[0] if own is None else own
    say(
        console,
        f"{T} meshes of {every.shape[1]} vertices: learning from {len(rows)}, the last "
        f"{T // 5} are held out",
    )
    card = {"provenance": [f"Rigged from the meshes in {', '.join(p.name for p in meshes[:3])}."]}
    bars, steps = Bars(console), RigSteps(out.with_suffix(".checkpoint.npz"))

    rigged = partial(
        find_rig, every[rows], faces, rest=first, bones=bones, tolerance=tolerance, card=card
    )

    def interruption() -> str:
        if not steps.arrays:
            return f"interrupted at {bars.last}; nothing was written"
        so_far = rigged(steps=steps.so_far(), report=silent)
        save_body(so_far.body, out)
        return (
            f"interrupted at {bars.last}; {out} is the body so far, with {so_far.body.n_joints} "
            f"bones and {1e3 * so_far.rms:.3g} mm from the meshes (rms), and the same command "
            f"continues from {steps.path}"
        )

    with interrupts_say(interruption), bars:
        result = rigged(steps=steps, report=bars)
    save_body(result.body, out)
    steps.remove()
    if motion is not None:
        step = (rows[-1] - rows[0]) / (len(rows) - 1)  # meshes between two that were learned from
        save_motion(motion, result.motion(fps / float(step)))
    console.print(rich_table(_joints(result)))
    say(console, f"{result.body.n_joints} bones; {1e3 * result.rms:.3g} mm from the meshes (rms)")
    if len(others):
        rms = pose_rms(result.body, every[others])
        say(console, f"{1e3 * rms:.3g} mm from {len(others)} meshes that were held out (rms)")
    say_notes(console, result.notes)
    print_page(console, "body", out)
    if motion is not None:
        print_page(console, "motion", motion)


def _joints(rigged: Rigged) -> Table:
    """A line for each joint: its place, how well it is determined, and along what it may slide."""
    names = rigged.body.joint_names
    rows = tuple(
        (
            names[joint.bones[1]],
            names[joint.bones[0]],
            " ".join(f"{x:.3f}" for x in joint.place),
            " ".join(f"{10 * parted:.2g}" for parted in joint.parting[::-1]),
            " and ".join(in_words(direction) for direction in joint.free) or "-",
        )
        for joint in rigged.joints
    )
    head = ("joint of", "with", "at rest, m", "gap if 1 cm off, mm", "may slide along")
    return Table(head, rows, ())
