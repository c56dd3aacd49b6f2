"""Problems and points that no posterior can be drawn from, each refused with its reason."""

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadArgument, NotSupported
from workbench.problem import Problem
from workbench.sampling.subspace import Subspace

ROUNDED = 1e-10  # of the terms of a sum: zero, but for rounding
NUDGED = 1e-3  # of the size of an entry: far enough from a point where a derivative vanishes


def refuse_undefined(problem: Problem, given: Array, x: Array) -> None:
    """Raise BadArgument if the residual is not finite at x (n,), or means nothing there."""
    if not np.isfinite(problem.residual(x, given)).all():
        raise BadArgument(
            "the residual is not finite where Laplace's approximation is to begin; solve the "
            "problem first, and begin at its answer"
        )
    if missed := outside_in_words(problem, given, x):
        raise BadArgument(
            f"the posterior has no density where it is to begin: {missed}; begin at another answer"
        )


def outside_in_words(problem: Problem, given: Array, x: Array) -> str:
    """The first domain of a residual that x (n,) is outside of, in words; "" if it is in all."""
    return "" if problem.domain is None else problem.domain.outside_in_words(x, given)


def violation_in_words(problem: Problem, given: Array, x: Array) -> str:
    """The first bound, the worst constraint or the first domain that a point x (n,) misses.

    In words; "" if there is none.
    """
    out = np.flatnonzero((x < problem.lower) | (x > problem.upper))
    if out.size:
        i = int(out[0])
        limits = f"{problem.lower[i]:g} to {problem.upper[i]:g}"
        return f"{problem.free.label(i)} is {x[i]:g}, outside its bounds of {limits}"
    there = problem.stacked_constraints
    if there is not None:
        values = there.values(x, given)
        if there.violation(values) > 1.0:
            return there.worst(values)
    return outside_in_words(problem, given, x)


def refuse_flat(problem: Problem, given: Array, space: Subspace) -> None:
    """Raise NotSupported if an equation reads what is drawn, or bounds leave an entry one number.

    The points that meet an equation have no volume in the space of the draws, so a density on them
    is none in that space, and no proposal ever lands on them. An equation between numbers that
    all stay where they are is no obstacle, nor is a linear one that all draws meet because other
    numbers follow them (see `determined`). Whether it changes along what moves is asked of its
    Jacobian at three points, for at a single one a derivative may vanish.
    """
    if space.entries is not None:
        pinned = np.flatnonzero((problem.lower == problem.upper)[space.entries])
        if pinned.size:
            raise NotSupported(
                f"{space.labels[int(pinned[0])]} has equal bounds, so there is nothing to draw; "
                "name the other entries alone, or widen its bounds"
            )
    there = problem.stacked_constraints
    if there is None or not there.equal.any():
        return
    moves = space.span
    rng = np.random.default_rng(0)
    read = np.zeros(there.size, dtype=bool)
    for size in (0.0, NUDGED, NUDGED):
        x = space.origin + size * (1 + abs(space.origin)) * rng.standard_normal(len(space.origin))
        seen = there.linearize(x, given)
        read |= (abs(seen.along(moves)) > ROUNDED * seen.magnitudes_along(moves)).any(axis=1)
    wrong = np.flatnonzero(read & there.equal)
    if wrong.size:
        raise NotSupported(
            f"constraint {there.label(int(wrong[0]))} is an equation that depends on what is to "
            "be drawn; the points that meet it have no volume, so no draw can lie on it. Replace "
            "it by a residual with a sigma that says how exactly it holds, or draw entries that "
            "it does not depend on. Where it is linear, name the entries that determine the "
            "others, and let these follow (in Python rest=determined)"
        )
