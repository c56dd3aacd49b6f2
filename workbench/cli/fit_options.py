"""The options of `workbench fit` by what they are about, and which of them what is fitted needs."""

import re
from pathlib import Path
from typing import Annotated, Literal

import typer

from workbench.cli.console import above_zero
from workbench.errors import BadArgument, BadFile, listed
from workbench.fitting.marker_files import MARKER_READERS
from workbench.fitting.marker_sets import MARKER_HEIGHT
from workbench.geometry.meshes import MESH_READERS, WITH_VERTEX_ORDER
from workbench.solvers import DEFAULT

FPS = 30.0  # frames per second of a clip that does not say
MOST_ABOVE_SKIN = 0.1  # m; a marker's height that is given in mm by mistake is above it


def marker_length(option: typer.CallbackParam, length: float | None) -> float | None:
    """A length of a marker in m. Raises BadArgument for one that must be in mm."""
    if length is not None and not 0 < length < MOST_ABOVE_SKIN:
        raise BadArgument(
            f"{option.opts[0]} takes a length in m, above 0 and below {MOST_ABOVE_SKIN:g}, such as "
            f"0.001 for 1 mm; not {length:g}"
        )
    return length


Files = Annotated[
    list[Path],
    typer.Argument(
        help="Keypoints of one moment, one JSON file per camera (COCO, OpenPose, AlphaPose, "
        "MMPose, Sapiens, ViTPose, Ultralytics, EasyMocap, MediaPipe, lists, or points by "
        "name); a folder of such files, of one image each; with --video a clip; "
        "markers: .c3d, .trc, or .npz with markers (T, M, 3) and labels (M,); or a mesh "
        f"({', '.join(WITH_VERTEX_ORDER)}) of the body's topology, in metres."
    ),
]

# every fit
Sigma = Annotated[
    float | None,
    typer.Option(callback=above_zero, help="Standard deviation of the data, in px or m."),
]
FitSolver = Annotated[
    str | None,
    typer.Option(
        "--solver", help=f"A solver; else {DEFAULT}, or levenberg-marquardt for one image."
    ),
]

# cameras, of images and clips
Cameras = Annotated[
    Path | None,
    typer.Option(
        help="Calibration, its cameras in the order of the files or named as they are: of "
        "Pose2Sim, Anipose, EasyMocap, OpenCV, COLMAP or CMU Panoptic (howto/formats.md), or "
        '{"name": {"K": 3x3, "R": 3x3, "t": 3, "distortion": [...], "size": [w, h]}}.'
    ),
]
CameraToWorld = Annotated[
    bool,
    typer.Option("--camera-to-world", help="--cameras holds the cameras' poses: camera to world."),
]
Size = Annotated[str | None, typer.Option(help="The image's size, WIDTHxHEIGHT in px.")]
Focal = Annotated[
    float | None,
    typer.Option(callback=above_zero, help="Focal length in px; else it is estimated too."),
]
Person = Annotated[
    int | None, typer.Option(help="Which person of a file, from 0; else the largest.")
]
Mean = Annotated[
    bool,
    typer.Option("--mean", help="Also write the posterior's mean, nearer to the truth on average."),
]

# one image, or a folder of images
Height = Annotated[
    float | None, typer.Option(help="Known stature of the person in one image, in m.")
]
Recipe = Annotated[
    Literal["default", "smplify"],
    typer.Option(help="Terms and stages for one image: our own, or SMPLify's."),
]
Prior = Annotated[
    Literal["gaussian", "mixture"] | None,
    typer.Option(help="Prior on the pose for one image; else the recipe's."),
]
Contact = Annotated[
    bool, typer.Option("--contact", help="In one image, keep limbs out of each other.")
]
Hypotheses = Annotated[int, typer.Option(help="Number of starts for one image.")]

# clips, and recordings of markers
Video = Annotated[bool, typer.Option(help="FILES is a clip: a folder with a file for each frame.")]
Fps = Annotated[
    float | None,
    typer.Option(
        callback=above_zero,
        help=f"Frames a second: of a clip, else {FPS:g}; of markers, else their file's.",
    ),
]

# markers
MarkerSetFile = Annotated[
    Path | None, typer.Option(help='Markers on the body: JSON {"LFHD": vertex}.')
]
Labels = Annotated[
    Path | None,
    typer.Option(help="What labels of markers mean: a .csv with lines such as LHeel,LHEE."),
]
MarkerHeight = Annotated[
    float | None,
    typer.Option(
        callback=marker_length,
        help=f"Height of markers above the skin in m, else {MARKER_HEIGHT:g}.",
    ),
]
Across = Annotated[
    float | None,
    typer.Option(
        callback=marker_length, help="Standard deviation of --marker-height in m, such as 0.001."
    ),
]

# a mesh
Tissue = Annotated[bool, typer.Option("--tissue", help="Fit soft tissue to a mesh.")]

OF_FOLDERS, OF_MESHES = ("--workers", "--dask"), ("--tissue",)
OF_ONE_IMAGE = ("--recipe", "--prior", "--contact", "--height", "--hypotheses")
OF_CAMERAS = ("--cameras", "--camera-to-world", "--size", "--focal", "--person")
OF_MARKERS = ("--marker-set", "--labels", "--marker-height", "--across")
WITHOUT_EFFECT = {  # options that change nothing, by what is fitted
    "a clip": (*OF_MESHES, *OF_FOLDERS, *OF_ONE_IMAGE, *OF_MARKERS, "--compare"),
    "a folder of images": (*OF_MESHES, *OF_MARKERS, "--compare", "--solver", "--mean", "--fps"),
    "markers": (*OF_MESHES, *OF_FOLDERS, *OF_CAMERAS, *OF_ONE_IMAGE, "--mean", "--compare"),
    "a mesh": (*OF_FOLDERS, *OF_CAMERAS, *OF_ONE_IMAGE, *OF_MARKERS, "--mean", "--fps"),
    "several cameras": (*OF_MESHES, *OF_FOLDERS, *OF_ONE_IMAGE, *OF_MARKERS, "--fps"),
    "one image": (*OF_MESHES, *OF_FOLDERS, *OF_MARKERS, "--fps"),
}


def kind_of_fit(paths: list[Path], video: bool) -> str:
    """What is fitted, by the files; a key of WITHOUT_EFFECT."""
    first = paths[0]
    suffix = first.suffix.lower()
    kind = "one image" if len(paths) == 1 else "several cameras"
    if video:
        kind = "a clip"
    elif first.is_dir():
        kind = "a folder of images"
    elif suffix in MARKER_READERS or suffix in MESH_READERS:
        kind = "markers" if suffix in MARKER_READERS else "a mesh"
    elif suffix not in (".json", ""):
        raise BadFile(
            f"`fit` does not read {first.name}: it takes keypoints as .json of a detector (which "
            f"has to look at a picture first), markers as {listed(MARKER_READERS)}, and the body's "
            f"own vertices as {listed(WITH_VERTEX_ORDER)}; `workbench register` takes scans, and "
            "`workbench convert` skeletons and motions"
        )
    if len(paths) > 1 and kind != "several cameras":
        raise BadFile(
            f"one folder, mesh or file of markers is fitted at a time, not {len(paths)}; give one"
        )
    return kind


def size_of(text: str | None) -> tuple[int, int] | None:
    """Width and height in px of text such as 1920x1080. Raises BadArgument."""
    if text is None:
        return None
    match = re.fullmatch("([1-9][0-9]{0,5})x([1-9][0-9]{0,5})", text.strip().lower())
    if not match:
        raise BadArgument(f"--size takes WIDTHxHEIGHT in px, such as 1920x1080; not {text!r}")
    return int(match[1]), int(match[2])
