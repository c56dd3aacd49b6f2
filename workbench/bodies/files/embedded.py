"""Reading the bodies that come with the workbench, as the builder packed them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.errors import BadFile
from workbench.reading.archive import open_arrays
from workbench.reading.damage import taken_for
from workbench.reading.expected import (
    Expected,
    Kind,
    check_numbers,
    read_expected,
    reals,
    texts,
    wholes,
)
from workbench.reading.facts import facts_in

PARTS = ("rows", "columns", "shares")  # of a sparse matrix of whole numbers
SYNTHETIC = (
    "the people behind this body were made by a program from shapes that artists modelled, and a "
    "synthetic teacher says what pose does to their skin; no body was measured or scanned, only "
    "poses were recorded from people"
)


class EmbeddedBody(TypedDict):
    """The arrays of one body, in the layout of SMPL's files; metres, y up, facing +z."""

    template: Array  # (N, 3) m
    shapedirs: Array  # (N, 3, 10) m per standard deviation of the population
    posedirs: Array  # (N, 3, 207) m per unit of pose feature
    J_regressor: csr_array  # (24, N), rows sum to one
    weights: Array  # (N, 24), at most four per row, summing to one
    parents: tuple[int, ...]
    faces: Index  # (F, 3)
    joint_names: tuple[str, ...]
    mirror: Index  # (N,): the vertex on the other side of each
    landmarks: dict[str, tuple[tuple[str, ...], csr_array]]  # names (M,), regressor (M, N)
    card: dict[str, Any]  # where the numbers come from, and how good they are


STEPS = Kind("whole numbers of 16 bits", frozenset({"i2"}), lambda array: array)
EXPECTED = {
    "template": reals("N", 3),
    "shapedirs": Expected(STEPS, ("N", 3, "B")),
    "shapedirs_step": reals(),
    "posedirs": Expected(STEPS, ("P", 3, "N")),  # the axes are reversed, which compresses better
    "posedirs_step": reals(),
    "weight_joints": wholes("N", 4),
    "weight_shares": wholes("N", 4),
    "joint_names": texts("K"),
    "parents": wholes("K"),
    "faces": wholes("F", 3),
    "mirror": wholes("N"),
    **{f"J_regressor_{part}": wholes("entries of J_regressor") for part in PARTS},
    "coco_names": texts("M"),
    **{f"coco_{part}": wholes("entries of coco") for part in PARTS},
    "card": texts(),
}


def read_embedded(path: Path) -> EmbeddedBody:
    """One packed body. Raises BadFile if the file is missing or is not one."""
    with (
        taken_for(path, "embedded body", "install the workbench again, or build the body again"),
        open_arrays(path) as archive,
    ):
        arrays = read_expected(archive, EXPECTED)
        return _unpacked(arrays, facts_in(arrays["card"]).told)


def _unpacked(arrays: dict[str, NDArray[Any]], card: Mapping[str, Any]) -> EmbeddedBody:
    N, joint_names = len(arrays["template"]), _names(arrays["joint_names"])
    coco_names = _names(arrays["coco_names"])
    weights = np.zeros((N, len(joint_names)))
    check_numbers("weight_joints", arrays["weight_joints"], len(joint_names))
    np.put_along_axis(weights, arrays["weight_joints"], arrays["weight_shares"], axis=1)
    return EmbeddedBody(
        template=arrays["template"],
        shapedirs=arrays["shapedirs"] * float(arrays["shapedirs_step"]),
        posedirs=np.ascontiguousarray(arrays["posedirs"].T) * float(arrays["posedirs_step"]),
        J_regressor=_regressor(arrays, "J_regressor", (len(joint_names), N)),
        weights=weights / _totals("weight_shares", weights),
        parents=tuple(int(parent) for parent in arrays["parents"]),
        faces=arrays["faces"],
        joint_names=joint_names,
        mirror=arrays["mirror"],
        landmarks={"coco": (coco_names, _regressor(arrays, "coco", (len(coco_names), N)))},
        card={"synthetic": SYNTHETIC} | dict(card),
    )


def _names(array: NDArray[Any]) -> tuple[str, ...]:
    return tuple(str(name) for name in array)


def _regressor(arrays: dict[str, NDArray[Any]], name: str, shape: tuple[int, int]) -> csr_array:
    """Rows that sum to one, from whole shares of each."""
    rows, columns, shares = (arrays[f"{name}_{part}"] for part in PARTS)
    check_numbers(f"{name}_rows", rows, shape[0])
    check_numbers(f"{name}_columns", columns, shape[1])
    matrix = csr_array((shares.astype(np.float64), (rows, columns)), shape=shape)
    return csr_array(matrix.multiply(1 / _totals(f"{name}_shares", matrix)))


def _totals(name: str, shares: Array | csr_array) -> Array:
    """The sum of each row, (rows, 1)."""
    totals: Array = np.asarray(shares.sum(axis=1), dtype=np.float64)
    if not (totals > 0).all():
        raise BadFile(f"{name} of row {int(np.argmin(totals))} are not above zero together")
    return totals[:, None]
