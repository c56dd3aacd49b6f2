"""`workbench fit`: fits a body to keypoints or a mesh of the user."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from workbench.bodies.catalogue import load_body
from workbench.cli.images import fit_folder
from workbench.cli.output import warn_without_effect
from workbench.cli.run import Compare, Out, carry_out, solver_named
from workbench.errors import BadArgument, BadFile
from workbench.experiments import Experiment
from workbench.fitting.compared_solvers import MANY, SECOND_ORDER
from workbench.fitting.image_fit import image_fit
from workbench.fitting.image_jobs import ImageReading, ImageWork
from workbench.fitting.image_recipe import ByHeight, WithStature
from workbench.fitting.keypoint_files import read_observations
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.meshes import own_mesh
from workbench.fitting.stature import checked_height
from workbench.geometry.meshes import READERS, REGISTERED
from workbench.homes import expanded
from workbench.solvers import DEFAULT, SOLVERS, LevenbergMarquardt


def fit(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Keypoints (COCO, COCO-WholeBody or OpenPose JSON, one file per camera), a folder "
            "of such files of one person each, all seen by one camera, or a "
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
    height: Annotated[
        float | None,
        typer.Option(
            help="Stature of the person in metres, if it is known; it tells how far away they are."
        ),
    ] = None,
    hypotheses: Annotated[
        int,
        typer.Option(
            help="Number of starts for keypoints of one camera: how many bodies are tried that may "
            "look alike, such as one that faces the other way."
        ),
    ] = 1,
    sigma: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the data; by default 4 px, or 0.002 m for a mesh."
        ),
    ] = None,
    solver: Annotated[
        str | None,
        typer.Option(
            "--solver",
            help=f"One of {', '.join(SOLVERS)}; by default {DEFAULT}, and for the stages of a fit "
            "to one image levenberg-marquardt.",
        ),
    ] = None,
    compare: Compare = False,
    workers: Annotated[
        int, typer.Option(help="Number of processes that fit the images of a folder.")
    ] = 1,
    dask: Annotated[
        str | None,
        typer.Option(
            help="Address of a Dask scheduler, to fit the images of a folder on its workers, which "
            "read the files at the same paths."
        ),
    ] = None,
    out: Out = Path("runs"),
) -> None:
    """Fit a body to keypoints or to a mesh of its topology; write a report to runs/FILE/.

    The keypoints of one camera are fitted in stages with a robust kernel, as in SMPLify. For a
    folder of them the results are in runs/fit-FOLDER/, and a command that was interrupted continues
    where it stopped.
    """
    if sigma is not None and not 0 < sigma < math.inf:
        raise BadArgument(f"--sigma takes a number above 0, not {sigma:g}")
    if focal is not None and not 0 < focal < math.inf:
        raise BadArgument(f"--focal takes a length in px above 0, not {focal:g}")
    if workers < 1:
        raise BadArgument(f"--workers takes 1 or more, not {workers}")
    image, console = _size(size), Console()
    model, files = load_body(body), [expanded(path) for path in files]
    recipe = _recipe(height, sigma)
    if files[0].is_dir():
        if len(files) > 1:
            raise BadFile(f"one folder is fitted at a time, not {len(files)}; give one")
        for option, unused in (("--compare", compare), ("--solver", solver is not None)):
            if unused:
                warn_without_effect(console, option, "it is for a single fit, not for a folder")
        reading = ImageReading(image, focal, cameras, person)
        work = ImageWork(model, recipe, reading, hypotheses)
        fit_folder(console, files[0], work, body=body, out=out, workers=workers, dask=dask)
        return
    for option, has in (("--workers", workers > 1), ("--dask", dask is not None)):
        if has:
            warn_without_effect(console, option, "it is for a folder of images")
    if files[0].suffix.lower() in READERS:
        if len(files) > 1:
            raise BadFile(f"a body is fitted to one mesh at a time, not to {len(files)}; give one")
        given = {
            "--cameras": cameras,
            "--size": size,
            "--focal": focal,
            "--person": person,
            "--height": height,
            "--hypotheses": None if hypotheses == 1 else hypotheses,
        }
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
        if len(files) == 1:
            whole = replace(recipe, solver=LevenbergMarquardt())
            setup = image_fit(
                observed,
                model,
                question,
                recipe=whole,
                hypotheses=hypotheses,
                compared=SECOND_ORDER,
            )
        else:
            for option, has in (("--height", height is not None), ("--hypotheses", hypotheses > 1)):
                if has:
                    why = "it is for one camera; several show where and how tall a person is"
                    warn_without_effect(console, option, why)
            setup = keypoint_fit(observed, model, question, sigma=recipe.sigma, compared=MANY)
    experiment = Experiment(
        files[0].stem, lambda: setup, "a user's own file", source=str(files[0].resolve())
    )
    named = None if solver is None else solver_named(solver)
    if named is None and setup.strategy is None:
        named = solver_named(DEFAULT)
    carry_out(console, experiment, named, compare, out)


def _recipe(height: float | None, sigma: float | None) -> ByHeight:
    """How one image is fitted, with a known stature, and with another sigma of keypoints."""
    recipe = ByHeight(sigma=4.0 if sigma is None else sigma)
    if height is None:
        return recipe
    checked_height(height)
    return replace(recipe, priors=WithStature(height))


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    found = re.fullmatch("([1-9][0-9]{0,5})x([1-9][0-9]{0,5})", text.strip().lower())
    if not found:
        raise BadArgument(f"--size takes WIDTHxHEIGHT in px, such as 1920x1080; not {text!r}")
    return int(found[1]), int(found[2])
