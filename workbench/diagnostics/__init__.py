"""What a problem's Jacobian can see, the names of what it cannot, and what to do about it."""

from workbench.diagnostics.comparison import Comparison
from workbench.diagnostics.diagnosis import Diagnosis, Undiagnosed
from workbench.diagnostics.looking import diagnose, diagnose_whole
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.sequences import SequenceDiagnosis

__all__ = [
    "Comparison",
    "Diagnosis",
    "Direction",
    "SequenceDiagnosis",
    "Undiagnosed",
    "diagnose",
    "diagnose_whole",
]
