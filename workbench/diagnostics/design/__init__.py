"""What to measure next: which candidates leave what matters least uncertain.

`candidates` turns each `Candidate` into whitened rows by the problem's unknowns; a `Criterion` says
what matters. `search` compares all combinations where there are few; otherwise it goes greedily and
then exchanges.
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
