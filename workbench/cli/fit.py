"""`workbench fit`: keypoints, a folder of images, a video, markers, a mesh."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

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
from workbench.cli import fit_options as option
from workbench.cli.console import (
    files_inside,
    folder_to_write,
    print_page,
    say,
    say_notes,
    warn_of,
    warn_unused,
    warn_without_effect,
)
from workbench.cli.fit_options import FPS, WITHOUT_EFFECT, kind_of_fit, size_of
from workbench.cli.options import BodyName, Dask, Workers, executing
from workbench.cli.register import do_missing_jobs
from workbench.cli.run import Compare, LiveTrace, Out, carry_out, solver_named
from workbench.environment import expanded
from workbench.errors import NotSupported
from workbench.experiments import Experiment
from workbench.fitting.body_priors import apart_prior, checked_height, mixture_prior, pose_prior
from workbench.fitting.doubts import doubts
from workbench.fitting.files.clips import read_clip
from workbench.fitting.images import (
    SPREAD_NOTE,
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
from workbench.fitting.marker_files import read_markers
from workbench.fitting.marker_sets import (
    MARKER_HEIGHT,
    MarkerSet,
    known_markers,
    matched,
    read_marker_set,
)
from workbench.fitting.markers import SIGMA, marker_solver, rms_of_markers
from workbench.fitting.mosh import mosh
from workbench.fitting.observations import Clip
from workbench.fitting.setup import MANY, Setup
from workbench.fitting.videos import video_fit, video_mean
from workbench.geometry.guesses import sizes_of
from workbench.motions.soft_tissue import load_tissue, with_tissue
from workbench.reports.many import ImageFolder
from workbench.reports.page import unit_text
from workbench.reports.run import motion_arrays, write_video
from workbench.solvers import DEFAULT, LevenbergMarquardt, Solver, Status
from workbench.writing import write_arrays

MEAN_FILE = "mean.npz"
WITHOUT_MEAN = f"interrupted; the report is written, but {MEAN_FILE} is not"
PRIORS = {"gaussian": pose_prior, "mixture": mixture_prior}


def fit(
    ctx: typer.Context,
    files: option.Files,
    cameras: option.Cameras = None,
    camera_to_world: option.CameraToWorld = False,
    size: option.Size = None,
    focal: option.Focal = None,
    person: option.Person = None,
    height: option.Height = None,
    recipe: option.Recipe = "default",
    prior: option.Prior = None,
    contact: option.Contact = False,
    hypotheses: option.Hypotheses = 1,
    mean: option.Mean = False,
    video: option.Video = False,
    fps: option.Fps = None,
    tissue: option.Tissue = False,
    marker_set: option.MarkerSetFile = None,
    labels: option.Labels = None,
    marker_height: option.MarkerHeight = None,
    across: option.Across = None,
    body: BodyName = "default",
    sigma: option.Sigma = None,
    solver: option.FitSolver = None,
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
    chosen = solver_named(solver or DEFAULT)
    console, paths = Console(), [expanded(path) for path in files]
    first = paths[0]
    reading = ImageReading(size_of(size), focal, cameras, person, camera_to_world)
    image_recipe = recipe_of(recipe, height, sigma, prior, contact)
    model, kind = load_body(body), kind_of_fit(paths, video)
    warn_unused(console, ctx, WITHOUT_EFFECT[kind], f"it is not for {kind}")
    if contact and recipe == "smplify":
        warn_without_effect(console, "--contact", "SMPLify has spheres for that")
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
        fit_video(console, first, clip, model, sigma, chosen, out, mean)
        return
    if kind == "a folder of images":
        work = ImageWork(model, image_recipe, reading, hypotheses)
        fit_folder(console, first, work, body=body, out=out, workers=workers, dask=dask)
        return
    if kind == "markers":
        worn = Worn(marker_set, marker_height or MARKER_HEIGHT, across, labels)
        fit_markers(console, first, model, worn, fps, sigma, chosen, out)
        return
    if kind == "a mesh":
        if tissue:
            model = with_tissue(model, load_tissue())
        setup = own_mesh(first, model, 0.002 if sigma is None else sigma)
    else:
        if focal is not None and cameras is not None:
            why = f"{cameras} says the focal length of each camera"
            warn_without_effect(console, "--focal", why)
        setup = keypoint_setup(paths, model, reading, image_recipe, sigma, hypotheses)
    by_setup = solver is None and setup.strategy is not None
    experiment = experiment_of(first, setup)
    values = carry_out(console, experiment, None if by_setup else chosen, compare, out)
    folder = out / experiment.name
    (folder / MEAN_FILE).unlink(missing_ok=True)  # of an earlier fit
    if mean and kind != "a mesh":
        add_mean(console, setup, values, folder)


def experiment_of(file: Path, setup: Setup) -> Experiment:
    """The fit to a user's file as an experiment, which has the file's name."""
    return Experiment(file.stem, lambda: setup, "a user's own file", source=str(file.resolve()))


def keypoint_setup(
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


def fit_folder(
    console: Console,
    images: Path,
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
    jobs = image_jobs(files_inside(console, images, [".json"], "keypoints"))
    source = images.resolve()
    folder = ImageFolder(out / f"fit-{source.name}", work, body, str(source))
    of_work = folder.key_of_work()
    keys = {job: folder.key(job, of_work) for job in jobs}
    with executing(console, workers, dask) as executor:
        do_missing_jobs(console, folder, keys, lambda missing: executor(work, in_parts(missing)))


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
        expected = image_mean(setup, values)
    blocks = [block.name for block in setup.body.blocks()]
    arrays = {name: expected.values[name] for name in (*blocks, *setup.problem.free.names)}
    arrays |= {"landmarks": expected.landmarks, "sd": expected.sd}
    arrays |= {"names": np.array(expected.names), "sd_is": np.array(SPREAD_NOTE)}
    write_arrays(folder / MEAN_FILE, arrays)
    say(
        console,
        f"the mean of the posterior puts the body {1e3 * expected.moved:.0f} mm from its likeliest "
        f"place (a standard error of {1e3 * expected.error:.0f} mm, from {expected.draws} draws); "
        f"landmarks have a standard deviation of {1e3 * np.sqrt(np.mean(expected.sd**2)):.0f} mm, "
        f"which is {SPREAD_NOTE}",
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
    for measure in setup.measures(values):
        line = f"{measure.name}: {measure.value:.4g} {unit_text(measure.unit)}".rstrip()
        console.print(escape(line), highlight=False)
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
    height: float = MARKER_HEIGHT  # of their centres above the skin, in m
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
    markers = recording.markers[:, list(places)]

    def solve(setup: Setup) -> Values:
        question = (
            f"Which shape of the body, and which places of {len(worn.names)} markers on it, "
            f"explain {len(setup.start['observed'])} of the {len(markers)} frames of {file.name}?"
        )
        experiment = experiment_of(file, replace(setup, question=question))
        return carry_out(console, experiment, marker_solver(solver), False, out)

    capture = mosh(
        markers,
        body,
        worn,
        sigma=SIGMA if sigma is None else sigma,
        across=markers_worn.across,
        solve=solve,
        progress=lambda text: console.print(f"[dim]{text}[/]", highlight=False),
    )
    arrays: dict[str, NDArray[Any]] = {
        "poses": capture.pose,
        "trans": capture.trans,
        "errors": capture.errors,
        "frames": capture.frames,
        "betas": capture.betas,
        "offsets": capture.offsets,
        "labels": np.array(worn.names),
        "joint_names": np.array(body.joint_names),
        "up_axis": np.array("y"),
    }
    rate = recording.fps if fps is None else fps
    if rate is not None:
        arrays["fps"] = np.array(rate)
    path = out / file.stem / "motion.npz"
    write_arrays(path, arrays)
    rms = 1e3 * float(np.sqrt(np.nanmean(capture.errors**2)))
    worst = int(np.argmax(rms_of_markers(capture.errors)))
    say(
        console,
        f"markers are {rms:.1f} mm from those of the body (root mean square over {len(markers)} "
        f"frames); the worst is {escape(worn.names[worst])}",
    )
    print_page(console, "motion", path)
