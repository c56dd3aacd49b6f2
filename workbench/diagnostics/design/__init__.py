"""What to measure next: which candidates leave what matters least uncertain.

This depends on Jacobians alone. `candidates` turns each `Candidate` into whitened rows with respect
to the problem's unknowns; a `Criterion` says what matters.
`search` updates a square root of the covariance by such rows without forming J'J, keeps null
directions apart until something determines them, and compares all combinations where there are few;
otherwise it goes greedily and then exchanges: first by how many directions that matter stay
undetermined, then by the criterion.
"""

from workbench.diagnostics.design.candidates import (
    CRITERIA,
    Candidate,
    Criterion,
    Quantity,
    a_optimal,
    d_optimal,
    e_optimal,
    sd_of,
    with_candidates,
)
from workbench.diagnostics.design.design import MeasurementDesign, Ranked, design
from workbench.diagnostics.design.search import Score

__all__ = [
    "CRITERIA",
    "Candidate",
    "Criterion",
    "MeasurementDesign",
    "Quantity",
    "Ranked",
    "Score",
    "a_optimal",
    "d_optimal",
    "design",
    "e_optimal",
    "sd_of",
    "with_candidates",
]
