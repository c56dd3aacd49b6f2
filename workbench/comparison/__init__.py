"""Comparing solvers fairly: many problems and starts, one budget, targets common to all.

A comparison carries out a `Design` (experiments, starts, solvers, one `Budget`) as independent
jobs, each in a worker process that can be killed. `Metered` counts, times and records every
evaluation that a solver asks for; what a solver reports is stored, and never used to decide
success. Answers are stored under keys made from all that they depend on, by which an interrupted
comparison continues. All else is computed from the `Record`s: targets, basins, causes, profiles,
sentences. Effort is the number of evaluations at published prices; times rank no solver. Tests
count problems and not runs, because several starts of one problem are not independent evidence.
"""

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
