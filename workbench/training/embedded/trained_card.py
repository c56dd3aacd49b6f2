"""What a trained body says about itself, from the numbers of its own run."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.training.embedded import wheel
from workbench.training.embedded.build import Sources
from workbench.training.embedded.card import LICENCE, PROVENANCE, rounding_error
from workbench.training.embedded.packing import BuiltBody
from workbench.training.embedded.topology import FILES
from workbench.training.pose_training import PoseModel
from workbench.training.sets import SetRecipe

Array = NDArray[np.float64]
TRAINED = (
    "Trained from synthetic registrations: people in poses on one mesh, their poses and joints "
    "unknown to the training. Weights and pose blend shapes are of people of both genders; "
    "template, shape directions and joint regressor of those that `trained_on` names.",
)


@dataclass(frozen=True, eq=False)
class TrainedOn:
    """Who a body is of, and what was found out on the way."""

    gender: str
    subjects: int  # of the multi-pose set, for the joint regressor
    people: int  # of the multi-shape set
    explained: Array  # (10,): the share of these people's variance
    joint_errors: Array  # (K,) m rms
    keypoint_errors: Array  # (M,) m rms
    ridge: float


def card_of_trained(
    name: str,
    built: BuiltBody,
    stored: SkinnedBody,
    model: PoseModel,
    told: TrainedOn,
    met: Mapping[str, float],
    sources: Sources,
) -> dict[str, Any]:
    """Ready for JSON; `met` is what strangers said, of the body as stored."""
    estimate, sigmas = model.estimate, model.objective.sigmas
    kkt = [entry.facts["kkt"] for entry in model.log if "kkt" in entry.facts]
    poses = estimate.poses[:: max(1, len(estimate.poses) // 20)].copy()
    poses[:, 0] = 0
    arrays = {n: getattr(stored, n) for n in ("template", "shapedirs", "posedirs", "weights")} | {
        "J_regressor": stored.J_regressor.toarray()
    }
    cumulative = np.cumsum(told.explained)
    return {
        "name": name,
        "n_vertices": len(built.template),
        "n_faces": len(built.faces),
        "source": {
            "wheel": f"{wheel.NAME}=={wheel.VERSION}",
            "sha256": wheel.SHA256,
            "topology": FILES[name.partition("-")[0]],
        },
        "licence": LICENCE,
        "provenance": [*PROVENANCE, *TRAINED],
        "builder": {
            "command": "python -m workbench.training.embedded.trained WHEEL --mocap MOCAP "
            "--work FOLDER --out workbench/data/bodies",
            **asdict(SetRecipe(body=name.partition("-")[0])),
            "versions": {name: version(name) for name in ("numpy", "scipy", "trimesh")},
        },
        "population": {"measured_on": "the base mesh", **sources.population.facts()},
        "trained_on": {
            "registrations": len(estimate.poses),
            "subjects": len(estimate.templates),
            "subjects_for_joints": told.subjects,
            "people_for_shape": told.people,
            "of": told.gender,
        },
        "training_rms_mm_per_coordinate": round(1e3 * model.objective.rms(estimate), 4),
        "final_costs": {k: float(f"{v:.6g}") for k, v in model.log[-1].after.items()},
        "lambdas": {k: float(f"{v:.6g}") for k, v in sigmas.lambdas.items()},
        "worst_kkt": float(f"{max(kkt):.2g}"),
        "blocks": ", ".join(entry.block for entry in model.log),
        "pose_blend_shapes": {"ridge_per_pose": told.ridge},
        "held_out": dict(met),
        "betas": {
            "unit": "standard deviations of the population",
            "sign": "the first is taller, the others are heavier",
            "explained_variance": _rounded(told.explained, 5),
            "cumulative": _rounded(cumulative, 5),
        },
        "J_regressor_rms_mm": dict(
            zip(stored.joint_names, _rounded(1e3 * told.joint_errors, 2), strict=True)
        ),
        "coco_regressor_rms_mm": dict(
            zip(built.keypoint_names, _rounded(1e3 * told.keypoint_errors, 2), strict=True)
        ),
        "largest_rounding_error_mm": round(1e3 * rounding_error(built, arrays, poses), 4),
    }


def _rounded(values: Array, digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]
