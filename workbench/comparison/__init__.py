"""Comparing solvers fairly: many problems and starts, one budget, targets common to all."""

from workbench.comparison.budget import Budget
from workbench.comparison.compare import compare
from workbench.comparison.comparison import Comparison
from workbench.comparison.record import Ending, Record
from workbench.comparison.targets import TAUS, TargetOutcome

__all__ = ["TAUS", "Budget", "Comparison", "Ending", "Record", "TargetOutcome", "compare"]
