"""Bodies with one part of the model taken away, to see what that part does.

Each ablation is a function from a body to a body with the same pose, betas and trans, which can be
drawn beside the whole body, fitted, diagnosed and sampled like it.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.bodies.forward.surface import star_features
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadBody

Ablation = Callable[[SkinnedBody], SkinnedBody]


def _without(body: SkinnedBody, name: str, **parts: Any) -> SkinnedBody:
    if free := parts.keys() & body.free.keys():
        raise BadBody(
            f"the {', '.join(free)} of body {body.name!r} are free, so they cannot be taken away; "
            "give them values first, with body.with_values(values)"
        )
    return replace(body, **parts, name=f"{body.name} without {name}")


def without_blend_weights(body: SkinnedBody) -> SkinnedBody:
    """Every vertex follows the one joint with its largest weight: rigid parts, torn at joints."""
    parts = np.eye(body.n_joints)[body.weights.argmax(axis=1)]
    return _without(body, "blend weights", weights=parts)


def without_pose_blend_shapes(body: SkinnedBody) -> SkinnedBody:
    """Skinning alone: the rest surface does not depend on the pose."""
    return _without(body, "pose blend shapes", posedirs=np.zeros_like(body.posedirs))


def without_shape_blend_shapes(body: SkinnedBody) -> SkinnedBody:
    """Everybody is the mean person, joints included: betas are accepted and change nothing."""
    parts = {"shapedirs": np.zeros_like(body.shapedirs)}
    if body.features is star_features:  # the last of which is beta_2
        parts["posedirs"] = np.concatenate(
            [body.posedirs[:, :, :-1], np.zeros((body.n_vertices, 3, 1))], axis=2
        )
    return _without(body, "shape blend shapes", **parts)


ABLATIONS: Mapping[str, Ablation] = {
    "blend weights": without_blend_weights,
    "pose blend shapes": without_pose_blend_shapes,
    "shape blend shapes": without_shape_blend_shapes,
}
