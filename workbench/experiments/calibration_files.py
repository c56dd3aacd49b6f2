"""Cameras from files that calibration tools write."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from workbench.errors import BadCamera, BadFile
from workbench.experiments.reading import json_in, numbers_in, size_in
from workbench.geometry.camera import Camera
from workbench.geometry.rotation import matrix_from_vector

Calibration = dict[str, dict[str, Any]]  # per camera: K, R, t, distortion, size

TOML = {"K": "matrix", "R": "rotation", "t": "translation", "distortion": "distortions"}


def read_calibration(path: str | Path) -> Calibration:
    """Cameras by name, from Pose2Sim's (and OpenCap's, Anipose's) TOML or a JSON of K, R, t.

    TOML: a table per camera with `matrix`, `rotation` (a rotation vector), `translation`,
    `distortions`, `size`. JSON: an object per camera with `K`, `R` (matrix or vector), `t`, and
    if known `distortion`, `size`. Raises BadFile.
    """
    path = Path(path)
    toml = path.suffix.lower() == ".toml"
    found = _tables(path) if toml else json_in(path)
    listed = list(found.items()) if isinstance(found, dict) else []
    if toml:
        listed = [
            (str(table.get("name", key)), {ours: table.get(name) for ours, name in TOML.items()}
             | {"size": table.get("size")})
            for key, table in listed
            if isinstance(table, dict) and "matrix" in table
        ]  # fmt: skip
    if not listed:
        raise BadFile(f"{path} holds no cameras; see `workbench fit --help` for the formats")
    cameras = {name: _camera(path, name, given) for name, given in listed}
    if len(cameras) < len(listed):
        raise BadFile(f"{path} holds two cameras of one name; give each its own")
    return cameras


def _tables(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise BadFile(f"{path} cannot be read as TOML: {error}") from error


def _camera(path: Path, name: str, given: Any) -> dict[str, Any]:
    told = given if isinstance(given, dict) else {}
    missing = [key for key in ("K", "R", "t") if told.get(key) is None]
    if missing:
        raise BadFile(f"{path}: camera {name!r} lacks {', '.join(missing)}")
    of = f"camera {name!r}"
    camera: dict[str, Any] = {
        key: numbers_in(path, f"{key} of {of}", () if told.get(key) is None else told[key])
        for key in ("K", "R", "t", "distortion")
    }
    camera["t"], camera["distortion"] = camera["t"].ravel(), camera["distortion"].ravel()
    R = camera["R"]
    if R.size == 3 and np.isfinite(R).all():
        camera["R"] = matrix_from_vector(R.ravel())
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            Camera().values(**camera)
    except BadCamera as error:
        raise BadFile(f"{path}: {of}: {error}") from error
    size = told.get("size")
    return camera | {"size": None if size is None else size_in(path, of, size)}
