"""`workbench fit`: keypoints, a folder of images, a video, markers, a mesh."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape

from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body, why_not_skinned
from workbench.bodies.catalogue import load_body
from workbench.bodies.triangles import TriangleBody
from workbench.cli import Interrupted, interrupts_say
from workbench.cli.console import (
    above_zero,
    files_inside,
    folder_to_write,
    print_page,
    say,
    say_notes,
    warn_of,
    warn_unused,
    warn_without_effect,
)
from workbench.cli.options import Dask, Workers, executing
from workbench.cli.register import do_missing_jobs
from workbench.cli.run import Compare, LiveTrace, Out, carry_out, solver_named
from workbench.environment import expanded
from workbench.errors import BadArgument, BadFile, NotSupported, listed
from workbench.experiments import Experiment
from workbench.fitting.body_priors import apart_prior, checked_height, mixture_prior, pose_prior
from workbench.fitting.doubts import doubts
from workbench.fitting.files.clips import read_clip
from workbench.fitting.images import (
    SPREAD,
    ByHeight,
    Smplify,
    SmplifyTerms,
    WithPosePrior,
    WithStature,
    image_fit,
    image_mean,
)
from workbench.fitting.jobs import ImageReading, ImageWork, image_jobs, in_parts
from workbench.fitting.keypoints import Terms, as_marked, keypoint_fit
from workbench.fitting.known_points import own_mesh
from workbench.fitting.marker_files import READERS as MARKERS
from workbench.fitting.marker_files import read_markers
from workbench.fitting.marker_sets import OUT, MarkerSet, known_markers, matched, read_marker_set
from workbench.fitting.markers import SIGMA, marker_solver, rms_of_markers
from workbench.fitting.mosh import mosh
from workbench.fitting.observations import Clip
from workbench.fitting.setup import MANY, Setup
from workbench.fitting.videos import video_fit, video_mean
from workbench.geometry.guesses import sizes_of
from workbench.geometry.meshes import READERS, WITH_VERTEX_ORDER
from workbench.motions.soft_tissue import load_tissue, with_tissue
from workbench.reports.many import ImageFolder
from workbench.reports.page import unit_text
from workbench.reports.run import motion_arrays, write_video
from workbench.solvers import DEFAULT, LevenbergMarquardt, Solver, Status
from workbench.writing import write_arrays

FPS = 30.0  # frames per second of a clip that does not say
HIGHEST = 0.1  # m above the skin: what is given in mm by mistake is above it
MEAN_FILE = "mean.npz"
WITHOUT_MEAN = f"interrupted; the report is written, but {MEAN_FILE} is not"
PRIORS = {"gaussian": pose_prior, "mixture": mixture_prior}

FOLDER, MESH = ("--workers", "--dask"), ("--tissue",)
ONE_IMAGE = ("--recipe", "--prior", "--contact", "--height", "--hypotheses")
CAMERAS = ("--cameras", "--camera-to-world", "--size", "--focal", "--person")
WORN = ("--marker-set", "--labels", "--marker-height", "--across")
UNUSED = {  # options without effect, by what is fitted
    "a clip": (*MESH, *FOLDER, *ONE_IMAGE, *WORN, "--compare"),
    "a folder of images": (*MESH, *WORN, "--compare", "--solver", "--mean", "--fps"),
    "markers": (*MESH, *FOLDER, *CAMERAS, *ONE_IMAGE, "--mean", "--compare"),
    "a mesh": (*FOLDER, *CAMERAS, *ONE_IMAGE, *WORN, "--mean", "--fps"),
    "several cameras": (*MESH, *FOLDER, *ONE_IMAGE, *WORN, "--fps"),
    "one image": (*MESH, *FOLDER, *WORN, "--fps"),
}


def below_the_highest(option: typer.CallbackParam, length: float | None) -> float | None:
    """A length of a marker in m. Raises BadArgument for one that must be in mm."""
    if length is not None and not 0 < length < HIGHEST:
        raise BadArgument(
            f"{option.opts[0]} takes a length in m, above 0 and below {HIGHEST:g}, such as 0.001 "
            f"for 1 mm; not {length:g}"
        )
    return length


def kind_of_fit(paths: list[Path], video: bool) -> str:
    """What is fitted, by the files; a key of UNUSED."""
    first = paths[0]
    suffix = first.suffix.lower()
    kind = "one image" if len(paths) == 1 else "several cameras"
    if video:
        kind = "a clip"
    elif first.is_dir():
        kind = "a folder of images"
    elif suffix in MARKERS or suffix in READERS:
        kind = "markers" if suffix in MARKERS else "a mesh"
    elif suffix not in (".json", ""):
        raise BadFile(
            f"{first} is nothing that is fitted: keypoints are read from .json as detectors write "
            f"it (a picture needs one first), markers from {listed(MARKERS)}, and the body's own "
            f"vertices from {listed(WITH_VERTEX_ORDER)}; `workbench register` takes scans, and "
            "`workbench convert` skeletons and motions"
        )
    if len(paths) > 1 and kind != "several cameras":
        raise BadFile(
            f"one folder, mesh or file of markers is fitted at a time, not {len(paths)}; give one"
        )
    return kind


def fit(
    ctx: typer.Context,
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Keypoints of one moment, one JSON file per camera (COCO, OpenPose, AlphaPose, "
            "MMPose, Sapiens, ViTPose, Ultralytics, EasyMocap, MediaPipe, lists, or points by "
            "name); a folder of such files, of one image each; with --video a clip; "
            "markers: .c3d, .trc, or .npz with markers (T, M, 3) and labels (M,); or a mesh "
            f"({', '.join(WITH_VERTEX_ORDER)}) of the body's topology, in metres."
        ),
    ],
    cameras: Annotated[
        Path | None,
        typer.Option(
            help="Calibration, its cameras in the order of the files or named as they are: of "
            "Pose2Sim, Anipose, EasyMocap, OpenCV, COLMAP or CMU Panoptic (howto/formats.md), or "
            '{"name": {"K": 3x3, "R": 3x3, "t": 3, "distortion": [...], "size": [w, h]}}.'
        ),
    ] = None,
    camera_to_world: Annotated[
        bool, typer.Option("--camera-to-world", help="--cameras holds poses, camera to world.")
    ] = False,
    size: Annotated[str | None, typer.Option(help="The image's size, WIDTHxHEIGHT in px.")] = None,
    focal: Annotated[
        float | None,
        typer.Option(callback=above_zero, help="Focal length in px; else it is estimated too."),
    ] = None,
    person: Annotated[
        int | None, typer.Option(help="Which person of a file, from 0; else the largest.")
    ] = None,
    height: Annotated[
        float | None, typer.Option(help="Known stature of the person in one image, in m.")
    ] = None,
    recipe: Annotated[
        Literal["default", "smplify"],
        typer.Option(help="Terms and stages for one image: our own, or SMPLify's."),
    ] = "default",
    prior: Annotated[
        Literal["gaussian", "mixture"] | None,
        typer.Option(help="Prior on the pose for one image; else the recipe's."),
    ] = None,
    contact: Annotated[
        bool, typer.Option("--contact", help="In one image, keep limbs out of each other.")
    ] = False,
    hypotheses: Annotated[int, typer.Option(help="Number of starts for one image.")] = 1,
    mean: Annotated[
        bool,
        typer.Option(
            "--mean", help="Also write the posterior's mean, nearer to the truth on average."
        ),
    ] = False,
    video: Annotated[
        bool, typer.Option(help="FILES is a clip: a folder with a file for each frame.")
    ] = False,
    fps: Annotated[
        float | None,
        typer.Option(
            callback=above_zero, help=f"Frames a second of a clip or markers, else {FPS:g}."
        ),
    ] = None,
    tissue: Annotated[bool, typer.Option("--tissue", help="Fit soft tissue to a mesh.")] = False,
    marker_set: Annotated[
        Path | None, typer.Option(help='Markers on the body: JSON {"LFHD": vertex}.')
    ] = None,
    labels: Annotated[
        Path | None,
        typer.Option(help="What labels of markers mean: a .csv with lines such as LHeel,LHEE."),
    ] = None,
    marker_height: Annotated[
        float | None,
        typer.Option(
            callback=below_the_highest, help=f"Height of markers above the skin in m, else {OUT:g}."
        ),
    ] = None,
    across: Annotated[
        float | None,
        typer.Option(
            callback=below_the_highest,
            help="Standard deviation of this height in m, such as 0.001.",
        ),
    ] = None,
    body: Annotated[str, typer.Option(help="An embedded body, or a file of your own.")] = "default",
    sigma: Annotated[
        float | None,
        typer.Option(callback=above_zero, help="Standard deviation of the data, in px or m."),
    ] = None,
    solver: Annotated[
        str | None,
        typer.Option(
            "--solver", help=f"A solver; else {DEFAULT}, or levenberg-marquardt for one image."
        ),
    ] = None,
    compare: Compare = False,
    workers: Workers = 1,
    dask: Dask = None,
    out: Out = Path("runs"),
) -> None:
    """Fit a body to keypoints, a video, markers or a mesh; write a report to runs/FILE/.

    One image is fitted as SMPLify does, from a start that a small network reads off the keypoints.
    For a folder of images the results are in runs/fit-FOLDER/, and a command that was interrupted
    continues where it stopped.
    """
    if solver is not None:
        solver_named(solver)
    console, paths = Console(), [expanded(path) for path in files]
    reading = ImageReading(size_of(size), focal, cameras, person, camera_to_world)
    how = recipe_of(recipe, height, sigma, prior, contact)
    model, first = load_body(body), paths[0]
    kind = kind_of_fit(paths, video)
    warn_unused(console, ctx, UNUSED[kind], f"it is not for {kind}")
    if contact and recipe == "smplify":
        warn_without_effect(console, "--contact", "SMPLify has spheres for that")
    named = solver_named(solver or DEFAULT)
    if kind == "a clip":
        clip = read_clip(
            first,
            fps=fps or FPS,
            calibration=cameras,
            size=reading.size,
            focal=focal,
            person=person,
            camera_to_world=camera_to_world,
        )
        fit_video(console, first, clip, model, sigma, named, out, mean)
    elif kind == "a folder of images":
        work = ImageWork(model, how, reading, hypotheses)
        fit_folder(console, first, work, body=body, out=out, workers=workers, dask=dask)
    elif kind == "markers":
        worn = Worn(marker_set, marker_height or OUT, across, labels)
        fit_markers(console, first, model, worn, fps, sigma, named, out)
    else:
        if focal is not None and cameras is not None and kind != "a mesh":
            why = f"{cameras} says the focal length of each camera"
            warn_without_effect(console, "--focal", why)
        setup = (
            own_mesh(
                first,
                with_tissue(model, load_tissue()) if tissue else model,
                0.002 if sigma is None else sigma,
            )
            if kind == "a mesh"
            else of_keypoints(paths, model, reading, how, sigma, hypotheses)
        )
        one = Experiment(
            first.stem, lambda: setup, "a user's own file", source=str(first.resolve())
        )
        by_setup = solver is None and setup.strategy is not None
        values, folder = carry_out(console, one, None if by_setup else named, compare, out)
        (folder / MEAN_FILE).unlink(missing_ok=True)  # of an earlier fit
        if mean and kind != "a mesh":
            add_mean(console, setup, values, folder)


def of_keypoints(
    files: list[Path],
    body: SkinnedBody | TriangleBody,
    reading: ImageReading,
    recipe: ByHeight | Smplify,
    sigma: float | None,
    hypotheses: int,
) -> Setup:
    """The fit to keypoints of one moment, from one camera or several."""
    observed = reading.observations(files)
    question = (
        f"Which pose, shape and place of the body explain the keypoints of "
        f"{', '.join(str(f.name) for f in files)}?"
    )
    if len(files) > 1:
        return keypoint_fit(
            observed, body, question, sigma=sigma, kernel=None, relative=as_marked, compared=MANY
        )
    return image_fit(
        observed,
        body,
        question,
        recipe=replace(recipe, solver=LevenbergMarquardt()),
        hypotheses=hypotheses,
        compared=MANY,
    )


def recipe_of(
    kind: str, height: float | None, sigma: float | None, prior: str | None, contact: bool
) -> ByHeight | Smplify:
    """How one image is fitted: by which recipe, with what else is known or asked for."""
    recipe: ByHeight | Smplify = ByHeight(sigma=sigma)
    terms: Terms = WithPosePrior(PRIORS[prior or "gaussian"], (apart_prior,) if contact else ())
    if kind == "smplify":
        recipe = Smplify() if sigma is None else Smplify(sigma)
        terms = SmplifyTerms(PRIORS[prior or "mixture"])
    if height is not None:
        checked_height(height)
        terms = WithStature(height, priors=terms)
    return replace(recipe, priors=terms)


def size_of(text: str | None) -> tuple[int, int] | None:
    """Width and height in px of text such as 1920x1080. Raises BadArgument."""
    if text is None:
        return None
    found = re.fullmatch("([1-9][0-9]{0,5})x([1-9][0-9]{0,5})", text.strip().lower())
    if not found:
        raise BadArgument(f"--size takes WIDTHxHEIGHT in px, such as 1920x1080; not {text!r}")
    return int(found[1]), int(found[2])


def fit_folder(
    console: Console,
    given: Path,
    work: ImageWork,
    *,
    body: str,
    out: Path,
    workers: int,
    dask: str | None,
) -> None:
    """Fit a body to each file of keypoints in a folder; continues where it was interrupted.

    Raises BadFile for a folder without such files, and Interrupted after Ctrl-C.
    """
    jobs = image_jobs(files_inside(console, given, [".json"], "keypoints"))
    source = given.resolve()
    folder = ImageFolder(out / f"fit-{source.name}", work, body, str(source))
    of_work = folder.key_of_work()
    keys = {job: folder.key(job, of_work) for job in jobs}
    with executing(console, workers, dask) as executor:
        do_missing_jobs(
            console,
            folder,
            keys,
            lambda missing: executor(work, in_parts(missing)),
            folder.finish,
            "images",
            "fitted",
        )


def add_mean(console: Console, setup: Setup, values: Values, folder: Path) -> None:
    """Draw about the fit, and write the mean of the draws to `mean.npz` in the report's folder.

    It holds all blocks of the body, with the mean of what is free, and other means of the problem,
    such as an unknown focal length; and, of the body's landmarks by their `names` (M,), `landmarks`
    (M, 3) m in that body and `sd` (M,) m, their standard deviations in space once the middle of all
    landmarks of a draw is brought to that of the mean. `sd_is` says what these were compared with.
    """
    assert setup.body is not None  # which every fit to images has
    console.print("[dim]drawing from the posterior[/]")
    with interrupts_say(lambda: WITHOUT_MEAN):
        found = image_mean(setup, values)
    blocks = [block.name for block in setup.body.blocks()]
    arrays = {name: found.values[name] for name in (*blocks, *setup.problem.free.names)}
    of_landmarks = {"landmarks": found.landmarks, "sd": found.sd, "names": np.array(found.names)}
    write_arrays(folder / MEAN_FILE, {**arrays, **of_landmarks, "sd_is": np.array(SPREAD)})
    say(
        console,
        f"the mean of the posterior puts the body {1e3 * found.moved:.0f} mm from its likeliest "
        f"place (a standard error of {1e3 * found.error:.0f} mm, from {found.draws} draws); "
        f"landmarks have a standard deviation of {1e3 * np.sqrt(np.mean(found.sd**2)):.0f} mm, "
        f"which is {SPREAD}",
    )
    print_page(console, "mean", folder / MEAN_FILE)


def fit_video(
    console: Console,
    source: Path,
    clip: Clip,
    body: SkinnedBody | TriangleBody,
    sigma: float | None,
    solver: Solver,
    out: Path,
    mean: bool,
) -> None:
    """Fit all frames of a clip together, and write the page.

    With `mean`, the folder gets `mean.npz` as well, the mean of the posterior as a motion. After an
    interrupt the page holds the motion that was found until then, and the exit code is 130.
    """
    folder = folder_to_write(out, source.resolve().name, str(source.resolve()))
    question = f"Which shape and which motion explain the {clip.count} frames of {source}?"
    with console.status("") as status:
        setup = video_fit(
            clip,
            body,
            question,
            sigma=sigma,
            told=lambda done, all_: status.update(f"frame {done} of {all_}"),
        )
    for note in setup.notes:
        console.print(f"[dim]{escape(note)}.[/]", highlight=False)
    console.print(f"[dim]fitting {clip.count} frames together[/]", highlight=False)
    with LiveTrace(console) as trace:
        solution = solver.solve(setup.problem, setup.start, callback=trace)
    values = {**setup.start, **solution.values}
    warn_of(console, doubts(setup, values, solution))
    console.print(f"{solution.status.name}: {escape(solution.message)}", highlight=False)
    for one in setup.measures(values):
        unit = unit_text(one.unit)
        console.print(f"{escape(one.name)}: {one.value:.4g} {unit}".rstrip(), highlight=False)
    title = source.resolve().name
    page = write_video(setup, solution, folder, title, str(source.resolve()))
    (folder / MEAN_FILE).unlink(missing_ok=True)  # of an earlier fit
    print_page(console, "report", page)
    if solution.status is Status.STOPPED:
        raise Interrupted("interrupted; the page holds the motion that was found until then")
    if mean and setup.moving is not None:
        with interrupts_say(lambda: WITHOUT_MEAN), console.status("") as status:
            expected = video_mean(
                setup,
                values,
                told=lambda done, all_: status.update(f"drawing: frame {done} of {all_}"),
            )
        write_arrays(folder / MEAN_FILE, motion_arrays(setup.moving, expected))
        print_page(console, "mean", folder / MEAN_FILE)


@dataclass(frozen=True)
class Worn:
    """What is known of the markers that a person wears."""

    file: Path | None = None  # the marker set, in JSON; None for the markers whose places are known
    height: float = OUT  # of their centres above the skin, in m
    # its standard deviation in m, or None where places are uncertain in all directions
    across: float | None = None
    labels: Path | None = None  # a table of what the labels of a recording mean, or None

    def on(self, body: SkinnedBody) -> MarkerSet:
        """The markers on a body. Raises BadFile as `read_marker_set` does."""
        placed = known_markers(body) if self.file is None else read_marker_set(self.file, body)
        vertices = dict(zip(placed.names, placed.vertices, strict=True))
        return MarkerSet.of(body, vertices, self.height)


def fit_markers(
    console: Console,
    file: Path,
    body: Body,
    markers_worn: Worn,
    fps: float | None,
    sigma: float | None,
    solver: Solver,
    out: Path,
) -> None:
    """Find shape and offsets from some frames, report on them, and find the pose of every frame.

    The report's folder gets `motion.npz`: `poses` (T, K, 3) rad, `trans` (T, 3) m, `betas` (B,),
    `offsets` (M, 3) m, `labels` (M,), `frames`, from which shape and offsets were found, `errors`
    (T, M) m, `joint_names`, and `fps`, if it is known. `read_motion` reads it.
    """
    if not isinstance(body, SkinnedBody):
        raise NotSupported(why_not_skinned(body, "a fit to markers", "take a SkinnedBody"))
    sizes = sizes_of(body.joint_names)
    recording = read_markers(file, sizes=sizes, labels=markers_worn.labels)
    worn, places, notes = matched(recording.labels, markers_worn.on(body))
    say_notes(console, (*recording.notes, *notes))
    markers, precision = recording.markers[:, list(places)], SIGMA if sigma is None else sigma
    folders: list[Path] = []

    def solve(setup: Setup) -> Values:
        question = (
            f"Which shape of the body, and which places of {len(worn.names)} markers on it, "
            f"explain {len(setup.start['observed'])} of the {len(markers)} frames of {file.name}?"
        )
        experiment = Experiment(
            file.stem,
            lambda: replace(setup, question=question),
            "a user's own file",
            source=str(file.resolve()),
        )
        values, folder = carry_out(console, experiment, marker_solver(solver), False, out)
        folders.append(folder)
        return values

    found = mosh(
        markers,
        body,
        worn,
        sigma=precision,
        across=markers_worn.across,
        solve=solve,
        progress=lambda text: console.print(f"[dim]{text}[/]", highlight=False),
    )
    (folder,) = folders
    arrays: dict[str, NDArray[Any]] = {
        "poses": found.pose,
        "trans": found.trans,
        "errors": found.errors,
        "frames": found.frames,
        "betas": found.betas,
        "offsets": found.offsets,
        "labels": np.array(worn.names),
        "joint_names": np.array(body.joint_names),
        "up_axis": np.array("y"),
    }
    rate = recording.fps if fps is None else fps
    if rate is not None:
        arrays["fps"] = np.array(rate)
    write_arrays(folder / "motion.npz", arrays)
    off = 1e3 * float(np.sqrt(np.nanmean(found.errors**2)))
    worst = int(np.argmax(rms_of_markers(found.errors)))
    say(
        console,
        f"markers are {off:.1f} mm from those of the body (root mean square over {len(markers)} "
        f"frames); the worst is {escape(worn.names[worst])}",
    )
    print_page(console, "motion", folder / "motion.npz")
