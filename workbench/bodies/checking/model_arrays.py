"""The arrays of a model file as far as they can be used, where `load_body` would stop.

Each array is read by itself. What cannot be read, has another shape than the others ask for or
holds numbers that are not finite becomes a finding, and is None for the checks of others.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index, Mask
from workbench.bodies.files.joint_names import family, joint_names
from workbench.bodies.files.layouts import MOST_JOINTS
from workbench.bodies.files.pickles import Contents, Unread
from workbench.bodies.files.reading import REQUIRED, SPARSE_PARTS, Entries
from workbench.errors import BadFile, cut


@dataclass(frozen=True)
class FileFinding:
    """A sentence about a model file: what is there, what follows from it, and what to do.

    Attributes:
        part: the key of the file, or what the finding is about.
        text: the sentence.
        warning: True if the model would compute something wrong, False if it is only worth knowing.
    """

    part: str
    text: str
    warning: bool = True


def row_name(names: Sequence[str], k: int) -> str:
    """A joint by its number and its name: `joint 4 (left_knee)`."""
    return f"joint {k} ({names[k]})" if k < len(names) else f"joint {k}"


def of_all(wrong: Mask, what: str) -> str:
    """How many there are of all: `3 of 778 vertices`."""
    return f"{np.count_nonzero(wrong):,} of {wrong.size:,} {what}"


TOO_LARGE = 1e100  # numbers of at least this size overflow where three of them are multiplied


@dataclass(frozen=True, eq=False)
class ModelArrays:
    """What the file `where` holds in SMPL's layout; an array that cannot be computed with is None.

    `table` (2, K) are parents and numbers of joints as in the file, and `parents` have -1 at the
    root, if the table is a tree in order. `findings` say what was wrong with reading.
    """

    raw: Contents
    where: str
    template: Array | None
    faces: Index | None
    shapedirs: Array | None
    posedirs: Array | None
    weights: Array | None
    regressor: csr_array | None
    table: Index | None
    parents: tuple[int, ...] | None
    names: tuple[str, ...]
    findings: tuple[FileFinding, ...] = field(repr=False)

    @property
    def n_joints(self) -> int:
        """K, by whatever array says it; 0 if none does."""
        for array, axis in ((self.table, 1), (self.weights, 1), (self.regressor, 0)):
            if array is not None:
                return int(array.shape[axis])
        return 0

    @property
    def family(self) -> str:
        """SMPL, SMPL-H, SMPL-X, MANO, FLAME, or SMPL-like."""
        return family(self.n_joints, self.parents)

    @property
    def joints(self) -> Array | None:
        """The joints at rest (K, 3), if they can be found."""
        if self.regressor is None or self.template is None:
            return None
        return np.asarray(self.regressor @ self.template)

    @property
    def size(self) -> float:
        """The largest extent of the template along an axis."""
        return 0.0 if self.template is None else float(np.ptp(self.template, axis=0).max())

    def extra(self, key: str) -> NDArray[Any] | None:
        """An array of finite numbers that no body computes with, by its key."""
        value = self.raw.get(key)
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu" or not value.size:
            return None
        return value if _usable(value).all() else None


@dataclass
class _Reading:
    """The arrays of a file, one by one; instead of one that cannot be used there is a finding."""

    entries: Entries
    findings: list[FileFinding]

    def array(
        self,
        key: str,
        read: Callable[[str], Any],
        shape: tuple[int | None, ...] | None = None,
        because: str = "",
    ) -> Any:
        """The array, or None; in `shape`, None stands for any size."""
        raw, where = self.entries.raw, self.entries.where
        if key not in raw and f"{key}/data" not in raw:
            return None
        try:
            array = read(key)
        except BadFile as error:
            reason = str(error).removeprefix(where).removeprefix(":").strip()
            self.findings.append(FileFinding(key, f"{reason}. Take it from the original file."))
            return None
        numbers = array.data if isinstance(array, csr_array) else array
        if not (array.ndim and array.shape[0] and _usable(numbers).all()):
            return None
        if shape is None or _fits(array.shape, shape):
            return array
        sizes = ", ".join("." if n is None else str(n) for n in shape)
        self.findings.append(
            FileFinding(
                key,
                f"{key} has shape {array.shape}, but must be ({sizes}) {because}. One of the two "
                "is of another model, or was cut: take both from one file.",
            )
        )
        return None


def model_arrays(raw: Contents, where: str) -> ModelArrays:
    """The arrays of a file of SMPL's layout, and what is wrong with reading them."""
    entries, findings = Entries(raw, where), _not_finite(raw)
    have = {key.partition("/")[0] for key in raw}
    findings += [
        FileFinding(key, f"There is no {key}, without which there is no body.")
        for key in REQUIRED
        if key not in have
    ]
    array = _Reading(entries, findings).array
    template = array("v_template", entries.reals, (None, 3), "for vertices")
    table = array("kintree_table", entries.wholes, (2, None), "for a tree")
    N = None if template is None else len(template)
    K = None if table is None else table.shape[1]
    sizes = {"vertices of v_template": N, "joints of kintree_table": K}
    counts = [f"{n} {what}" for what, n in sizes.items() if n is not None]
    of_both = f"for the {' and '.join(counts) or 'vertices and joints'}"
    faces = array("f", entries.wholes, (None, 3), "for triangles")
    weights = array("weights", entries.reals, (N, K), of_both)
    regressor = array("J_regressor", entries.matrix, (K, N), of_both)
    blends = {
        key: array(key, partial(entries.directions, N=N)) if N else None
        for key in ("shapedirs", "posedirs")
    }
    parents = _parents(table)
    return ModelArrays(
        raw,
        where,
        template,
        faces,
        blends["shapedirs"],
        blends["posedirs"],
        weights,
        regressor,
        table,
        parents,
        _names(entries, K or 0, parents),
        tuple(findings),
    )


def _fits(shape: tuple[int, ...], expected: tuple[int | None, ...]) -> bool:
    return len(shape) == len(expected) and all(
        size is None or size == n for n, size in zip(shape, expected, strict=True)
    )


def _usable(numbers: NDArray[Any]) -> Mask:
    """Which numbers can be computed with."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(np.abs(numbers) < TOO_LARGE)  # which NaN is not


def _not_finite(raw: Contents) -> list[FileFinding]:
    """A finding for each array with entries that are infinite or not numbers."""
    findings = []
    for key, value in raw.items():
        numbers = value.data if isinstance(value, csr_array) else value
        if not isinstance(numbers, np.ndarray) or numbers.dtype.kind != "f":
            continue
        bad: Mask = np.asarray(~_usable(numbers))
        if bad.any():
            first = [int(i) for i in np.unravel_index(int(bad.argmax()), bad.shape)]
            where = "" if isinstance(value, csr_array) else f", the first at {first}"
            text = (
                f"{of_all(bad, 'entries')} of {cut(key, 60)} are not finite, or above {TOO_LARGE:g}"
                f"{where}; they spread to every number that is computed from them. Export the "
                "model again, or find out what these entries should be."
            )
            findings.append(FileFinding(cut(key, 60), text))
    return findings


def _parents(table: Index | None) -> tuple[int, ...] | None:
    """The parents with -1 at the root, if the joints are in order."""
    if table is None or not table.shape[1]:
        return None
    parents, numbers = table[0, 1:], np.arange(table.shape[1])
    in_order = np.array_equal(table[1, 1:], numbers[1:]) and bool((parents >= 0).all())
    if not in_order or (parents >= numbers[1:]).any():
        return None
    return (-1, *parents.tolist())


def _names(entries: Entries, K: int, parents: tuple[int, ...] | None) -> tuple[str, ...]:
    try:
        names = entries.texts("joint_names") if "joint_names" in entries else ()
    except BadFile:
        names = ()
    return names if len(names) == K else joint_names(min(K, MOST_JOINTS), parents)


def used_keys(raw: Contents) -> frozenset[str]:
    """The keys of the arrays that a body computes with, and of their parts."""
    parts = {f"{key}/{part}" for key in ("J_regressor", "weights") for part in SPARSE_PARTS}
    return frozenset(raw.keys() & ({*REQUIRED} | parts))


def kind_of(value: Any) -> str:
    """The shape and type of an entry, for a table: `(778, 3) float64`."""
    if isinstance(value, Unread):
        return "not read"
    if isinstance(value, csr_array):
        return f"{value.shape} sparse {value.dtype}"
    if isinstance(value, np.ndarray):
        return f"{value.shape} {value.dtype}" if value.shape else f"{value.dtype}"
    return type(value).__name__
