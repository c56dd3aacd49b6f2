"""When a marginal is taken from draws of all free numbers, and not along a ridge."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks.layout import entries
from workbench.problem import Problem
from workbench.sampling.descent import rows_between
from workbench.sampling.subspace import movable

MOST = 21  # free numbers that ensembles sample well
MOST_LIMITED = 200  # and that Laplace's Gaussian is cut off in


def named(problem: Problem, names: str | Iterable[str] | None) -> tuple[str, ...]:
    """The names as a tuple: of all free blocks, if none are given."""
    if names is None:
        return problem.free.names
    return (names,) if isinstance(names, str) else tuple(names)


def jointly(
    problem: Problem, at: Mapping[str, ArrayLike], wanted: tuple[str, ...]
) -> tuple[str, ...]:
    """The labels of all numbers that can be drawn with the named ones; empty if these are too many.

    Empty as well where nothing but the named ones could be drawn. Numbers with equal bounds, and
    those that equations read, are not drawn.
    """
    return _together(problem, at, wanted, MOST)


def jointly_with_limits(
    problem: Problem, at: Mapping[str, ArrayLike], wanted: tuple[str, ...]
) -> tuple[str, ...]:
    """`jointly` for Laplace's approximation; limits on any number cut off the whole Gaussian."""
    limited = problem.bounded or problem.stacked_constraints is not None
    return _together(problem, at, wanted, MOST_LIMITED if limited else MOST)


def _together(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    wanted: tuple[str, ...],
    most: int,
) -> tuple[str, ...]:
    chosen = entries(problem.free, wanted)
    if problem.free.size > most or len(chosen) == problem.free.size:
        return ()
    x, given = problem.split(at)
    here = problem.linearize_at(x, given)
    free = movable(problem)
    if (
        here.by_frames or not free[chosen].all()
    ):  # an equation or equal bounds: refused where they are read
        return ()
    others = np.setdiff1d(np.flatnonzero(free), chosen)
    if not others.size:
        return ()
    between = rows_between(problem.lower, problem.upper, 1.0)
    J = np.vstack([here.dense, between])[:, others]
    lengths = np.linalg.norm(J, axis=0)
    if np.linalg.matrix_rank(J / np.where(lengths > 0, lengths, 1.0)) < len(others):
        return ()  # they would have no width; the named ones may have one
    return tuple(problem.free.labels_of(np.sort(np.concatenate([chosen, others]))))
