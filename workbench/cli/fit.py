"""`workbench fit`: fits a body to keypoints, a video, markers or a mesh of the user."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_body
from workbench.bodies.triangles import TriangleBody
from workbench.cli.cluster import Dask, Workers
from workbench.cli.fit_options import recipe_of, size_of
from workbench.cli.image_mean import FILE as MEAN
from workbench.cli.image_mean import add_mean
from workbench.cli.images import fit_folder
from workbench.cli.marker_fits import Worn, fit_markers
from workbench.cli.output import warn_without_effect
from workbench.cli.run import Compare, Out, carry_out, solver_named
from workbench.cli.video import fit_video
from workbench.environment import expanded
from workbench.errors import BadArgument, BadFile
from workbench.experiments import Experiment
from workbench.fitting.files.clips import read_clip
from workbench.fitting.images import ByHeight, image_fit
from workbench.fitting.jobs import ImageReading, ImageWork
from workbench.fitting.keypoints import as_marked, keypoint_fit
from workbench.fitting.known_points import own_mesh
from workbench.fitting.marker_files import READERS as MARKERS
from workbench.fitting.marker_sets import OUT
from workbench.fitting.setup import MANY, Setup
from workbench.geometry.meshes import READERS, WITH_VERTEX_ORDER
from workbench.solvers import DEFAULT, SOLVERS, LevenbergMarquardt, Solver

FPS = 30.0  # frames per second of a clip that does not say


@dataclass(frozen=True)
class Given:
    """What was given to `workbench fit`, checked, and where its sentences go.

    Attributes:
        console: where sentences are printed.
        body: the body that is fitted.
        body_name: as it was given.
        reading: how files of keypoints are read.
        recipe: how one image is fitted.
        sigma: the standard deviation of the data, or None for the usual one.
        solver: the solver that was named, or None.
        compare: whether other solvers are run too.
        out: the folder in which results get a folder.
    """

    console: Console
    body: SkinnedBody | TriangleBody
    body_name: str
    reading: ImageReading
    recipe: ByHeight
    sigma: float | None
    solver: str | None
    compare: bool
    out: Path

    @property
    def named(self) -> Solver:
        """The solver that was named, or the default."""
        return solver_named(self.solver or DEFAULT)

    def mind(self, unused: dict[str, bool], because: str) -> None:
        """Name the options that were given and have no effect."""
        for option, has in unused.items():
            if has:
                warn_without_effect(self.console, option, because)


def fit(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Keypoints of one moment (COCO, COCO-WholeBody or OpenPose JSON, one file per "
            "camera); a folder of such files, of one image each; with --video a clip; "
            "markers: .c3d, .trc, or .npz with markers (T, M, 3) and labels (M,); or a mesh "
            f"({', '.join(WITH_VERTEX_ORDER)}) of the body's topology, in metres."
        ),
    ],
    cameras: Annotated[
        Path | None,
        typer.Option(
            help="Calibration with the cameras in the order of the files: Pose2Sim TOML, or JSON "
            r'{"name": {"K": 3x3, "R": 3x3, "t": 3, "distortion": \[...], "size": \[w, h]}}.'
        ),
    ] = None,
    size: Annotated[str | None, typer.Option(help="The image's size, WIDTHxHEIGHT in px.")] = None,
    focal: Annotated[
        float | None,
        typer.Option(help="Focal length in px; without it, the focal length is estimated too."),
    ] = None,
    person: Annotated[
        int | None,
        typer.Option(
            help="Number of the person in the file, from 0; without it, the one seen best."
        ),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            help="Stature of the person in one image in metres, if it is known; it tells how far "
            "away they are."
        ),
    ] = None,
    hypotheses: Annotated[
        int,
        typer.Option(
            help="Number of starts for one image: how many bodies are tried that may look alike, "
            "such as one that faces the other way."
        ),
    ] = 1,
    mean: Annotated[
        bool,
        typer.Option(
            "--mean",
            help="For keypoints of one moment or a video: also write the mean of the posterior, "
            "which on average is nearer to the truth than the likeliest body.",
        ),
    ] = False,
    video: Annotated[
        bool,
        typer.Option(
            help="The argument is a clip: a folder with a keypoint file for each frame, or with "
            "such a folder for each camera."
        ),
    ] = False,
    fps: Annotated[
        float | None,
        typer.Option(
            help=f"Frames per second of a clip, {FPS:g} if not given; or of markers, if their file "
            "does not say."
        ),
    ] = None,
    marker_set: Annotated[
        Path | None,
        typer.Option(help='Markers of an .npz on the body: JSON {"LFHD": number of a vertex}.'),
    ] = None,
    marker_height: Annotated[
        float | None,
        typer.Option(
            help="Height of the centres of markers above the skin in m, such as 0.007; "
            f"{OUT:g} if not given."
        ),
    ] = None,
    across: Annotated[
        float | None,
        typer.Option(
            help="How well this height is known: its standard deviation in m, such as 0.001. "
            "Places of markers are then uncertain along the skin only; without it, in all "
            "directions alike."
        ),
    ] = None,
    body: Annotated[str, typer.Option(help="An embedded body, or a file of your own.")] = "default",
    sigma: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the data; by default 0.4 % of the person's height in "
            "an image or a clip, in px, or 0.002 m in space."
        ),
    ] = None,
    solver: Annotated[
        str | None,
        typer.Option(
            "--solver",
            help=f"One of {', '.join(SOLVERS)}; by default {DEFAULT}, and for one image "
            "levenberg-marquardt.",
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
    for option, what, number in (
        ("--sigma", "a number", sigma),
        ("--focal", "a length in px", focal),
        ("--fps", "a number", fps),
    ):
        if number is not None and not 0 < number < math.inf:
            raise BadArgument(f"{option} takes {what} above 0, not {number:g}")
    if solver is not None:
        solver_named(solver)
    reading = ImageReading(size_of(size), focal, cameras, person)
    recipe = recipe_of(height, sigma)
    worn = Worn(marker_set, OUT if marker_height is None else marker_height, across)
    model, paths = load_body(body), [expanded(path) for path in files]
    given = Given(Console(), model, body, reading, recipe, sigma, solver, compare, out)
    first = paths[0]
    many = {"--workers": workers > 1, "--dask": dask is not None}
    one_image = {"--height": height is not None, "--hypotheses": hypotheses != 1}
    drawn = {"--mean": mean}
    by_keypoints = {
        "--cameras": cameras is not None,
        "--size": size is not None,
        "--focal": focal is not None,
        "--person": person is not None,
    }
    moving = {"--fps": fps is not None}
    of_markers = {
        "--marker-set": marker_set is not None,
        "--marker-height": marker_height is not None,
        "--across": across is not None,
    }
    if len(paths) > 1 and (video or first.is_dir() or first.suffix.lower() in (*READERS, *MARKERS)):
        raise BadFile(
            f"one folder, mesh or file of markers is fitted at a time, not {len(paths)}; give one"
        )
    if not first.is_dir() or video:
        given.mind(many, "it is for a folder of images")
    if video:
        given.mind(one_image | of_markers | {"--compare": compare}, "it is not for a clip")
        clip = read_clip(
            first,
            fps=fps or FPS,
            calibration=cameras,
            size=reading.size,
            focal=focal,
            person=person,
        )
        fit_video(
            given.console,
            first,
            clip,
            model,
            sigma,
            given.named,
            out,
            mean,
        )
    elif first.is_dir():
        single = {"--compare": compare, "--solver": solver is not None}
        given.mind(single | drawn | moving | of_markers, "it is not for a folder of images")
        work = ImageWork(model, recipe, reading, hypotheses)
        fit_folder(given.console, first, work, body=body, out=out, workers=workers, dask=dask)
    elif first.suffix.lower() in MARKERS:
        given.mind(
            by_keypoints | one_image | drawn | {"--compare": compare}, "it is not for markers"
        )
        fit_markers(given.console, first, model, worn, fps, sigma, given.named, out)
    elif first.suffix.lower() in READERS:
        given.mind(by_keypoints, "it is for keypoints, and this is a mesh")
        given.mind(one_image | drawn | moving | of_markers, "it is not for a mesh")
        setup = own_mesh(first, model, 0.002 if sigma is None else sigma)
        _carry_out(given, first, setup)
    else:
        given.mind(moving | of_markers, "it is not for keypoints of one moment")
        if len(paths) > 1:
            why = "it is for one camera; several show where and how tall a person is"
            given.mind(one_image, why)
        setup = of_keypoints(given, paths, hypotheses)
        values, folder = _carry_out(given, first, setup)
        (folder / MEAN).unlink(missing_ok=True)  # of an earlier fit
        if mean:
            add_mean(given.console, setup, values, folder)


def of_keypoints(given: Given, files: list[Path], hypotheses: int) -> Setup:
    """The fit to keypoints of one moment, from one camera or several."""
    reading = given.reading
    observed = reading.observations(files)
    if reading.focal is not None and reading.calibration is not None:
        why = f"{reading.calibration} says the focal length of each camera"
        warn_without_effect(given.console, "--focal", why)
    question = (
        f"Which pose, shape and place of the body explain the keypoints of "
        f"{', '.join(str(f.name) for f in files)}?"
    )
    if len(files) > 1:
        return keypoint_fit(
            observed,
            given.body,
            question,
            sigma=given.sigma,
            kernel=None,
            relative=as_marked,
            compared=MANY,
        )
    return image_fit(
        observed,
        given.body,
        question,
        recipe=replace(given.recipe, solver=LevenbergMarquardt()),
        hypotheses=hypotheses,
        compared=MANY,
    )


def _carry_out(given: Given, file: Path, setup: Setup) -> tuple[Values, Path]:
    """Solve a setup and write its report: the values, and the folder."""
    experiment = Experiment(
        file.stem, lambda: setup, "a user's own file", source=str(file.resolve())
    )
    named = None if given.solver is None and setup.strategy is not None else given.named
    return carry_out(given.console, experiment, named, given.compare, given.out)
