"""What a problem's Jacobian can see, the names of what it cannot, and what to do about it."""

from workbench.diagnostics.diagnose import diagnose, diagnose_whole
from workbench.diagnostics.diagnosis import Diagnosis, Undiagnosed
from workbench.diagnostics.diagnosis_comparison import DiagnosisComparison
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.sequences import SequenceDiagnosis

__all__ = [
    "Diagnosis",
    "DiagnosisComparison",
    "Direction",
    "SequenceDiagnosis",
    "Undiagnosed",
    "diagnose",
    "diagnose_whole",
]
