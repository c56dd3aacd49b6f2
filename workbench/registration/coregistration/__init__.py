"""Coregistration: the registrations of many scans and the model that couples them, together."""

from workbench.registration.coregistration.coregistering import Coregistration, Fitted
from workbench.registration.coregistration.plan import CoregistrationPlan, hard, soft
from workbench.registration.coregistration.scan_block import Scans, ScansInMemory
from workbench.registration.coregistration.state import State
from workbench.registration.coregistration.triangle_plan import TrianglePlan
from workbench.registration.coregistration.triangle_steps import learned_bends
from workbench.registration.coregistration.triangles import TriangleCoregistration, TriangleState

__all__ = [
    "Coregistration",
    "CoregistrationPlan",
    "Fitted",
    "Scans",
    "ScansInMemory",
    "State",
    "TriangleCoregistration",
    "TrianglePlan",
    "TriangleState",
    "hard",
    "learned_bends",
    "soft",
]
