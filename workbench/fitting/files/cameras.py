"""Calibrated cameras in files, and numbers of a user's file."""

from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadCamera, BadFile, cut, shown
from workbench.geometry.camera import Camera
from workbench.geometry.rotation import matrix_from_vector
from workbench.reading.facts import json_in, toml_in

LARGEST = 1e6  # px: no image is wider or higher
READ = ("K", "R", "t", "distortion", "size", "fisheye", "name")
MOST_CAMERAS = 1000
LONGEST_ROTATION = 2.01 * np.pi  # rad: a rotation vector that is longer is in degrees
LONGEST_NAME = 200  # characters, of a camera's name
TOML = {"matrix": "K", "rotation": "R", "translation": "t", "distortions": "distortion"}


def numbers_in(path: str | Path, what: str, given: Any) -> Array:
    """A list of numbers as an array; `what` names it in the error. Raises BadFile."""
    try:
        numbers = np.asarray(given, dtype=float)
    except (ValueError, TypeError, OverflowError):
        numbers = None
    if numbers is None or not isinstance(given, (list, tuple)):
        raise BadFile(f"{path}: {what} must be numbers, not {shown(given)}")
    return numbers


def size_in(path: str | Path, where: str, given: Any) -> tuple[int, int]:
    """The width and height of an image in px; `where` names it in the error. Raises BadFile."""
    numbers = numbers_in(path, f"{where}: size", given)
    if numbers.shape != (2,) or not ((numbers >= 1) & (numbers <= LARGEST)).all():  # nor NaN
        raise BadFile(
            f"{path}: {where} has the size {shown(given)}; it must be width and height in px"
        )
    return int(numbers[0]), int(numbers[1])


Calibration = dict[str, dict[str, Any]]  # K, R, t, distortion, size, `unread`, `degrees` of each


def read_calibration(path: str | Path) -> Calibration:
    """Cameras by name, from Pose2Sim's (and OpenCap's, Anipose's) TOML or a JSON of K, R, t.

    TOML: a table per camera with `matrix`, `rotation` (a rotation vector), `translation`,
    `distortions`, `size`. JSON: an object per camera with `K`, `R` (matrix or vector), `t`, and
    if known `distortion`, `size`. Keys that are not read are listed under `unread`. Rotation
    vectors are in radians, or in degrees if one of them is longer than a whole turn in radians;
    `degrees` says so. Raises BadFile, for a fisheye camera too.
    """
    path = Path(path)
    toml = path.suffix.lower() == ".toml"
    found = toml_in(path) if toml else json_in(path)
    listed = list(found.items()) if isinstance(found, dict) else []
    if toml:
        for key, table in listed:
            if isinstance(table, dict) and "matrix" not in table and set(TOML) & set(table):
                raise BadFile(
                    f"{path}: camera table [{cut(key, 60)}] has no matrix; add it, or remove the "
                    "table"
                )
        listed = [
            (_name(path, key, table), {TOML.get(k, k): value for k, value in table.items()})
            for key, table in listed
            if isinstance(table, dict) and "matrix" in table
        ]
    if not listed:
        raise BadFile(f"{path} holds no cameras; see `workbench fit --help` for the formats")
    if len(listed) > MOST_CAMERAS:
        raise BadFile(
            f"{path} holds {len(listed):,} cameras, and at most {MOST_CAMERAS:,} are read; leave "
            "out those that saw nothing"
        )
    degrees = any(_length(given) > LONGEST_ROTATION for _, given in listed)
    cameras = {name: _camera(path, name, given, degrees) for name, given in listed}
    if len(cameras) < len(listed):
        raise BadFile(f"{path} holds two cameras of one name; give each its own")
    return cameras


def in_degrees(path: str | Path | None, cameras: Calibration) -> list[str]:
    """A sentence if the rotations of these cameras were taken to be in degrees."""
    if path is None or not any(camera["degrees"] for camera in cameras.values()):
        return []
    return [
        f"{Path(path).name}: rotation vectors are taken to be in degrees, as one of them is longer "
        "than a whole turn in radians"
    ]


def _name(path: Path, key: str, table: dict[str, Any]) -> str:
    name = table.get("name", key)
    if not isinstance(name, str | int):
        raise BadFile(
            f"{path}: the name of camera table [{cut(key, 60)}] must be a text, not {shown(name)}"
        )
    return str(name)


def _length(given: Any) -> float:
    """The length of a camera's rotation vector; 0 for a matrix, or what is none."""
    try:
        R = np.asarray(given["R"], dtype=float).ravel()
    except (TypeError, KeyError, ValueError, OverflowError):
        return 0.0
    return float(np.linalg.norm(R)) if R.size == 3 and np.isfinite(R).all() else 0.0


def _camera(path: Path, name: str, given: Any, degrees: bool) -> dict[str, Any]:
    if len(name) > LONGEST_NAME:
        raise BadFile(
            f"{path}: camera {shown(name)} has a name of {len(name):,} characters; give it one "
            f"of at most {LONGEST_NAME:,}"
        )
    entries = given if isinstance(given, dict) else {}
    missing = [key for key in ("K", "R", "t") if entries.get(key) is None]
    if missing:
        raise BadFile(
            f"{path}: camera {shown(name)} lacks {', '.join(missing)}; a camera needs K, R and t"
        )
    of = f"camera {shown(name)}"
    if entries.get("fisheye"):
        raise BadFile(
            f"{path}: {of} is a fisheye; cameras here are pinholes with up to five coefficients "
            "of distortion: undistort its keypoints, and give the pinhole's matrix"
        )
    camera: dict[str, Any] = {
        key: numbers_in(path, f"{key} of {of}", () if entries.get(key) is None else entries[key])
        for key in ("K", "R", "t", "distortion")
    }
    camera["t"], camera["distortion"] = camera["t"].ravel(), camera["distortion"].ravel()
    R = camera["R"]
    if R.size == 3 and np.isfinite(R).all():
        camera["R"] = matrix_from_vector(np.radians(R.ravel()) if degrees else R.ravel())
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            Camera().values(**camera)
    except BadCamera as error:
        raise BadFile(f"{path}: {of}: {cut(error)}") from error
    size = entries.get("size")
    unread = tuple(sorted(key for key in entries if key not in READ))
    camera["size"] = None if size is None else size_in(path, of, size)
    return camera | {"unread": unread, "degrees": degrees and R.size == 3}
