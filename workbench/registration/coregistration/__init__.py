"""Coregistration: the registrations of many scans and the model that couples them, together."""

from workbench.registration.coregistration.coregistering import Coregistration, Fitted
from workbench.registration.coregistration.plan import CoregistrationPlan, hard, soft
from workbench.registration.coregistration.scan_block import Scans, ScansInMemory
from workbench.registration.coregistration.state import State

__all__ = [
    "Coregistration",
    "CoregistrationPlan",
    "Fitted",
    "Scans",
    "ScansInMemory",
    "State",
    "hard",
    "soft",
]
