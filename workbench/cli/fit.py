"""`workbench fit`: fits a body to keypoints or a mesh of the user."""

import math
import re
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from workbench.bodies.catalogue import load_body
from workbench.cli.output import warn_without_effect
from workbench.cli.run import Compare, Out, SolverName, carry_out, solver_named
from workbench.cli.video import fit_video
from workbench.errors import BadArgument, BadFile
from workbench.experiments import Experiment
from workbench.fitting.clip_files import read_clip
from workbench.fitting.compared_solvers import MANY
from workbench.fitting.keypoint_files import read_observations
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.meshes import own_mesh
from workbench.fitting.videos import ENOUGH
from workbench.geometry.meshes import READERS, REGISTERED
from workbench.solvers import DEFAULT


def fit(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Keypoints (COCO, COCO-WholeBody or OpenPose JSON, one file per camera), or a "
            f"mesh ({', '.join(REGISTERED)}) of the body's topology, in metres."
        ),
    ],
    cameras: Annotated[
        Path | None,
        typer.Option(
            help="Calibration with the cameras in the order of the files: Pose2Sim TOML, or JSON "
            '{"name": {"K": 3x3, "R": 3x3, "t": 3, "distortion": [...], "size": [w, h]}}.'
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
    body: Annotated[str, typer.Option(help="An embedded body, or a file of your own.")] = "default",
    sigma: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the data; by default 4 px, or 0.002 m for a mesh."
        ),
    ] = None,
    video: Annotated[
        bool,
        typer.Option(
            help="The argument is a clip: a folder with a keypoint file for each frame, or with "
            "such a folder for each camera."
        ),
    ] = False,
    fps: Annotated[float, typer.Option(help="Frames per second of a clip.")] = 30.0,
    solver: SolverName = DEFAULT,
    compare: Compare = False,
    out: Out = Path("runs"),
) -> None:
    """Fit a body to keypoints or to a mesh of its topology; write a report to runs/FILE/."""
    if sigma is not None and not 0 < sigma < math.inf:
        raise BadArgument(f"--sigma takes a number above 0, not {sigma:g}")
    if focal is not None and not 0 < focal < math.inf:
        raise BadArgument(f"--focal takes a length in px above 0, not {focal:g}")
    image, console = _size(size), Console()
    model = load_body(body)
    if video:
        if len(files) > 1:
            raise BadFile(f"a clip is one folder, not {len(files)}; give one")
        clip = read_clip(
            files[0], fps=fps, calibration=cameras, size=image, focal=focal, person=person
        )
        chosen = ENOUGH if solver == DEFAULT else solver_named(solver)
        fit_video(console, files[0], clip, model, sigma or 4.0, chosen, out)
        return
    if files[0].suffix.lower() in READERS:
        if len(files) > 1:
            raise BadFile(f"a body is fitted to one mesh at a time, not to {len(files)}; give one")
        given = {"--cameras": cameras, "--size": size, "--focal": focal, "--person": person}
        for option in (option for option, value in given.items() if value is not None):
            warn_without_effect(console, option, "it is for keypoints, and this is a mesh")
        setup = own_mesh(files[0], model, 0.002 if sigma is None else sigma)
    else:
        observed = read_observations(
            files, calibration=cameras, size=image, focal=focal, person=person
        )
        if focal is not None and cameras is not None:
            warn_without_effect(
                console, "--focal", f"{cameras} says the focal length of each camera"
            )
        question = (
            f"Which pose, shape and place of the body explain the keypoints of "
            f"{', '.join(str(f.name) for f in files)}?"
        )
        setup = keypoint_fit(
            observed, model, question, sigma=4.0 if sigma is None else sigma, compared=MANY
        )
    experiment = Experiment(
        files[0].stem, lambda: setup, "a user's own file", source=str(files[0].resolve())
    )
    carry_out(console, experiment, solver_named(solver), compare, out)


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    found = re.fullmatch("([1-9][0-9]{0,5})x([1-9][0-9]{0,5})", text.strip().lower())
    if not found:
        raise BadArgument(f"--size takes WIDTHxHEIGHT in px, such as 1920x1080; not {text!r}")
    return int(found[1]), int(found[2])
