"""Problems: residuals over named blocks, some of them free; and how they look from one point."""

from workbench.problem.constraint import Constraint
from workbench.problem.linearization import Linearization
from workbench.problem.problem import Problem
from workbench.problem.rounding import RowSupport
from workbench.problem.sequence import sequence
from workbench.problem.spectrum import Spectrum

__all__ = ["Constraint", "Linearization", "Problem", "RowSupport", "Spectrum", "sequence"]
