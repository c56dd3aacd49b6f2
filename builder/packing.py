"""A built body, and how it is stored: small whole numbers, each array with its step."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, Index
from workbench.geometry.mirror import opposites
from workbench.synthetic.teacher import JOINT_NAMES, MIRRORED_JOINTS, PARENTS, SHARES
from workbench.writing import replacing

SHAPE_STEP = 5e-6  # m
POSE_STEP = 2e-5  # m


@dataclass(frozen=True, eq=False)
class BuiltBody:
    """The arrays of one embedded body, as `workbench.bodies.files.embedded` gives them back.

    Attributes:
        template: (N, 3) m.
        shapedirs: (N, 3, 10) m.
        posedirs: (N, 3, 207) m.
        J_regressor: (24, N).
        weights: (N, 24).
        faces: (F, 3).
        mirror: (N,).
        keypoint_regressor: (M, N).
    """

    template: Array
    shapedirs: Array
    posedirs: Array
    J_regressor: Array
    weights: Array
    faces: Index
    mirror: Index
    keypoint_names: tuple[str, ...]
    keypoint_regressor: Array


def write_body(body: BuiltBody, card: Mapping[str, Any], path: Path) -> None:
    """Write one body and its card, without pickles; the same bytes for the same body."""
    rows = np.arange(len(body.template))
    influences = whole_shares(body.weights, body.mirror, MIRRORED_JOINTS)
    shares = {
        "J_regressor": whole_shares(body.J_regressor, MIRRORED_JOINTS, body.mirror),
        "coco": whole_shares(body.keypoint_regressor, opposites(body.keypoint_names), body.mirror),
    }
    pelvis = shares["J_regressor"][0] / SHARES @ body.template
    joints = np.sort(np.argsort(-influences, axis=1, kind="stable")[:, :4], axis=1)
    arrays = {
        "template": body.template - pelvis * [0.0, 1.0, 1.0],  # x is zero but for rounding
        "shapedirs": in_steps(body.shapedirs, SHAPE_STEP),
        "shapedirs_step": np.array(SHAPE_STEP),
        "posedirs": in_steps(body.posedirs, POSE_STEP).transpose(2, 1, 0),  # smaller this way
        "posedirs_step": np.array(POSE_STEP),
        "weight_joints": joints.astype(np.uint8),
        "weight_shares": influences[rows[:, None], joints].astype(np.uint16),
        **sparse("J_regressor", shares["J_regressor"]),
        **sparse("coco", shares["coco"]),
        "coco_names": np.array(body.keypoint_names),
        "faces": body.faces.astype(np.uint16),
        "mirror": body.mirror.astype(np.uint16),
        "joint_names": np.array(JOINT_NAMES),
        "parents": np.array(PARENTS, np.int8),
        "card": np.array(json.dumps(card)),
    }
    write_arrays(path, arrays)


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write arrays into a compressed .npz, whole or not at all, without pickles."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def in_steps(values: Array, step: float) -> NDArray[np.int16]:
    """The nearest multiples of a step."""
    return np.rint(values / step).astype(np.int16)


def whole_shares(rows: Array, mirror_rows: Index, mirror_columns: Index) -> Index:
    """Rows that sum to one as whole numbers that sum to SHARES, still alike on both sides.

    What rounding leaves over goes to the largest share; in a row on the midline to the largest
    one on the midline, or else half each to the largest one and its opposite.
    """
    shares = np.rint(rows * SHARES).astype(np.int64)
    for i, opposite in enumerate(mirror_rows):
        if opposite < i:
            shares[i] = shares[opposite][mirror_columns]
            continue
        over = SHARES - shares[i].sum()
        eligible = shares[i].copy()
        central = mirror_columns == np.arange(len(mirror_columns))
        if opposite == i and (shares[i] * central).any():
            eligible[~central] = 0
        largest = int(eligible.argmax())
        if opposite == i and not central[largest]:
            shares[i, [largest, mirror_columns[largest]]] += over // 2
        else:
            shares[i, largest] += over
    return shares


def sparse(name: str, shares: Index) -> dict[str, NDArray[Any]]:
    """The places and the sizes of the shares that are not zero."""
    where = np.nonzero(shares)
    return {
        f"{name}_rows": where[0].astype(np.uint8),
        f"{name}_columns": where[1].astype(np.uint16),
        f"{name}_shares": shares[where].astype(np.uint16),
    }
