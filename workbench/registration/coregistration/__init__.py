"""Coregistration: the registrations of many scans and the model that couples them, together.

One block registers all scans with the model held, the other fits the model; none raises the joint
cost. The latter does not take registrations as if they had been observed, because where nothing was
scanned, a registration only repeats the model and would hold it where it is. What remains of a
scan's cost when its registration is eliminated is a target for each vertex, with a confidence that
depends on the direction (`scan_block`).
"""

from workbench.registration.coregistration.coregistering import (
    Coregistration,
    CoregistrationPlan,
    Fitted,
    State,
)
from workbench.registration.coregistration.scan_block import Scans, ScansInMemory
from workbench.registration.coregistration.triangles import (
    TriangleCoregistration,
    TrianglePlan,
    bent_as,
)

__all__ = [
    "Coregistration",
    "CoregistrationPlan",
    "Fitted",
    "Scans",
    "ScansInMemory",
    "State",
    "TriangleCoregistration",
    "TrianglePlan",
    "bent_as",
]
