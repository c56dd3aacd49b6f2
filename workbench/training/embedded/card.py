"""What a body says about itself: sources, licences, and what was measured on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workbench.training.embedded import wheel
from workbench.training.embedded.packing import BuiltBody
from workbench.training.embedded.pose_blends import Correction
from workbench.training.embedded.skeleton import (
    JOINT_NAMES,
    binding_motions,
    blended,
    pose_features,
    skin,
)
from workbench.training.embedded.topology import FILES

if TYPE_CHECKING:
    from workbench.training.embedded.build import Recipe, Result, Sources

Array = NDArray[np.float64]

LICENCE = (
    "Shape and rig: MakeHuman / MPFB2 assets, CC0 1.0. Mesh topology and keypoint regressor: "
    "Copyright (C) 2025 NAVER Corporation, Apache-2.0. Everything computed from them here: as the "
    "project, Apache-2.0."
)
PROVENANCE = (
    "The people were made, not measured: drawn from traits and shape targets that artists modelled,"
    " with weight and girth raised until the body mass index is that of people, about 25. Read no "
    "anthropometry off this body.",
    "The pose blend shapes were made, not measured: they repeat a synthetic teacher, a rig of 32 "
    "bones with twist spread along the limbs and dual quaternion skinning. No scan was seen.",
    "Only the poses they were learned in come from people: draws of a Gaussian learned from motion"
    " capture (workbench/data/poses). Toes, fingers and collars were not recorded.",
    "Un-posed from the artists' A-pose by the exact inverse of linear blend skinning, one person at"
    " a time. The mesh is alike on both sides; nipples are smoothed away; there are no eyeballs.",
)


def card_of(
    result: Result,
    sources: Sources,
    recipe: Recipe,
    corrections: Mapping[str, Correction],
    rounding: float,
) -> dict[str, Any]:
    """The card of one body, ready for JSON."""
    return {
        "name": result.name,
        "n_vertices": len(result.body.template),
        "n_faces": len(result.body.faces),
        "source": {
            "wheel": f"{wheel.NAME}=={wheel.VERSION}",
            "sha256": wheel.SHA256,
            "topology": FILES[result.name],
        },
        "licence": LICENCE,
        "provenance": list(PROVENANCE),
        "builder": {
            "command": "python -m workbench.training.embedded WHEEL --out workbench/data/bodies",
            **asdict(recipe),
            "versions": {name: version(name) for name in ("numpy", "scipy", "trimesh")},
        },
        "population": {"measured_on": "the base mesh", **sources.population.facts()},
        "betas": {
            "unit": "standard deviations of the population",
            "sign": "the first is taller, the others are heavier",
            "explained_variance": _rounded(result.explained, 5),
            "cumulative": _rounded(np.cumsum(result.explained), 5),
        },
        "J_regressor_rms_mm": dict(
            zip(JOINT_NAMES, _rounded(1e3 * result.joint_errors, 2), strict=True)
        ),
        "coco_regressor_rms_mm": dict(
            zip(result.body.keypoint_names, _rounded(1e3 * result.keypoint_errors, 2), strict=True)
        ),
        "pose_blend_shapes": {
            "ridge_per_pose": result.ridge,
            "what": "posed distance to the synthetic teacher in mm, linear blend skinning alone "
            "and with pose blend shapes, on poses that nothing was learned from; frames of the "
            "recording whose elbows bend backwards, being flipped, are left out",
            **{name: _digits(correction) for name, correction in corrections.items()},
        },
        "largest_rounding_error_mm": round(1e3 * rounding, 4),
    }


def rounding_error(body: BuiltBody, stored: Mapping[str, Any], poses: Array) -> float:
    """The farthest that storing has moved a vertex, in m, over poses (P, 24, 3) of tall people."""
    betas = np.linspace(-2, 2, body.shapedirs.shape[2])
    exact = body.template, body.shapedirs, body.posedirs, body.J_regressor, body.weights
    names = ("template", "shapedirs", "posedirs", "J_regressor", "weights")
    rounded = [stored[name] for name in names]
    return max(
        float(
            np.linalg.norm(_posed(exact, betas, pose) - _posed(rounded, betas, pose), axis=1).max()
        )
        for pose in poses
    )


def _posed(arrays: Any, betas: Array, pose: Array) -> Array:
    template, shapedirs, posedirs, J_regressor, weights = arrays
    person = template + shapedirs @ betas
    M, m = blended(weights, *binding_motions(pose, J_regressor @ person))
    return skin(person + posedirs @ pose_features(pose), M, m)


def _rounded(values: Array, digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]


def _digits(correction: Correction) -> dict[str, float]:
    numbers = {**asdict(correction), "explained": correction.explained}
    return {name: round(value, 3) for name, value in numbers.items()}
