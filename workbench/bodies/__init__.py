"""Bodies: named blocks of numbers in, points out; and the files they live in.

A body is SMPL, or differs from it in the value of a field: `skinning` blends the motions of joints,
and `features` is the function f of the pose in B_P(theta) = sum of f_n P_n. The arithmetic of
`forward` covers SMPL's own choice (`is_smpl`); every other choice is part of the graph.
"""

from workbench.bodies.body import Body, Landmarks
from workbench.bodies.capsule_fitting import fit_capsules
from workbench.bodies.capsules import (
    Capsules,
    capsule_ends,
    capsule_gaps,
    capsule_points,
    capsules_of,
)
from workbench.bodies.checking.check_file import FileCheck, check_body_file
from workbench.bodies.checking.model_arrays import FileFinding
from workbench.bodies.forward.skinning import (
    Skinning,
    dual_quaternion_blend,
    linear_blend,
    skin,
)
from workbench.bodies.hands import (
    HAND_POINTS,
    HandMotion,
    hand_motions,
    hand_points,
    is_hand,
    mirrored,
)
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.spaces import PoseSpace, ShapeSpace, pose_space, shape_space

__all__ = [
    "HAND_POINTS",
    "Body",
    "Capsules",
    "FileCheck",
    "FileFinding",
    "HandMotion",
    "Landmarks",
    "PoseSpace",
    "ShapeSpace",
    "SkinnedBody",
    "Skinning",
    "capsule_ends",
    "capsule_gaps",
    "capsule_points",
    "capsules_of",
    "check_body_file",
    "dual_quaternion_blend",
    "fit_capsules",
    "hand_motions",
    "hand_points",
    "is_hand",
    "linear_blend",
    "mirrored",
    "pose_space",
    "shape_space",
    "skin",
]
