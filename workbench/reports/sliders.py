"""The page of sliders, and settings for it from a fit."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadArgument, BadFile
from workbench.fitting.body_priors import stature
from workbench.reading.arrays import opened, read_expected, reals
from workbench.reports.page import page
from workbench.reports.replay.recording import skinned_data
from workbench.writing import write_file

LEAST_STATURE_CHANGE = 0.01  # m, of the stature, by one standard deviation
NOTE = (
    "This page computes what the workbench computes, in double precision; only the pose blend "
    "shapes are stored in single precision. A test compares its vertices in a browser with those "
    "of Python: they differ by less than 0.00001 mm. The page's address keeps the settings, so "
    "that a link to it shows the same body."
)


def write_sliders(
    body: Body, path: str | Path, start: Mapping[str, Any] | None = None, origin: str = ""
) -> Path:
    """Write the page of a body. Raises BadArgument for one that it cannot show, and BadFile.

    See `sliders_page` for `start` and `origin`.
    """
    text, path = sliders_page(body, start, origin), Path(path)
    write_file(path, text)
    return path


def sliders_page(body: Body, start: Mapping[str, Any] | None = None, origin: str = "") -> str:
    """The page of a body as HTML. Raises BadArgument for a body that it cannot show.

    `start` is what the page opens with, as `settings_of` makes it, and `origin` says where it is
    from; without it the elbows are bent.
    """
    data = skinned_data(body)
    return page(
        "sliders.html",
        title=f"Moving theta and beta: {body.name}",
        data=data,
        direction=_first_direction(body),
        start=None if start is None else {**start, "pose_shapes": False},
        origin=origin,
        note=NOTE,
    )


def _first_direction(body: Body) -> str:
    """What more of betas[0] does to a person's stature; nothing below 1 cm or without a head."""
    if not isinstance(body, SkinnedBody) or not body.n_betas or "head" not in body.joint_names:
        return ""
    mean, more = stature(body, np.eye(2, body.n_betas, -1))
    change = float(more - mean)
    return "" if abs(change) < LEAST_STATURE_CHANGE else "taller" if change > 0 else "shorter"


FIT_FILES = ("values.npz", "registration.npz", "motion.npz")  # of a run, a registration, a clip
POSES = "poses"  # what the pose of a motion is called
FIT_KIND = "fit with a pose and betas"
FIT_ADVICE = "give the folder of a run, a registration or a clip, or its .npz"


def pose_and_betas(place: str | Path, body: Body, frame: int = 0) -> tuple[Array, Array]:
    """The pose (K, 3) rad and the betas (B,) of a body in a fit; of several frames, in one of them.

    `place` is the folder of a report, or an .npz with arrays of the names of the body's blocks,
    or with `poses` and `betas`. Raises BadFile for what holds no such arrays, and BadArgument if
    they are of a body of other joints or betas, or there is no such frame.
    """
    path = Path(place)
    if path.is_dir():
        present = [path / name for name in FIT_FILES if (path / name).is_file()]
        if not present:
            raise BadFile(f"{path} holds none of {', '.join(FIT_FILES)}; {FIT_ADVICE}")
        path = present[0]
    pose, betas, _ = (block.name for block in body.blocks())
    with opened(path, FIT_KIND, FIT_ADVICE) as archive:
        shapes = {name: header.shape for name, header in archive.headers.items()}
        named = pose if pose in shapes else POSES
        rows = {named: (body.n_joints, 3), betas: (body.n_betas,)}
        for name, row in rows.items():
            shape = shapes.get(name, row)
            if shape not in (row, (*shape[:1], *row), (*shape[:1], int(np.prod(row)))):
                raise BadArgument(
                    f"{name} of {path} has the shape {shape}, and body {body.name!r} has {row}; "
                    "name the body of the fit: workbench body sliders NAME --from PLACE"
                )
        expected = {name: reals(*shapes.get(name, row)) for name, row in rows.items()}
        arrays = read_expected(archive, expected)
    one, other = (_of_frame(arrays[name], row, frame, path) for name, row in rows.items())
    return one, other


def _of_frame(array: Array, row: tuple[int, ...], frame: int, path: Path) -> Array:
    """One of the rows of an array, whose shape may be flat; the array itself if it is one row."""
    if array.shape == row:
        return array
    if not 0 <= frame < len(array):
        raise BadArgument(f"{path} has the frames 0 to {len(array) - 1}, and not {frame}")
    return np.reshape(array[frame], row)


def settings_of(pose: Array, betas: Array, body: Body) -> dict[str, Any]:
    """Pose and betas as the page of sliders takes them: degrees by joint, standard deviations."""
    degrees = np.round(np.degrees(pose), 4)
    turned = zip(body.joint_names, degrees, strict=True)
    return {
        "pose": {name: angles.tolist() for name, angles in turned if angles.any()},
        "betas": np.round(betas, 5).tolist(),
    }
