"""What an evaluation costs, in units of one evaluation of the residual: one table for everybody.

Effort is a sum of counts times these prices, so the same runs have the same effort on every
machine. The prices are operation counts, not times. A residual is the unit. The derivatives cost
what Griewank and Walther (Evaluating Derivatives, second edition, SIAM 2008, chapters 3 and 4)
show to be enough for any program by algorithmic differentiation, in their model of what operations
and memory take, n being the number of free numbers:

    gradient of the cost, one reverse sweep                 4
    residual and Jacobian, n directions forwards            1 + 1.5 n
    Hessian of the cost, n second-order adjoints            4 + 6 n

These are upper bounds of operations, not of seconds. A sparse Jacobian, or one whose structure is
known, takes less than its price, which is unfavourable to solvers that ask for Jacobians. Where the
residual is very quick, a gradient may take many times its price on the clock, which is favourable
to solvers that ask for gradients. The page of a comparison therefore shows the measured ratios
beside the prices.

No theorem gives the ratio of a constraint to a residual. Evaluating all constraints once is priced
as one residual by convention, and their derivatives follow the same bounds.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.comparison.log import KINDS, LIMITED


@dataclass(frozen=True)
class Price:
    """The price of one kind of evaluation.

    Attributes:
        name: the name of the kind.
        formula: the formula, as text.
        of: the formula as a function of n; it returns evaluations of the residual.
    """

    name: str
    formula: str
    of: Callable[[int], float]


PRICES = {
    "residual": Price("residual", "1", lambda n: 1.0),
    "gradient": Price("gradient", "4", lambda n: 4.0),
    "jacobian": Price("Jacobian", "1 + 1.5 n", lambda n: 1.0 + 1.5 * n),
    "hessian": Price("Hessian", "4 + 6 n", lambda n: 4.0 + 6.0 * n),
    "constraint": Price("constraints", "1", lambda n: 1.0),
    "constraint_jacobian": Price("Jacobian of constraints", "1 + 1.5 n", lambda n: 1.0 + 1.5 * n),
    "constraint_hessian": Price("Hessian of constraints", "4 + 6 n", lambda n: 4.0 + 6.0 * n),
}
SOURCE = "Griewank and Walther, Evaluating Derivatives (2008)"


def prices(n: int) -> dict[str, float]:
    """The price of each kind of evaluation, for n free numbers."""
    return {kind: PRICES[kind].of(n) for kind in KINDS}


def units(counts: ArrayLike, n: int) -> Array:
    """The effort in evaluations of the residual: the counts (..., kinds) times their prices."""
    return np.asarray(np.asarray(counts, dtype=float) @ np.array(list(prices(n).values())))


def prices_in_words() -> str:
    """The prices in a sentence."""
    short = (f"{PRICES[kind].name} {PRICES[kind].formula}" for kind in KINDS[: LIMITED + 1])
    return f"{', '.join(short)}, for n free numbers"
