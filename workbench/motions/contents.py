"""What a file holds, however it was written: .npz, .npy, .pkl, joblib, PyTorch, JSON, a folder.

Nothing of a file is run: pickles are read as data (`workbench.bodies.files.pickles`).
"""

import io
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.bodies.files.pickles import (
    DAMAGE,
    JOBLIB,
    MORE,
    STORAGE,
    STORAGES,
    Allowance,
    PickledCall,
    PickledName,
    Records,
    Unread,
    run,
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
        if isinstance(node, _Member):
            node = node.value()
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
            if node.name.name in ("dict", "list") and not node.arguments:
                return {} if node.name.name == "dict" else []
            if where == ("torch._utils", "_rebuild_tensor_v2"):
                return self._tensor(*node.arguments[:4])
            return self.records.meaning(node)
        except BadFile:
            raise
        except DAMAGE as error:
            return Unread(f"a {node.name} that cannot be read ({cut(error)})")

    def numbers(self, node: Tree) -> Array | None:
        """A value as an array of real numbers, or None if it is none; lists may be nested."""
        value = self.plain(node)
        if isinstance(value, list):
            if self._leaves(value, {}, 0) > MOST_NODES:
                raise BadFile(f"it has a list of more than {MOST_NODES:,} numbers")
            value = self._stacked(value)
        try:
            array = np.asarray(value)
        except (ValueError, TypeError, OverflowError):
            return None
        if array.dtype.kind not in NUMBERS or isinstance(value, bool):
            return None
        with np.errstate(over="ignore", invalid="ignore"):
            return array.astype(np.float64)

    def text(self, node: Tree) -> str:
        """A value as a text; empty if it is none."""
        value = self.plain(node)
        if isinstance(value, np.ndarray) and value.size == 1 and value.dtype.kind in "US":
            value = value.reshape(-1)[0]
        if isinstance(value, list) and len(value) == 1:
            return self.text(value[0])
        if isinstance(value, bytes):
            return value.decode("ascii", "replace")
        return str(value) if isinstance(value, str) else ""

    def _leaves(self, node: Tree, known: dict[int, int], depth: int) -> int:
        """How many entries a list has with those of its lists, each of which is looked at once."""
        if not isinstance(node, list):
            return 1
        if depth > DEEPEST:
            raise BadFile(f"it has lists nested more than {DEEPEST} deep")
        if id(node) not in known:
            known[id(node)] = 1 + sum(self._leaves(one, known, depth + 1) for one in node)
        return known[id(node)]

    def _stacked(self, value: Tree) -> Tree:
        """Lists with arrays in place of what stands for them."""
        if isinstance(value, list) and not all(type(one) in (int, float) for one in value):
            return [self._stacked(self.plain(one)) for one in value]
        if isinstance(value, np.ndarray):
            self.records.allowance.pay((value.size,))
        return value

    def _tensor(self, storage: Tree, offset: int, size: Tree, stride: Tree) -> NDArray[Any]:
        """A tensor of PyTorch: entry i of its storage at offset + sum_d i_d stride_d."""
        if storage.name == PickledName("torch.storage", "_load_from_bytes"):
            kind, content = _loaded(storage.arguments[0])
        else:
            kind, key = _storage(storage)
            content = self.storages[key]
        sizes, steps = sizes_in(size, "size"), sizes_in(stride, "stride")
        numbers = np.frombuffer(content, kind)
        last = offset + sum((n - 1) * s for n, s in zip(sizes, steps, strict=True))
        if min((*sizes, *steps, offset), default=0) < 0 or (
            0 not in sizes and last >= len(numbers)
        ):
            raise ValueError("its tensor reaches beyond its storage")
        self.records.allowance.pay(sizes)
        each = [np.arange(n) * s for n, s in zip(sizes, steps, strict=True)]
        at = offset + sum(np.ix_(*each), np.zeros(sizes, dtype=np.int64))
        return np.asarray(numbers[at])


def _storage(made: Any) -> tuple[str, str]:
    """The type of the numbers of a storage, and its key."""
    if not isinstance(made, PickledCall) or made.name != STORAGE:
        raise ValueError("its tensor has no storage")
    _, kind, key = made.arguments[:3]
    return "<" + STORAGES[kind.name], str(key)


def _loaded(content: bytes) -> tuple[str, bytes]:
    """A storage in a pickled tensor: a mark, four pickles, how many numbers, and the numbers."""
    stream = io.BytesIO(content.removeprefix(TORCH))
    _, _, made, _ = (run(stream, MORE - {JOBLIB}) for _ in range(4))
    kind, _ = _storage(made)
    stream.read(8)
    return kind, stream.read()


@dataclass(frozen=True)
class _Member:
    """An array of an .npz, which is read when it is asked for."""

    archive: Archive
    name: str

    def value(self) -> Tree:
        """Its numbers; of an array of objects what its pickle says."""
        if not self.archive.headers[self.name].dtype.hasobject:
            return self.archive.array(self.name)
        with damage(self.name):
            return _pickled(self.archive.pickled(self.name))


def _pickled(content: bytes) -> Tree:
    return run(content, MORE, MOST_INSTRUCTIONS)


@contextmanager
def contents_of(path: Path) -> Iterator[Contents]:
    """What a file holds, or a folder: a dictionary of its files. Raises BadFile with a reason."""
    if path.is_dir():
        files = sorted(one for one in path.iterdir() if one.suffix.lower() in FRAME_FILES)
        if not 0 < len(files) <= MOST_FILES:
            raise BadFile(f"it is a folder of {len(files):,} files that could be frames")
        with ExitStack() as opened:
            each = {one.name: opened.enter_context(contents_of(one)).root for one in files}
            yield _contents(each, sum(one.stat().st_size for one in files))
        return
    with damage():
        zipped = path.is_file() and zipfile.is_zipfile(path)
    if not zipped:
        with damage():
            root = _root(path)
        yield _contents(root, path.stat().st_size)
        return
    with open_zip(path) as archive:
        pickle = next((name for name in archive.namelist() if name.endswith("/data.pkl")), "")
        if pickle:  # as torch.save writes it: a folder with a pickle, and a file for each storage
            with damage():
                root, stored = _torch(archive, pickle.removesuffix("data.pkl"))
            yield replace(_contents(root, path.stat().st_size), storages=stored)
            return
    with open_arrays(path) as arrays:
        members = {name: _Member(arrays, name) for name in arrays.headers}
        yield _contents({**members, **dict.fromkeys(arrays.others)}, arrays.size)


def _contents(root: Tree, size: int) -> Contents:
    return Contents(root, Records(Allowance(size, MOST_RECORDS)))


def _torch(archive: zipfile.ZipFile, folder: str) -> tuple[Tree, dict[str, bytes]]:
    """The pickle in a file of PyTorch's, and the numbers of its storages by their keys."""
    members = [m for m in archive.infolist() if m.filename.startswith(folder)]
    if any(m.compress_type != zipfile.ZIP_STORED for m in members):
        raise BadFile("it is packed, as torch.save packs nothing")
    if sum(m.file_size for m in members) > MOST_BYTES:
        raise BadFile("it unpacks to more than 2 GB")
    data = folder + "data/"
    keys = [m.filename for m in members if m.filename.startswith(data)]
    return _pickled(archive.read(folder + "data.pkl")), {
        key.removeprefix(data): archive.read(key) for key in keys
    }


def _root(path: Path) -> Tree:
    """The value at the beginning of a file that is no archive."""
    if path.suffix.lower() == ".json":
        return parsed(bounded(path))
    content = bounded(path, MOST_BYTES)
    if content.startswith(b"\x93NUMPY"):
        header = header_of(content[:LONGEST_HEADER])
        header.check(len(content))
        return _pickled(content[header.start :]) if header.dtype.hasobject else mapped_array(path)
    if packer := next((name for head, name in PACKERS.items() if content.startswith(head)), None):
        raise BadFile(f"it is packed by {packer}; save it again by joblib.dump(..., compress=0)")
    if content[:1] == b"x" or content[:2] == b"\x1f\x8b":  # zlib or gzip, as joblib packs
        most = FREE_BYTES + MOST_PER_BYTE * len(content)
        content = zlib.decompressobj(wbits=47).decompress(content, most)
    return _pickled(content)
