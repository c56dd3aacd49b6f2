"""What a problem's Jacobian can see, and the names of what it cannot."""

from workbench.diagnostics.diagnosis import Diagnosis, diagnose
from workbench.diagnostics.null_space import Direction

__all__ = ["Diagnosis", "Direction", "diagnose"]
