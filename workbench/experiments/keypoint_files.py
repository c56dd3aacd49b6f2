"""Keypoints and cameras from files that detectors and calibration tools write."""

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.errors import BadFile, UnknownName
from workbench.experiments.observations import COCO, FEET, Observations, Photograph
from workbench.geometry.rotation import matrix_from_vector

Array = NDArray[np.float64]
Calibration = dict[str, dict[str, Any]]  # per camera: K, R, t, distortion, size

_LIMBS = ("shoulder", "elbow", "wrist")
_ARMS = tuple(f"{side}_{part}" for side in ("right", "left") for part in _LIMBS)
OPENPOSE_25 = (
    "nose", "neck", *_ARMS, "mid_hip", "right_hip", "right_knee", "right_ankle", "left_hip",
    "left_knee", "left_ankle", "right_eye", "left_eye", "right_ear", "left_ear",
    "left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe",
    "right_heel",
)  # fmt: skip
OPENPOSE_18 = (
    "nose", "neck", *_ARMS, "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee",
    "left_ankle", "right_eye", "left_eye", "right_ear", "left_ear",
)  # fmt: skip
BY_COUNT = {"openpose": {25: OPENPOSE_25, 18: OPENPOSE_18}, "coco": {17: COCO, 23: COCO + FEET}}


def read_keypoints(
    path: str | Path, *, size: tuple[int, int] | None = None, person: int | None = None
) -> tuple[tuple[str, ...], Array, tuple[int, int] | None]:
    """The names, the (M, 3) keypoints u, v, confidence, and the image's size if the file tells it.

    COCO (annotations or results; 17 keypoints, or 23 with feet) or OpenPose (BODY_25 or COCO-18)
    JSON. Of several people the one seen best is taken, or number `person`, counted from 0.
    Raises BadFile or UnknownName.
    """
    data = _json(path)
    if isinstance(data, dict) and "people" in data:
        kind, people = "openpose", [p.get("pose_keypoints_2d", []) for p in data["people"]]
    else:
        kind = "coco"
        annotations = data.get("annotations", [data]) if isinstance(data, dict) else data
        people = [a["keypoints"] for a in annotations if isinstance(a, dict) and "keypoints" in a]
        size = size or _image_size(data, annotations)
    people = [np.asarray(p, dtype=float).reshape(-1, 3) for p in people if p and len(p) % 3 == 0]
    if not people:
        raise BadFile(
            f"{path} holds no person's keypoints; give COCO JSON (annotations with `keypoints`) "
            "or OpenPose JSON (`people` with `pose_keypoints_2d`)"
        )
    if person is not None and not 0 <= person < len(people):
        raise UnknownName("person", str(person), (f"0 to {len(people) - 1} in {path}",))
    chosen = max(people, key=lambda p: p[:, 2].sum()) if person is None else people[person]
    known = BY_COUNT[kind]
    if len(chosen) not in known:
        counts = " or ".join(map(str, known))
        raise BadFile(f"{path} has {len(chosen)} keypoints per person; {kind} JSON has {counts}")
    if kind == "coco" and set(np.unique(chosen[:, 2])) <= {0.0, 1.0, 2.0}:
        chosen = np.column_stack([chosen[:, :2], chosen[:, 2] > 0])  # a visibility flag, 0 1 2
    return known[len(chosen)], chosen, size


def _image_size(data: Any, annotations: list[Any]) -> tuple[int, int] | None:
    images = data.get("images", []) if isinstance(data, dict) else []
    wanted = annotations[0].get("image_id") if annotations else None
    for image in images:
        if image.get("id") == wanted and "width" in image:
            return int(image["width"]), int(image["height"])
    return None


def read_calibration(path: str | Path) -> Calibration:
    """Cameras by name, from Pose2Sim's (and OpenCap's, Anipose's) TOML or a JSON of K, R, t.

    TOML: a table per camera with `matrix`, `rotation` (a rotation vector), `translation`,
    `distortions`, `size`. JSON: an object per camera with `K`, `R` (matrix or vector), `t`, and
    if known `distortion`, `size`. Raises BadFile.
    """
    path = Path(path)
    if path.suffix.lower() == ".toml":
        try:
            tables = tomllib.loads(path.read_text())
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise BadFile(f"{path} cannot be read as TOML: {error}") from error
        other = {"matrix": "K", "rotation": "R", "translation": "t", "distortions": "distortion"}
        cameras = {
            str(table.get("name", key)): {other.get(k, k): v for k, v in table.items()}
            for key, table in tables.items()
            if isinstance(table, dict) and "matrix" in table
        }
    else:
        data = _json(path)
        cameras = dict(data) if isinstance(data, dict) else {}
    if not cameras:
        raise BadFile(f"{path} holds no cameras; see `workbench fit --help` for the formats")
    return {name: _camera(path, name, camera) for name, camera in cameras.items()}


def _camera(path: Path, name: str, given: Any) -> dict[str, Any]:
    missing = [key for key in ("K", "R", "t") if not isinstance(given, dict) or key not in given]
    if missing:
        raise BadFile(f"{path}: camera {name!r} lacks {', '.join(missing)}")
    R = np.asarray(given["R"], dtype=float)
    numbers = {
        "K": np.asarray(given["K"], dtype=float),
        "R": matrix_from_vector(R) if R.shape == (3,) else R,
        "t": np.asarray(given["t"], dtype=float).ravel(),
        "distortion": np.asarray(given.get("distortion", ()), dtype=float).ravel(),
    }
    shapes = {"K": (3, 3), "R": (3, 3), "t": (3,)}
    for key, shape in shapes.items():
        if numbers[key].shape != shape or not np.isfinite(numbers[key]).all():
            raise BadFile(
                f"{path}: camera {name!r} has {key} of shape {numbers[key].shape}; it must be "
                f"{shape} and finite"
            )
    size = given.get("size")
    return numbers | {"size": None if size is None else (int(size[0]), int(size[1]))}


def read_observations(
    paths: Sequence[str | Path],
    *,
    calibration: str | Path | None = None,
    size: tuple[int, int] | None = None,
    focal: float | None = None,
    person: int | None = None,
) -> Observations:
    """One photograph per file; with several, the cameras are the calibration's, in its order."""
    cameras = read_calibration(calibration) if calibration is not None else {}
    if len(paths) > 1 and len(cameras) != len(paths):
        raise BadFile(
            f"{len(paths)} files of keypoints need as many calibrated cameras, but there are "
            f"{len(cameras)}; give --cameras FILE with one camera per file, in the same order"
        )
    photographs, all_names = [], []
    named: list[str | None] = list(cameras) if cameras else [None]
    for path, name in zip(paths, named, strict=False):
        camera = cameras.get(name, {}) if name is not None else {}
        names, points, found = read_keypoints(path, size=size or camera.get("size"), person=person)
        if found is None:
            raise BadFile(f"{path} does not tell the image's size; give --size WIDTHxHEIGHT in px")
        K = camera.get("K")
        if K is None and focal is not None:
            K = np.array([[focal, 0, found[0] / 2], [0, focal, found[1] / 2], [0, 0, 1]])
        photographs.append(
            Photograph(
                name or "camera", found, points[:, :2], points[:, 2],
                K, camera.get("R"), camera.get("t"), camera.get("distortion"),
            )
        )  # fmt: skip
        all_names.append(names)
    if len(set(all_names)) > 1:
        raise BadFile("the files list different keypoints; give files of one detector")
    return Observations(all_names[0], tuple(photographs))


def _json(path: str | Path) -> Any:
    try:
        return json.loads(Path(path).read_text())
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise BadFile(f"{path} cannot be read as JSON: {error}") from error
