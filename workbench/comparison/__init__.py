"""Comparing solvers fairly: many problems and starts, one budget, targets common to all."""

from workbench.comparison.budget import Budget
from workbench.comparison.causes import Cause
from workbench.comparison.compare import compare
from workbench.comparison.comparison import Comparison
from workbench.comparison.design import Instance
from workbench.comparison.end_analysis import EndAnalysis
from workbench.comparison.named_solvers import NamedSolver
from workbench.comparison.record import Ending, Record
from workbench.comparison.targets import TAUS, TargetOutcome, Yardstick

__all__ = [
    "TAUS",
    "Budget",
    "Cause",
    "Comparison",
    "EndAnalysis",
    "Ending",
    "Instance",
    "NamedSolver",
    "Record",
    "TargetOutcome",
    "Yardstick",
    "compare",
]
