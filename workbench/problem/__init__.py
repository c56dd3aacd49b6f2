"""Problems: residuals over named blocks, some of them free; and how they look from one point."""

from workbench.problem.constraints import Constraint
from workbench.problem.linearization import Linearization, Spectrum
from workbench.problem.optimality import RowSupport
from workbench.problem.problem import Problem
from workbench.problem.sequence import sequence

__all__ = ["Constraint", "Linearization", "Problem", "RowSupport", "Spectrum", "sequence"]
