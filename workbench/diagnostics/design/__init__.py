"""What to measure next: which candidates leave what matters least uncertain."""

from workbench.diagnostics.design.candidates import Candidate, with_candidates
from workbench.diagnostics.design.criteria import (
    CRITERIA,
    Criterion,
    Quantity,
    a_optimal,
    d_optimal,
    e_optimal,
    sd_of,
)
from workbench.diagnostics.design.design import design
from workbench.diagnostics.design.measurement_design import MeasurementDesign, Ranked
from workbench.diagnostics.design.search import (
    Score,
    automatic,
    every_combination,
    greedy,
    greedy_with_exchange,
)

__all__ = [
    "CRITERIA",
    "Candidate",
    "Criterion",
    "MeasurementDesign",
    "Quantity",
    "Ranked",
    "Score",
    "a_optimal",
    "automatic",
    "d_optimal",
    "design",
    "e_optimal",
    "every_combination",
    "greedy",
    "greedy_with_exchange",
    "sd_of",
    "with_candidates",
]
