"""Where a diagnosis begins."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks.checks import texts
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.looked_at import looked_at
from workbench.errors import BadArgument, UnknownName
from workbench.problem import Problem


def diagnose(
    problem: Problem, at: Mapping[str, ArrayLike], *, priors: str | Iterable[str] = ()
) -> Diagnosis:
    """Look at a problem's whitened Jacobian at the values `at`.

    `priors` name the residuals that are no data, or is such a name; what is known by them alone
    is told apart. Raises UnknownName for a name that no residual has, BadArgument for what is no
    problem, and what `Problem.split` raises for the values.
    """
    if not isinstance(problem, Problem):
        raise BadArgument(f"a Problem is diagnosed, not something of type {type(problem).__name__}")
    for name in (names := texts("the names of priors", priors)):
        if name not in problem.rows:
            raise UnknownName("residual", name, problem.rows)
    here = looked_at(problem, at)  # looks at every value
    read = (*problem.free.names, *problem.fixed.names)
    values = {name: np.asarray(at[name], dtype=float) for name in read}
    return Diagnosis(problem, values, here, names)
