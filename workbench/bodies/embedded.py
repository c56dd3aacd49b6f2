"""Reading the bodies that come with the workbench, as the builder packed them."""

import json
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.errors import BadFile

Array = NDArray[np.float64]
Index = NDArray[np.int64]
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


def read_embedded(path: Path) -> EmbeddedBody:
    """One packed body. Raises BadFile if the file is missing or is not one."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return _unpacked(dict(file))
    except (OSError, KeyError, ValueError) as error:
        raise BadFile(f"{path} is no embedded body: {error}") from error


def _unpacked(arrays: dict[str, NDArray[Any]]) -> EmbeddedBody:
    N, joint_names = len(arrays["template"]), _names(arrays["joint_names"])
    coco_names = _names(arrays["coco_names"])
    weights = np.zeros((N, len(joint_names)))
    np.put_along_axis(weights, arrays["weight_joints"], arrays["weight_shares"], axis=1)
    return EmbeddedBody(
        template=arrays["template"].astype(np.float64),
        shapedirs=arrays["shapedirs"] * float(arrays["shapedirs_step"]),
        # Stored with the axes reversed, which compresses better.
        posedirs=np.ascontiguousarray(arrays["posedirs"].T) * float(arrays["posedirs_step"]),
        J_regressor=_regressor(arrays, "J_regressor", (len(joint_names), N)),
        weights=weights / weights.sum(axis=1, keepdims=True),
        parents=tuple(int(parent) for parent in arrays["parents"]),
        faces=arrays["faces"].astype(np.int64),
        joint_names=joint_names,
        mirror=arrays["mirror"].astype(np.int64),
        landmarks={"coco": (coco_names, _regressor(arrays, "coco", (len(coco_names), N)))},
        card={"synthetic": SYNTHETIC} | json.loads(str(arrays["card"])),
    )


def _names(array: NDArray[Any]) -> tuple[str, ...]:
    return tuple(str(name) for name in array)


def _regressor(arrays: dict[str, NDArray[Any]], name: str, shape: tuple[int, int]) -> csr_array:
    """Rows that sum to one, from whole shares of each."""
    where = arrays[f"{name}_rows"].astype(np.int64), arrays[f"{name}_columns"].astype(np.int64)
    shares = csr_array((arrays[f"{name}_shares"].astype(np.float64), where), shape=shape)
    totals: Array = np.asarray(shares.sum(axis=1))
    return csr_array(shares.multiply(1 / totals[:, None]))
