"""Calibrated cameras in the files of the tools that calibrate; howto/formats.md lists them."""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.errors import BadCamera, BadFile, cut, shown, some
from workbench.fitting.files.points import numbers_in
from workbench.geometry.camera import Camera
from workbench.geometry.rotation import matrix_from_vector
from workbench.reading.facts import bounded, json_in, toml_in

LARGEST_IMAGE = 1e6  # px: no image is wider or higher
MOST_CAMERAS = 1000
MOST_BYTES = 2**26  # of a calibration that is text; COLMAP's has the points of its images
LONGEST_ROTATION = 2.01 * np.pi  # rad: a rotation vector that is longer is in degrees
CENTIMETRE_DISTANCES = 20.0, 1000.0  # how far Panoptic's cameras are from the world's origin
LONGEST_NAME = 200  # characters, of a camera's name
IDLE_KEYS = {"calibdatasource", "panel", "node", "type", "typeid"}  # say nothing on pixels
MATRIX_SHAPES = (4, 4), (3, 4)
SHAPES: dict[str, tuple[tuple[int, ...], ...]] = {  # also as one row of numbers
    "K": ((3, 3), (4, 4), (3, 4), (4,)),
    "distortion": (),
    "R": ((3, 3), (3,)),
    "t": ((3,), *MATRIX_SHAPES),
    **dict.fromkeys(("extrinsic", "pose", "opengl"), MATRIX_SHAPES),
}
COLMAP = {  # its models: the numbers of the parameters fx, fy, cx, cy, k1, k2, p1, p2
    "SIMPLE_PINHOLE": (0, 0, 1, 2),
    "PINHOLE": (0, 1, 2, 3),
    "SIMPLE_RADIAL": (0, 0, 1, 2, 3),
    "RADIAL": (0, 0, 1, 2, 3, 4),
    "OPENCV": (0, 1, 2, 3, 4, 5, 6, 7),
}
MATRIX_HEAD = re.compile(r"rows:\s*(\d{1,6})\s+cols:\s*(\d{1,6})\s[^\[]{0,40}?data:")
FILE_PAIRS = {"intri": "extri", "extri": "intri"}  # EasyMocap's and OpenCV's files go together

Calibration = dict[str, dict[str, Any]]  # K, R, t, distortion, size and `notes` of each
Table = Mapping[str, Any]


def size_in(path: str | Path, where: str, entry: Any) -> tuple[int, int]:
    """The width and height of an image in px; `where` names it in the error. Raises BadFile."""
    numbers = numbers_in(path, f"{where}: size", entry)
    if numbers.shape != (2,) or not ((numbers >= 1) & (numbers <= LARGEST_IMAGE)).all():  # nor NaN
        raise BadFile(
            f"{path}: {where} has the size {shown(entry)}; it must be width and height in px"
        )
    return int(numbers[0]), int(numbers[1])


def read_calibration(path: str | Path, *, camera_to_world: bool = False) -> Calibration:
    """Cameras by name, in the order of the file.

    Read are TOML of Pose2Sim, OpenCap and Anipose; JSON of cameras by name or in a list, of CMU
    Panoptic, and of NeRF's transforms; EasyMocap's pair of YAML files, of which one is given;
    OpenCV's FileStorage in YAML, XML or JSON, of one camera or two; and COLMAP's cameras.txt and
    images.txt, by their folder or one of them. Extrinsics are R (matrix or vector) and t in m, or a
    matrix of 3 or 4 rows; they take the world to the camera unless their key says otherwise, or
    `camera_to_world` does. A single camera may have none. Vectors are in radians, or in degrees if
    one is longer than a whole turn in radians. What was guessed, and the keys that are not read,
    are said under `notes`.

    Raises BadFile, for a fisheye camera too.
    """
    path = Path(path)
    tables, panoptic = _camera_tables(path)
    if len(tables) > MOST_CAMERAS:
        raise BadFile(
            f"{path} holds {len(tables):,} cameras, and at most {MOST_CAMERAS:,} are read; leave "
            "out those that saw nothing"
        )
    plain = [(name, _known_entries(path, name, table)) for name, table in tables]
    vectors = [entry for _, entry in plain if "R" in entry and entry["R"].shape == (3,)]
    notes: tuple[str, ...] = ()
    if any(LONGEST_ROTATION < np.linalg.norm(entry["R"]) < np.inf for entry in vectors):
        notes = (
            "rotation vectors are taken to be in degrees, as one of them is longer than a whole "
            "turn in radians",
        )
        for entry in vectors:
            entry["R"] = np.radians(entry["R"])
    cameras: Calibration = {}
    for key, entries in plain:
        name = Path(str(entries.get("name", key))).name or key
        if name in cameras:
            raise BadFile(f"{path} holds two cameras of one name; give each its own")
        if len(name) > LONGEST_NAME:
            raise BadFile(
                f"{path}: camera {shown(name)} has a name of {len(name):,} characters; give it one "
                f"of at most {LONGEST_NAME:,}"
            )
        camera = _camera(path, f"camera {shown(name)}", entries, len(plain) == 1, camera_to_world)
        of_it = f"of camera {shown(name)}, not read are {some(sorted(entries['unread']))}"
        cameras[name] = camera | {"notes": (*notes, of_it) if entries["unread"] else notes}
    far = [np.linalg.norm(entry["t"]) for entry in cameras.values() if entry["t"] is not None]
    if panoptic and far and CENTIMETRE_DISTANCES[0] < np.median(far) < CENTIMETRE_DISTANCES[1]:
        note = "translations are taken to be in cm, as CMU Panoptic has them"
        for camera in cameras.values():
            camera |= {"t": 0.01 * camera["t"], "notes": (note, *camera["notes"])}
    return cameras


def notes_on(path: str | Path | None, cameras: Calibration) -> list[str]:
    """Sentences on what was guessed about these cameras of a file, and what was not read."""
    notes = dict.fromkeys(note for camera in cameras.values() for note in camera["notes"])
    return [f"{Path(path or '').name}: {note}" for note in notes]


def cameras_of(
    paths: Sequence[Path], calibration: str | Path | None, camera_to_world: bool
) -> Calibration:
    """The cameras of files, or folders, in whose names theirs are; else all; none without a file.

    Raises BadFile as `read_calibration` does.
    """
    if calibration is None:
        return {}
    cameras = read_calibration(calibration, camera_to_world=camera_to_world)
    words = {name: rf"(?<![^\W_]){re.escape(name)}(?![^\W_])" for name in cameras}
    own = [
        [name for name in cameras if name == path.parent.name or re.search(words[name], path.name)]
        for path in paths
    ]
    names = [matching[0] for matching in own if len(matching) == 1]
    if names == [*cameras] or not len({*names}) == len(paths) <= len(cameras):
        return cameras
    note = f"cameras are taken by the names of the files: {some(names)}"
    return {n: cameras[n] | {"notes": (*cameras[n]["notes"], note)} for n in names}


@cache
def _keys_by_alias() -> dict[str, str]:
    """The keys of numbers of a camera, by what tools call them, without capitals and separators."""
    text = (files("workbench") / "data" / "cameras" / "keys.csv").read_text(encoding="utf-8")
    rows = [line.split(",") for line in text.splitlines()[1:]]
    return {alias: key for key, aliases in rows for alias in aliases.split()}


def _known_key(key: object) -> str:
    """What is called so in the files of tools; empty if it is not known."""
    return _keys_by_alias().get(re.sub(r"[\W_]", "", str(key)[:60]).lower(), "")


def _camera_tables(path: Path) -> tuple[list[tuple[str, Table]], bool]:
    """The entries of each camera as a file has them, by name, and whether it is Panoptic's."""
    if path.is_dir():
        path /= "cameras.txt" if (path / "cameras.txt").exists() else "intri.yml"
    suffix, panoptic = path.suffix.lower(), False
    if suffix == ".txt":
        return _colmap(path), False
    if suffix in (".yml", ".yaml", ".xml"):
        data: Any = _storage(path)
        for own, other in FILE_PAIRS.items():
            partner = path.with_name(path.name.replace(own, other))
            if own in path.stem and partner.exists():
                data |= _storage(partner)
    else:
        data = toml_in(path) if suffix == ".toml" else json_in(path)
    shared: dict[str, Any] = {}
    if isinstance(data, dict):
        panoptic = "calibDataSource" in data
        for key in ("cameras", "frames"):
            if isinstance(data.get(key), list | dict):
                shared = {
                    k: entry for k, entry in data.items() if _known_key(k) not in ("", "name")
                }
                data = data[key]
                break
        else:
            data = _of_storage(data)
    listed = [*data.items()] if isinstance(data, dict) else []
    if isinstance(data, list):
        listed = [(str(i), entry) for i, entry in enumerate(data)]
    numbers = {*SHAPES, "fx"}
    cameras: list[tuple[str, Table]] = [
        (str(name), {**shared, **entry})
        for name, entry in listed
        if isinstance(entry, dict) and numbers & {*map(_known_key, entry)}
    ]
    if not cameras:
        keys = f"it has the keys {some(map(str, data))}" if isinstance(data, dict) else shown(data)
        raise BadFile(
            f"{path} holds no cameras ({keys}); cameras are objects with K, R and t, by name or in "
            "a list, and howto/formats.md says what else is read"
        )
    return cameras, panoptic


def _known_entries(path: Path, name: str, table: Table) -> dict[str, Any]:
    """A camera's numbers under the keys of `_keys_by_alias`, and others under `unread`."""
    entries: dict[str, Any] = {"unread": []}
    for key, value in table.items():
        known = _known_key(key)
        if isinstance(value, dict) and {"rows", "cols", "data"} <= value.keys():
            value = value["data"]  # a matrix of FileStorage
        if isinstance(value, dict) and known in ("K", "extrinsic", "pose"):
            inner = _known_entries(path, name, value)  # an object of intrinsics, or of extrinsics
            entries["unread"] += inner.pop("unread")
            entries |= inner
        elif known in SHAPES and value is not None:
            what = f"{known} of camera {shown(name)}"
            numbers = numbers_in(path, what, value)
            fitting = [shape for shape in SHAPES[known] if np.prod(shape) == numbers.size]
            entries[known] = numbers.reshape(fitting[0]) if fitting else numbers
        elif known and value is not None:
            entries[known] = value
        elif value is not None and re.sub(r"[\W_]", "", str(key)[:60]).lower() not in IDLE_KEYS:
            entries["unread"].append(str(key))
    if not isinstance(entries.get("name", ""), str | int):
        raise BadFile(
            f"{path}: the name of camera {shown(name)} must be a text, not {shown(entries['name'])}"
        )
    return entries


def _camera(
    path: Path, of: str, entries: dict[str, Any], alone: bool, camera_to_world: bool
) -> dict[str, Any]:
    """K, R, t, distortion and size of a camera from its entries. Raises BadFile."""
    if entries.get("fisheye"):
        raise BadFile(
            f"{path}: {of} is a fisheye; cameras here are pinholes with up to five coefficients "
            "of distortion: undistort its keypoints, and give the pinhole's matrix"
        )
    K, k = _lens(path, of, entries)
    E, inverse = _extrinsic(path, of, entries)
    missing = [] if K is not None else ["K"]
    if E is None and not (alone and not {"R", "t"} & entries.keys()):
        missing += [key for key in ("R", "t") if key not in entries]
    if missing:
        has = some([*(key for key in entries if key != "unread"), *entries["unread"]])
        raise BadFile(
            f"{path}: {of} lacks {', '.join(missing)}; a camera needs K, R and t, and has {has}"
        )
    assert K is not None
    size = entries.get("size")
    if size is None and "width" in entries:
        size = [entries["width"], entries.get("height")]
    camera: dict[str, Any] = {"K": K, "distortion": k}
    if E is not None:
        camera |= {"R": E[:3, :3], "t": E[:3, 3]}
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            Camera().values(**camera)
    except BadCamera as error:
        raise BadFile(f"{path}: {of}: {cut(error)}") from error
    if E is not None and (inverse or camera_to_world):
        camera |= {"R": E[:3, :3].T, "t": -E[:3, :3].T @ E[:3, 3]}
    camera["size"] = None if size is None else size_in(path, of, size)
    return {"R": None, "t": None} | camera


def _lens(path: Path, of: str, entries: Table) -> tuple[Array | None, Array]:
    """K (3, 3), or None, and the coefficients of distortion without those after k3 that are 0."""
    K = entries.get("K")
    if K is None and "fx" in entries:
        keys = ("fx", "fy", "cx", "cy")
        K = numbers_in(path, f"fx, fy, cx, cy of {of}", [entries.get(key) for key in keys])
        K[1] = K[0] if "fy" not in entries else K[1]
    if K is not None and K.shape == (4,):
        K = np.array([[K[0], 0, K[2]], [0, K[1], K[3]], [0, 0, 1]])
    elif K is not None and K.shape in MATRIX_SHAPES:
        K = K[:3, :3]
    named = [entries.get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3")]
    k = entries.get("distortion", numbers_in(path, f"distortion of {of}", named)).ravel()
    return K, k if k[5:].any() else k[:5]


def _extrinsic(path: Path, of: str, entries: Table) -> tuple[Array | None, bool]:
    """A camera's extrinsics (3, 4), or None, and whether they are camera to world."""
    key = next((key for key in ("pose", "opengl", "extrinsic") if key in entries), "t")
    E = entries.get(key)
    if E is not None and key == "t" and E.shape not in MATRIX_SHAPES:  # or T is the whole matrix
        R = entries.get("R")
        if R is None:
            return None, False
        if R.shape == (3,) and np.isfinite(R).all():
            R = matrix_from_vector(R)
        if R.shape != (3, 3) or E.shape != (3,):
            raise BadFile(
                f"{path}: {of}: a camera takes R (3, 3) and t (3,), not {R.shape} and {E.shape}"
            )
        E = np.column_stack([R, E])
    if E is None:
        return None, False
    if E.shape not in MATRIX_SHAPES:
        raise BadFile(f"{path}: {of} has extrinsics of shape {E.shape}, not (3, 4) or (4, 4)")
    if E.shape == (4, 4) and not E[:3, 3].any() and E[3, :3].any():
        E = E.T  # of row vectors, as graphics has them: the translation is in the last row
    E = E[:3] * [1, -1, -1, 1] if key == "opengl" else E[:3]  # x right, y up, z backwards
    return E, key in ("pose", "opengl")


def _text(path: Path) -> str:
    try:
        return bounded(path, MOST_BYTES).decode("utf-8-sig")
    except (OSError, ValueError, BadFile) as error:
        raise BadFile(f"{path} cannot be read as a calibration: {cut(error)}") from error


def _storage(path: Path) -> dict[str, Any]:
    """The entries of OpenCV's FileStorage in YAML or XML: matrices, lists of names, numbers."""
    text, blocks, key = _text(path), {}, ""
    if path.suffix.lower() == ".xml":
        try:
            if "<!" in text:
                raise BadFile("it declares entities or a type, which FileStorage does not")
            for element in ElementTree.fromstring(text):
                lines = [f"{child.tag}: {child.text}" for child in element]
                blocks[str(element.tag)] = "\n".join(lines) or str(element.text)
        except (ElementTree.ParseError, ValueError, BadFile) as error:
            raise BadFile(f"{path} cannot be read as XML: {cut(error)}") from error
    for line in text.splitlines() if not blocks else ():
        if entry := re.match(r"([\w.\-]+)[ \t]*:(.*)", line):
            key = entry[1]
            blocks[key] = entry[2]
        elif key and not line.startswith(("%", "#", "---")):
            blocks[key] += "\n" + line
    return {key: _storage_value(path, key, block.strip()) for key, block in blocks.items()}


def _storage_value(path: Path, key: str, block: str) -> Any:
    """A matrix, a list, a number or a text of FileStorage."""
    try:
        if head := MATRIX_HEAD.search(block):
            rows, cols = int(head[1]), int(head[2])
            numbers = [float(word) for word in re.findall(r"[^\s,\[\]]+", block[head.end() :])]
            if len(numbers) != rows * cols:
                raise BadFile(f"{path}: {key} holds {len(numbers)} numbers, not {rows} x {cols}")
            return {"rows": rows, "cols": cols, "data": numbers}
        if re.match(r"\[|-\s", block):
            return re.findall(r"[^\s\[\],\"'-][^\s\[\],\"']*", block)
        return float(block)
    except ValueError as error:
        if MATRIX_HEAD.search(block):
            raise BadFile(f"{path}: {key} must be numbers, not {shown(block)}") from error
        return block.strip("\"'")


def _of_storage(data: dict[str, Any]) -> Any:
    """Cameras by name: by suffixes as EasyMocap has them, two of a stereo pair, or a single one."""
    names = data.get("names")
    if isinstance(names, list):
        return {
            str(n): {
                k.removesuffix(f"_{n}"): value for k, value in data.items() if k.endswith(f"_{n}")
            }
            for n in names
        }
    ends = {
        end: {
            k[:-1]: value
            for k, value in data.items()
            if k.endswith(end) and _known_key(k[:-1]) in ("K", "distortion")
        }
        for end in ("1", "2")
    }
    if all("K" in map(_known_key, value) for value in ends.values()):
        ends["1"] |= {"R": np.eye(3).tolist(), "T": [0.0] * 3}
        ends["2"] |= {key: data[key] for key in ("R", "T") if key in data}
        return ends
    if {"K", "fx"} & {*map(_known_key, data)}:
        return {"camera": {key: value for key, value in data.items() if _known_key(key)}}
    return data


def _colmap(path: Path) -> list[tuple[str, Table]]:
    """The images of COLMAP's text, each a camera by its name: cameras.txt and images.txt."""
    lenses: dict[str, dict[str, Any]] = {}
    cameras: list[tuple[str, Table]] = []
    lines = [
        [line for line in _text(path.with_name(name)).splitlines() if not line.startswith("#")]
        for name in ("cameras.txt", "images.txt")
    ]
    try:
        for number, model, width, height, *parameters in map(str.split, filter(None, lines[0])):
            if model not in COLMAP:
                raise BadFile(
                    f"{path}: camera {number} has the model {shown(model)}, which is not read; "
                    f"there are {', '.join(COLMAP)}: undistort its images"
                )
            fx, fy, cx, cy, *k = (float(parameters[i]) for i in COLMAP[model])
            K, size = [fx, 0, cx, 0, fy, cy, 0, 0, 1], [float(width), float(height)]
            lenses[number] = {"K": K, "distortion": k, "size": size}
        for line in filter(None, lines[1][::2]):  # every other one is of points
            _, *numbers, camera, name = line.split(maxsplit=9)
            w, x, y, z, *t = map(float, numbers)
            R = Rotation.from_quat([x, y, z, w]).as_matrix().tolist()
            cameras.append((Path(name).stem, {**lenses[camera], "R": R, "t": t}))
    except (ValueError, IndexError, KeyError) as error:
        raise BadFile(f"{path} cannot be read as COLMAP's text: {cut(error)}") from error
    if not cameras:
        raise BadFile(f"{path} holds no cameras: images.txt names no image")
    return cameras
