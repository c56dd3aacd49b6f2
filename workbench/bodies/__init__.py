"""Bodies: named blocks of numbers in, points out; and the files they live in."""

from workbench.bodies.skinned import Landmarks, SkinnedBody
from workbench.bodies.skinning import Skinning, dual_quaternion_blend, linear_blend

__all__ = ["Landmarks", "SkinnedBody", "Skinning", "dual_quaternion_blend", "linear_blend"]
