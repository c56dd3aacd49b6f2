"""What the file of a body holds by key, each entry asked for as what it must be.

A file is an .npz or a pickle, whatever its name: what it is, its first bytes tell. Its arrays are
read, never the Python objects that one can hide.

The hands' principal components of MANO and SMPL-H, the landmarks of SMPL-X and other arrays of
numbers or texts travel with the body and are saved with it. What cannot travel is named in the
body's card, under `left_out`, with the reason.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.capsules import KEYS
from workbench.bodies.files.pickles import Contents, Unread, from_pointers, read_pickled_arrays
from workbench.bodies.readonly import locked
from workbench.errors import BadFile, cut, shown
from workbench.reading.arrays import LONGEST_REASON, MOST_EXACT, check_letters, open_arrays, widened

OBJECTS = (
    "an array of Python objects, which are not read: unpacking them runs code of the file's "
    "choosing. Where you trust the file, load it there with allow_pickle=True and save "
    "this entry again as an array of numbers"
)
NO_ARRAY = "a file of another kind than .npy, which is not read"


def read_npz(path: Path) -> Contents:
    """The arrays of an .npz file by key; arrays of objects and other files in it are `Unread`.

    Raises BadFile if it is cut off or damaged, holds no arrays or two of one name, or if they
    take more memory than those of a file of its size should (`workbench.reading.arrays`).
    """
    try:
        with open_arrays(path) as archive:
            raw: Contents = {name: Unread(NO_ARRAY) for name in archive.others}
            for name, header in archive.headers.items():
                raw[name] = Unread(OBJECTS) if header.dtype.hasobject else archive.array(name)
            return raw
    except BadFile as error:
        raise BadFile(
            f"{path} cannot be read: {cut(error, LONGEST_REASON)}. If it is cut off or damaged, "
            "fetch or export it again"
        ) from error


NPZ = b"PK\x03\x04"
PICKLES = (b"\x80", b"(", b"}", b"]", b"c")  # protocol 2 and later; Python 2's own
OTHER_FILES = (  # how other files begin that people try
    (b"\x93NUMPY", "a single array (.npy)"),
    (b"\x1f\x8b", "compressed with gzip; decompress it first"),
    *((magic, "an archive; unpack it first") for magic in (b"Rar!", b"7z\xbc\xaf")),
    (b"\x89HDF", "an HDF5 file"),
    *((magic, "a mesh, which read_mesh reads") for magic in (b"glTF", b"ply", b"OFF", b"solid")),
    (b"version https://git-lfs", "a pointer of git-lfs, not the file itself; run `git lfs pull`"),
    (b"<", "a web page, perhaps the one that asked you to log in"),
)


def contents_of(path: Path) -> Contents:
    """The entries of the file of a body: arrays, csr_arrays, plain values, and what stayed unread.

    Nothing in a file is ever run, changed or copied. Raises BadFile (UnsafePickle) for a file of
    another kind, and for what cannot be read.
    """
    if not path.exists():
        raise BadFile(f"there is no file {path}")
    if not path.is_file():  # opening a pipe waits until another process writes to it
        raise BadFile(f"{path} is a folder, a pipe or a device; give a file")
    try:
        return _entries(path)
    except OSError as error:
        raise BadFile(f"cannot read {path}: {error.strerror}") from error


def is_npz(path: Path) -> bool:
    """Whether a file begins as an .npz does; the others that are read are pickles."""
    with path.open("rb") as file:
        return file.read(len(NPZ)) == NPZ


def _entries(path: Path) -> Contents:
    with path.open("rb") as file:
        start = file.read(32)
    if start.startswith(NPZ):
        return read_npz(path)
    for magic, what in OTHER_FILES:
        if start.lstrip().startswith(magic):
            raise BadFile(f"{path} is {what}; a body is an .npz or .pkl file in SMPL's layout")
    if not start.startswith(PICKLES):
        what = "is empty" if not start else "is neither an .npz nor a .pkl file"
        raise BadFile(f"{path} {what}; a body is one of these, in SMPL's layout")
    return read_pickled_arrays(path)


SPARSE_PARTS = ("data", "indices", "indptr", "shape")
LONGEST_NAME = 200  # characters of a joint's, a landmark's or a body's name, which messages show


@dataclass(frozen=True)
class Entries:
    """What the file `where` holds by key; every question raises BadFile if the answer is no."""

    raw: Contents
    where: str

    def __contains__(self, key: str) -> bool:
        return key in self.raw

    def array(self, key: str) -> NDArray[Any]:
        """The entry, if it is an array of numbers."""
        if key not in self:
            raise BadFile(f"{self.where} has no {key}")
        value = self.raw[key]
        if isinstance(value, Unread):
            raise BadFile(f"{self.where}: {key} is {value.reason}")
        if not isinstance(value, np.ndarray):
            raise BadFile(
                f"{self.where}: {key} is a {type(value).__name__}, but must be an array of numbers"
            )
        if value.dtype.kind not in "fiu":
            raise BadFile(f"{self.where}: {key} holds {value.dtype}, but must hold numbers")
        return value

    def reals(self, key: str) -> Array:
        """An array of any numbers as float64."""
        return np.ascontiguousarray(widened(self.array(key)))

    def wholes(self, key: str) -> Index:
        """Whole numbers, however they are stored."""
        array = self.array(key)
        if array.dtype.kind == "f":
            array = widened(array)
            if not ((abs(array) <= MOST_EXACT) & (array == np.trunc(array))).all():
                raise BadFile(f"{self.where}: {key} must hold whole numbers, but holds others")
        return array.astype(np.int64)

    def directions(self, key: str, N: int) -> Array:
        """Blend shapes (N, 3, .), also from the flat (3 N, .), (., 3 N) and (N, 3 .)."""
        array = self.array(key)
        if array.ndim == 3 and array.shape[:2] == (N, 3):
            return np.ascontiguousarray(widened(array))
        if array.ndim == 2 and array.shape[0] != 3 * N and array.shape[1] == 3 * N:
            return np.ascontiguousarray(widened(array.T)).reshape(N, 3, -1)
        if array.ndim == 2 and array.shape[0] in (N, 3 * N) and array.size % (3 * N) == 0:
            return widened(array).reshape(N, 3, -1)
        raise BadFile(
            f"{self.where}: {key} has shape {array.shape}; with {N} vertices it must be "
            f"({N}, 3, .), ({3 * N}, .) or (., {3 * N})"
        )

    def matrix(self, key: str) -> csr_array:
        """A matrix, dense or sparse, or its parts under `key/data`, `key/indices`, ..."""
        if f"{key}/data" not in self:
            value = self.raw.get(key)
            if isinstance(value, csr_array):
                with np.errstate(over="ignore"):  # what is infinite then is refused
                    return value.astype(np.float64)
            array = self.array(key)
            if array.ndim != 2:
                raise BadFile(f"{self.where}: {key} has shape {array.shape}, but must be (K, N)")
            return csr_array(widened(array))
        data, indices, indptr, shape = (
            self.reals(f"{key}/{part}") if part == "data" else self.wholes(f"{key}/{part}")
            for part in SPARSE_PARTS
        )
        try:
            rows, columns = shape.tolist()  # of more axes: lists, which int refuses
            matrix = from_pointers("csr", data, indices, indptr, (int(rows), int(columns)))
        except (ValueError, IndexError, TypeError, OverflowError) as error:
            raise BadFile(f"{self.where}: {key} is no sparse matrix ({error})") from error
        return matrix

    def texts(self, key: str) -> tuple[str, ...]:
        """The entry, if it is a list of names."""
        array = self.raw.get(key)
        if not (isinstance(array, np.ndarray) and array.ndim == 1 and array.dtype.kind == "U"):
            raise BadFile(f"{self.where}: {key} must be a list of names")
        names = tuple(str(text) for text in self._written(key, array))
        for name in names:
            self._check_length(key, name)
        return names

    def name(self, key: str, otherwise: str) -> str:
        """A single text that is short enough to be shown in messages."""
        name = self.text(key, otherwise)
        self._check_length(key, name)
        return name

    def text(self, key: str, otherwise: str) -> str:
        """A single text, stored as text, as bytes or as an array of either."""
        value = self.raw.get(key)
        if isinstance(value, np.ndarray) and value.size == 1:
            value = self._written(key, value).item()
        if isinstance(value, bytes):
            value = value.decode("latin1")
        return value if isinstance(value, str) else otherwise

    def _check_length(self, key: str, name: str) -> None:
        if len(name) > LONGEST_NAME:
            raise BadFile(
                f"{self.where}: {key} holds a name of {len(name):,} characters, {shown(name)}; "
                f"names have at most {LONGEST_NAME}"
            )

    def _written(self, key: str, array: NDArray[Any]) -> NDArray[Any]:
        """The array; raises BadFile if its letters are not text that can be written."""
        try:
            if array.dtype.kind == "U":
                check_letters(array)
        except BadFile as error:
            raise BadFile(f"{self.where}: {key} {error}") from error
        return array


REQUIRED = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table", "f")
# beside landmarks and the mirror
OURS = ("bs_style", "name", "joint_names", "card", "bind_pose", "rest_joints")
MIRROR = "vert_sym_idxs"
LANDMARKS_PREFIX = "landmarks/"  # how the keys of landmarks begin
LANDMARKS = re.compile(f"{LANDMARKS_PREFIX}(.+)/names")
REGRESSOR_PARTS = tuple(f"J_regressor/{part}" for part in SPARSE_PARTS)
CAPSULES = tuple(f"capsules/{key}" for key in KEYS)
# keys that a skinned body's file owns, and those that one of triangles must have
SKINNED = frozenset((*REQUIRED, *OURS, *REGRESSOR_PARTS, *CAPSULES))
OF_TRIANGLES = (*REQUIRED, "near", "joint_names", "card")
TRIANGLES = frozenset(
    (*OF_TRIANGLES, *OURS, *REGRESSOR_PARTS, *(f"weights/{part}" for part in SPARSE_PARTS))
)
COMPUTED = {  # what SMPL's own program stores beside a model, and what it follows from
    "J": "v_template and J_regressor",
    **dict.fromkeys(("v_shaped", "v_posed", "r", "J_transformed"), "the other arrays and a pose"),
    **dict.fromkeys(("pose", "betas", "trans"), "nothing: it is one person's state"),
}
KEPT_KINDS = "biufUS"  # of arrays that are kept: numbers and texts
MOST_ENTRIES = 2**24  # of all sparse matrices kept as full arrays: 128 MB of float64

Kept = dict[str, NDArray[Any]]


def kept_and_left_out(raw: Contents, own: Iterable[str]) -> tuple[Kept, list[str]]:
    """The entries that no body computes with: those that are kept, and a sentence on each other.

    `own` are the keys that were read; those of sets of landmarks count as well.
    """
    read = set(own)
    for key in raw:
        if match := LANDMARKS.fullmatch(key):
            read |= {key, *(f"{LANDMARKS_PREFIX}{match[1]}/{part}" for part in SPARSE_PARTS)}
    kept: Kept = {}
    left_out: list[str] = []
    room = MOST_ENTRIES
    for key in sorted(raw.keys() - read):
        if key in COMPUTED:
            left_out.append(f"{key}, which follows from {COMPUTED[key]}")
        elif key.startswith(LANDMARKS_PREFIX):
            left_out.append(f"{key}, which belongs to a set of landmarks without names")
        elif (array := _array(raw[key], room)) is not None:
            room -= array.size if isinstance(raw[key], csr_array) else 0
            kept[key] = locked(array)
        else:
            left_out.append(f"{key}, which is {_kind(raw[key])}")
    return kept, left_out


def clashes(extras: Mapping[str, Any], own: Collection[str]) -> list[str]:
    """Keys that would stand for the body's own entries in a file."""
    return sorted(key for key in extras if key in own or key.startswith(LANDMARKS_PREFIX))


def shapes_in_words(extras: Mapping[str, NDArray[Any]]) -> str:
    """The arrays with their shapes, for a card: `hands_mean (45), gender`."""
    return ", ".join(
        f"{key} ({' × '.join(map(str, array.shape))})" if array.shape else key
        for key, array in extras.items()
    )


def _array(value: Any, room: int) -> NDArray[Any] | None:
    """The entry as an array of numbers or texts, if it is one; of `room` entries if sparse."""
    if isinstance(value, csr_array):
        small = value.shape[0] * value.shape[1] <= room
        return np.asarray(value.toarray()) if small else None
    if isinstance(value, (bool, int, float, str, bytes, np.generic)):
        value = np.array(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in KEPT_KINDS:
        return value
    return None


def _kind(value: Any) -> str:
    """What an entry is that is not kept."""
    if isinstance(value, Unread):
        return value.reason
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype}, not of numbers or texts"
    if isinstance(value, csr_array):
        return f"a sparse matrix {value.shape}, too large to be kept in full"
    return "empty (None)" if value is None else f"a {type(value).__name__}, not an array"
