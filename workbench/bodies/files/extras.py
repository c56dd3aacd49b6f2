"""What a body's file holds beside the arrays that a body computes with: kept, or named.

The hands' principal components of MANO and SMPL-H, the landmarks of SMPL-X and other arrays of
numbers or texts travel with the body and are saved with it. What cannot travel is named in the
body's card, under `left_out`, with the reason.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies.capsules import KEYS
from workbench.bodies.files.entries import SPARSE_PARTS, Contents, Unread
from workbench.bodies.readonly import locked

REQUIRED = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table", "f")
OURS = (
    "bs_style",
    "name",
    "joint_names",
    "card",
    "bind_pose",
    "rest_joints",
)  # beside landmarks and the mirror
MIRROR = "vert_sym_idxs"
SETS = "landmarks/"  # how the keys of landmarks begin
LANDMARKS = re.compile(f"{SETS}([^/]+)/names")
REGRESSOR_PARTS = tuple(f"J_regressor/{part}" for part in SPARSE_PARTS)
CAPSULES = tuple(f"capsules/{key}" for key in KEYS)
SKINNED = frozenset(
    (*REQUIRED, *OURS, *REGRESSOR_PARTS, *CAPSULES)
)  # keys that a skinned body's file owns
OF_TRIANGLES = (
    "v_template",
    "f",
    "shapedirs",
    "posedirs",
    "near",
    "weights",
    "J_regressor",
    "kintree_table",
    "joint_names",
    "card",
)
TRIANGLES = frozenset(
    (*OF_TRIANGLES, *OURS, *REGRESSOR_PARTS, *(f"weights/{part}" for part in SPARSE_PARTS))
)
COMPUTED = {  # what SMPL's own program stores beside a model, and what it follows from
    "J": "v_template and J_regressor",
    **dict.fromkeys(("v_shaped", "v_posed", "r", "J_transformed"), "the other arrays and a pose"),
    **dict.fromkeys(("pose", "betas", "trans"), "nothing: it is one person's state"),
}
KINDS = "biufUS"  # of arrays that are kept: numbers and texts
MOST_ENTRIES = 2**24  # of all sparse matrices kept as full arrays: 128 MB of float64

Kept = dict[str, NDArray[Any]]


def sorted_out(raw: Contents, own: Iterable[str]) -> tuple[Kept, list[str]]:
    """The entries that no body computes with: those that are kept, and a sentence on each other.

    `own` are the keys that were read; those of sets of landmarks count as well.
    """
    read = set(own)
    for key in raw:
        if found := LANDMARKS.fullmatch(key):
            read |= {key, *(f"{SETS}{found[1]}/{part}" for part in SPARSE_PARTS)}
    kept: Kept = {}
    left_out: list[str] = []
    room = MOST_ENTRIES
    for key in sorted(raw.keys() - read):
        if key in COMPUTED:
            left_out.append(f"{key}, which follows from {COMPUTED[key]}")
        elif key.startswith(SETS):
            left_out.append(f"{key}, which belongs to a set of landmarks without names")
        elif (array := _array(raw[key], room)) is not None:
            room -= array.size if isinstance(raw[key], csr_array) else 0
            kept[key] = locked(array)
        else:
            left_out.append(f"{key}, which is {_kind(raw[key])}")
    return kept, left_out


def clashes(extras: Mapping[str, Any], own: Collection[str]) -> list[str]:
    """Keys that would stand for the body's own entries in a file."""
    return sorted(key for key in extras if key in own or key.startswith(SETS))


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
    if isinstance(value, np.ndarray) and value.dtype.kind in KINDS:
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
