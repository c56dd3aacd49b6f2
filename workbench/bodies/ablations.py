"""Bodies with one part of the model taken away, to see what that part does.

Each ablation is a function from a body to a body with the same pose, betas and trans, which can be
drawn beside the whole body, fitted, diagnosed and sampled like it.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from workbench.bodies.forward.surface import star_features
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadBody

Ablation = Callable[[SkinnedBody], SkinnedBody]


def without_blend_weights(body: SkinnedBody) -> SkinnedBody:
    """Every vertex follows the one joint with its largest weight: rigid parts, torn at joints."""
    _refuse_free(body, "weights")
    parts = np.eye(body.n_joints)[body.weights.argmax(axis=1)]
    return replace(body, weights=parts, name=f"{body.name} without blend weights")


def without_pose_blend_shapes(body: SkinnedBody) -> SkinnedBody:
    """Skinning alone: the rest surface does not depend on the pose."""
    _refuse_free(body, "posedirs")
    none = np.zeros_like(body.posedirs)
    return replace(body, posedirs=none, name=f"{body.name} without pose blend shapes")


def without_shape_blend_shapes(body: SkinnedBody) -> SkinnedBody:
    """Everybody is the mean person, joints included: betas are accepted and change nothing."""
    _refuse_free(body, "shapedirs")
    none, posedirs = np.zeros_like(body.shapedirs), body.posedirs
    if body.features is star_features:  # the last of which is beta_2
        _refuse_free(body, "posedirs")
        posedirs = posedirs.copy()
        posedirs[:, :, -1] = 0
    return replace(
        body, shapedirs=none, posedirs=posedirs, name=f"{body.name} without shape blend shapes"
    )


ABLATIONS: Mapping[str, Ablation] = {
    "blend weights": without_blend_weights,
    "pose blend shapes": without_pose_blend_shapes,
    "shape blend shapes": without_shape_blend_shapes,
}


def _refuse_free(body: SkinnedBody, name: str) -> None:
    if name in body.free:
        raise BadBody(
            f"the {name} of body {body.name!r} are free, so they cannot be taken away; give them "
            "values first, with body.with_values(values)"
        )
