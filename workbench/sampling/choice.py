"""What to sample, said by names or by how many directions the data know."""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from workbench.blocks.entries import entries
from workbench.problem import Problem
from workbench.sampling.subspace import Rest, Subspace, informed

Array = NDArray[np.float64]
Choice = Callable[[Problem, Array, Array], Subspace]  # of a problem, free and fixed numbers
Names = str | Iterable[str] | Choice | None


def directions(count: int, priors: Iterable[str]) -> Choice:
    """The `count` directions that the data know best, compared with the priors; see `informed`."""
    told = tuple(priors)

    def choice(problem: Problem, x: Array, given: Array) -> Subspace:
        return informed(problem, problem.linearize_at(x, given), x, count, told)

    return choice


def chosen(problem: Problem, x: Array, given: Array, names: Names, rest: Rest) -> Subspace:
    """The subspace that is meant: by a choice, or by names and what becomes of the rest."""
    if callable(names):
        return names(problem, x, given)
    meant = entries(problem.free, problem.free.names if names is None else names)
    return rest(problem, problem.linearize_at(x, given), x, meant)
