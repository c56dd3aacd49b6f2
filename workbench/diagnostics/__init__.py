"""What a problem's Jacobian can see, the names of what it cannot, and what to do about it.

`Diagnosis` computes part after part when it is asked for, a module each: `structure`, `null_space`,
`conditioning`, `identifiability`, `derivatives`, `remedies`; `report` and `data` put it into text
and data. Everything about columns comes from one small triangular R with R'R = J'J. A
large sparse Jacobian is factorized instead (`sparse_jacobian`), and the unknowns of a long sequence
are eliminated frame after frame (`sequences`), where the same name in many frames is said once.

A null space has no basis of its own. Its directions are searched for by the motions that have a
name, the most general first: `generators` is their catalogue, a function for each kind, `gauges`
asks which of them others undo, `joint_motions` are those of joints and limbs, and what is left is
said in units. Whether a direction is weak is measured in characteristic `scales`, so that units
change no judgement and no name. Every remedy is tried before it is suggested.
"""

from workbench.diagnostics.active_set import ActiveSet, ConstrainedJacobian
from workbench.diagnostics.derivatives import DerivativeCheck, Suspect
from workbench.diagnostics.design import (
    Candidate,
    Criterion,
    MeasurementDesign,
    Quantity,
    Ranked,
    Score,
    a_optimal,
    d_optimal,
    design,
    e_optimal,
    sd_of,
    with_candidates,
)
from workbench.diagnostics.diagnosis import (
    Diagnosis,
    Undiagnosed,
    diagnose,
    diagnose_whole,
)
from workbench.diagnostics.diagnosis_comparison import DiagnosisComparison
from workbench.diagnostics.gauges import Gauge
from workbench.diagnostics.identifiability import (
    Contribution,
    EntryIdentifiability,
    Identifiability,
)
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.over_points import PointsDiagnosis, Recurring, diagnose_over, prior_draws
from workbench.diagnostics.remedies import RankAndCondition, Suggestion
from workbench.diagnostics.report import Finding
from workbench.diagnostics.scales import Scales
from workbench.diagnostics.sequence_names import NullDirections
from workbench.diagnostics.sequences import SequenceDiagnosis, SharedUnknowns
from workbench.diagnostics.structure import Structure, Submatrix, TermBlock

__all__ = [
    "ActiveSet",
    "Candidate",
    "ConstrainedJacobian",
    "Contribution",
    "Criterion",
    "DerivativeCheck",
    "Diagnosis",
    "DiagnosisComparison",
    "Direction",
    "EntryIdentifiability",
    "Finding",
    "Gauge",
    "Identifiability",
    "MeasurementDesign",
    "NullDirections",
    "PointsDiagnosis",
    "Quantity",
    "RankAndCondition",
    "Ranked",
    "Recurring",
    "Scales",
    "Score",
    "SequenceDiagnosis",
    "SharedUnknowns",
    "Structure",
    "Submatrix",
    "Suggestion",
    "Suspect",
    "TermBlock",
    "Undiagnosed",
    "a_optimal",
    "d_optimal",
    "design",
    "diagnose",
    "diagnose_over",
    "diagnose_whole",
    "e_optimal",
    "prior_draws",
    "sd_of",
    "with_candidates",
]
