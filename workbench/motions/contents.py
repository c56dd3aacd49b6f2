"""What a file holds, however it was written: .npz, .npy, .pkl, joblib, PyTorch, JSON, a folder.

Nothing of a file is run: pickles are read as data (`workbench.bodies.files.pickles`).
"""

import io
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.bodies.files.pickles import (
    DAMAGE,
    JOBLIB,
    MOTION_NAMES,
    STORAGE,
    STORAGES,
    Allowance,
    PickledCall,
    PickledName,
    Records,
    Unread,
    interpret,
    sizes_in,
)
from workbench.errors import BadFile, cut
from workbench.reading.arrays import (
    FREE_BYTES,
    LONGEST_HEADER,
    MOST_PER_BYTE,
    NUMBERS,
    Archive,
    damage,
    header_of,
    mapped_array,
    open_arrays,
    open_zip,
)
from workbench.reading.facts import bounded, parsed

MOST_BYTES = 2 * 2**30
MOST_INSTRUCTIONS = 5_000_000  # of a pickle: a long video with a dictionary for each frame
MOST_RECORDS = 1_000_000
MOST_NODES = 2_000_000  # that are looked at
MOST_FILES = 100_000  # of a folder
DEEPEST = 12  # lists within lists
PACKERS = {b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"\x04\x22M\x18": "lz4"}  # that are not read
FRAME_FILES = (".npz", ".npy", ".pkl", ".json")
TORCH = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."  # with which its older format begins
Tree = Any  # dict of names, list, array, number, text, None, or Unread


@dataclass
class Contents:
    """One file that is being read.

    Attributes:
        root: what stands at its beginning, which `plain` turns into data.
        records: what its pickles were found to mean so far.
        storages: the numbers of PyTorch's tensors, by their keys.
        nodes: how many values may still be looked at.
    """

    root: Tree
    records: Records
    storages: Mapping[str, bytes] = field(default_factory=dict)
    nodes: int = MOST_NODES

    def plain(self, node: Tree) -> Tree:
        """A value as a dictionary of names, list, array, number, text or None; or as `Unread`.

        What dictionaries and lists hold is not looked at yet. Raises BadFile for what takes too
        much memory.
        """
        self.nodes -= 1
        if self.nodes < 0:
            raise BadFile(f"it holds more than {MOST_NODES:,} values, as no motion does")
        if callable(node):  # an array in an archive
            node = node()
        if not isinstance(node, PickledCall):
            return node
        try:
            where, content = (node.name.module, node.name.name), node.state
            if where == JOBLIB and isinstance(content["content"], PickledCall):
                return self.plain(content["content"])
            if node.name.name == "_reconstruct" and isinstance(content[-1], list):
                # an array of objects: what it holds, one after the other
                items = content[-1]
                return self.plain(items[0]) if content[-4] == () else items
            if where == ("torch._utils", "_rebuild_tensor_v2"):
                return self._tensor(*node.arguments[:4])
            return self.records.meaning(node)
        except BadFile:
            raise
        except DAMAGE as error:
            return Unread(f"a {node.name} that cannot be read ({cut(error)})")

    def numbers(self, node: Tree) -> Array | None:
        """A value as an array of real numbers, or None if it is none; lists may be nested."""
        try:
            array = np.asarray(self._stacked(self.plain(node), 0))
        except (ValueError, TypeError, OverflowError):
            return None
        if array.dtype.kind not in NUMBERS or array.dtype == bool:
            return None
        with np.errstate(over="ignore", invalid="ignore"):
            return array.astype(np.float64, copy=False)

    def texts(self, node: Tree) -> tuple[str, ...]:
        """The texts in a list or an array, or a single one."""
        value = self.plain(node)
        if isinstance(value, np.ndarray):
            value = value.reshape(-1).tolist() if value.dtype.kind in "US" else None
        return tuple(
            text.decode("ascii", "replace") if isinstance(text, bytes) else text
            for text in (value if isinstance(value, list) else [value])
            if isinstance(text, (str, bytes))
        )

    def _stacked(self, value: Tree, depth: int) -> Tree:
        """Lists with arrays in place of what stands for them."""
        if depth > DEEPEST:
            raise BadFile(f"it has lists nested more than {DEEPEST} deep")
        if isinstance(value, (list, np.ndarray)):
            self.records.allowance.pay((len(value) if isinstance(value, list) else value.size,))
        if isinstance(value, list) and not all(type(item) in (int, float) for item in value):
            return [self._stacked(self.plain(item), depth + 1) for item in value]
        return value

    def _tensor(self, storage: Tree, offset: int, size: Tree, stride: Tree) -> NDArray[Any]:
        """A tensor of PyTorch: entry i of its storage at offset + sum_d i_d stride_d."""
        if storage.name == PickledName("torch.storage", "_load_from_bytes"):
            # a mark, the version, facts, the storage, its key, how many numbers, and the numbers
            stream = io.BytesIO(storage.arguments[0].removeprefix(TORCH))
            storage = [interpret(stream, MOTION_NAMES - {JOBLIB}) for _ in range(4)][2]
            content = stream.read()[8:]
        else:
            content = self.storages[str(storage.arguments[2])]
        if storage.name != STORAGE:
            raise ValueError("its tensor has no storage")
        numbers = np.frombuffer(content, "<" + STORAGES[storage.arguments[1].name])
        sizes, steps = sizes_in(size, "size"), sizes_in(stride, "stride")
        last = offset + sum((n - 1) * s for n, s in zip(sizes, steps, strict=True))
        if min(*sizes, *steps, offset, 0) < 0 or (0 not in sizes and last >= len(numbers)):
            raise ValueError("its tensor reaches beyond its storage")
        self.records.allowance.pay(sizes)
        strides = [s * numbers.itemsize for s in steps]
        return np.lib.stride_tricks.as_strided(numbers[offset:], sizes, strides).copy()


def _member(archive: Archive, name: str) -> Tree:
    """An array in an .npz; of one of objects what its pickle says."""
    if not archive.headers[name].dtype.hasobject:
        return archive.array(name)
    with damage(name):
        return _pickled(archive.pickled(name))


def _pickled(content: bytes) -> Tree:
    return interpret(content, MOTION_NAMES, MOST_INSTRUCTIONS)


@contextmanager
def contents_of(path: Path) -> Iterator[Contents]:
    """What a file holds, or a folder: a dictionary of its files. Raises BadFile with a reason."""
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in FRAME_FILES)
        if not 0 < len(files) <= MOST_FILES:
            raise BadFile(f"it is a folder of {len(files):,} files that could be frames")
        frames = {}
        for file in files:
            with contents_of(file) as contents:
                root = contents.plain(contents.root)
                if isinstance(root, dict):
                    root = {key: contents.plain(value) for key, value in root.items()}
                frames[file.name] = root
        yield _contents(frames, sum(file.stat().st_size for file in files))
        return
    with damage():
        zipped = path.is_file() and zipfile.is_zipfile(path)
    if not zipped:
        with damage():
            contents = _contents(*_root(path))
        yield contents
        return
    with open_zip(path) as archive:  # of torch.save: a pickle, and a file for each storage
        sizes = {m.filename: (m.file_size, m.compress_type) for m in archive.infolist()}
        pickle = next((name for name in sizes if name.endswith("/data.pkl")), None)
        if pickle is not None:
            total = sum(size for size, _ in sizes.values())
            if total > path.stat().st_size or any(packed for _, packed in sizes.values()):
                raise BadFile("it is packed, as torch.save packs nothing")
            with damage():
                root = _pickled(archive.read(pickle))
                stored = {name.rpartition("/")[2]: archive.read(name) for name in sizes}
            yield replace(_contents(root, path.stat().st_size), storages=stored)
            return
    with open_arrays(path) as arrays:
        members = {name: partial(_member, arrays, name) for name in arrays.headers}
        size = sum(header.widened for header in arrays.headers.values())
        yield _contents({**members, **dict.fromkeys(arrays.others)}, size)


def _contents(root: Tree, size: int) -> Contents:
    return Contents(root, Records(Allowance(size, MOST_RECORDS)))


def _root(path: Path) -> tuple[Tree, int]:
    """The value at the beginning of a file that is no archive, and the bytes that it is made of."""
    content = bounded(path, MOST_BYTES)
    if path.suffix.lower() == ".json":
        return parsed(content), len(content)
    if content.startswith(b"\x93NUMPY"):
        header = header_of(content[:LONGEST_HEADER])
        header.check(len(content))
        holds_objects = header.dtype.hasobject
        root = _pickled(content[header.start :]) if holds_objects else mapped_array(path)
        return root, max(len(content), header.widened)
    if packer := next((name for head, name in PACKERS.items() if content.startswith(head)), None):
        raise BadFile(f"it is packed by {packer}; save it again by joblib.dump(..., compress=0)")
    if content[:1] == b"x" or content[:2] == b"\x1f\x8b":  # zlib or gzip, as joblib packs
        most = FREE_BYTES + MOST_PER_BYTE * len(content)
        content = zlib.decompressobj(wbits=47).decompress(content, most)
    return _pickled(content), len(content)
