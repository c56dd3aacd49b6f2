"""Motions from one body to another, and from points in space to a body.

`correspond` brings the target into the rest pose and shape of the source, by joints of the same
names and then by closest places, and reads off where each vertex lies; that place moves with its
triangle. The target is then fitted to these places of a sample of its vertices: a few frames that
differ give the shape, as one sequence, and each frame is a small problem that begins at the one
before (`tracking`). Named points in space are handled alike (`points_in_space`).

>>> from workbench import load_body
>>> from workbench.conversion import correspond
>>> small, default = load_body("small"), load_body("default")
>>> found = correspond(default, small)  # where each vertex of small lies on default
>>> found.of(default.vertices()).shape == small.template.shape
True
"""

from workbench.conversion.converting import Converted, conversion_errors, convert
from workbench.conversion.correspondence import Correspondence, correspond
from workbench.conversion.points_in_space import (
    PointFit,
    motion_from_points,
    motion_from_skeleton,
    point_sets,
)

__all__ = [
    "Converted",
    "Correspondence",
    "PointFit",
    "conversion_errors",
    "convert",
    "correspond",
    "motion_from_points",
    "motion_from_skeleton",
    "point_sets",
]
