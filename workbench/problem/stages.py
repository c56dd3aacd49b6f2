"""Problems of stages: some names are free, and some residuals count more or less than usual."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workbench.problem.problem import Problem

Stage = tuple[tuple[str, ...] | None, tuple[tuple[str, float], ...]]  # free names, weights


def in_stage(
    problem: "Problem", names: tuple[str, ...] | None, weights: Mapping[str, float]
) -> "Problem":
    """The problem of a stage: `names` are free, or what is free now; `weights` says how many times
    as often the rows of named residuals count. Made once, and kept for the next fit.

    Raises what `Problem.freeing` raises, and UnknownName for a residual.
    """
    problem.rows_named(weights)
    of = {name: float(weight) for name, weight in weights.items() if weight != 1}
    key: Stage = names, tuple(sorted(of.items()))
    if names is None and not of:
        return problem
    if key not in problem.stages:
        residuals = [r.weighed(of[r.name]) if r.name in of else r for r in problem.residuals]
        free = problem.free.spelled() if names is None else names
        problem.stages[key] = problem.variant(residuals, free)
    return problem.stages[key]
