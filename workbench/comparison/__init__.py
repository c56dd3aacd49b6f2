"""Comparing solvers fairly: many problems and starts, one budget, targets common to all.

A comparison carries out a `Design` (experiments, starts, solvers, one `Budget`) as independent
jobs, each in a worker process that can be killed. A `MeteredProblem` counts, times and records
every evaluation that a solver asks for; what a solver reports is stored, and never used to decide
success. Answers are stored under keys made from all that they depend on, by which an interrupted
comparison continues. All else is computed from the `Record`s: targets, basins, profiles,
sentences. Effort is the number of evaluations at published prices; times rank no solver. Tests
count problems and not runs, because several starts of one problem are not independent evidence.
"""

from workbench.comparison.compare import compare
from workbench.comparison.comparison import Comparison
from workbench.comparison.design import Budget, Instance, NamedSolver
from workbench.comparison.ends import EndAnalysis
from workbench.comparison.record import ObservedRun, Record, RunEnding
from workbench.comparison.targets import TAUS, ReferenceCosts, TargetOutcome

__all__ = [
    "TAUS",
    "Budget",
    "Comparison",
    "EndAnalysis",
    "Instance",
    "NamedSolver",
    "ObservedRun",
    "Record",
    "ReferenceCosts",
    "RunEnding",
    "TargetOutcome",
    "compare",
]
