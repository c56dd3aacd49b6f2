"""Motions from one body to another, and from points in space to a body.

>>> from workbench import load_body
>>> from workbench.conversion import correspond
>>> small, default = load_body("small"), load_body("default")
>>> found = correspond(default, small)  # where each vertex of small lies on default
>>> found.of(default.vertices()).shape == small.template.shape
True
"""

from workbench.conversion.converting import Converted, conversion_errors, convert
from workbench.conversion.correspondence import Correspondence, correspond
from workbench.conversion.points_in_space import PointFit, motion_from_points, point_sets

__all__ = [
    "Converted",
    "Correspondence",
    "PointFit",
    "conversion_errors",
    "convert",
    "correspond",
    "motion_from_points",
    "point_sets",
]
