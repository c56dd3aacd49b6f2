"""From which iterate on the residual does not notice an unknown, and the best point before that."""

from dataclasses import replace
from functools import partial

import numpy as np

from workbench.arrays import Array, Mask
from workbench.solvers.ended import NAMED, Ended, Ending
from workbench.solvers.limits import unwarned
from workbench.solvers.sensitivity import iterate_since
from workbench.solvers.solution import Status


def before_blind(run: Ended, gone: Mask, found: Ending) -> Ending:
    """Return to the best point at which the residual still noticed all unknowns `gone` (n,).

    The iterates from which on it does not are found by bisection. A run without such a point
    stays where it is.
    """
    blind = _Blind(run, gone)
    last = max(len(run.trace) - 1, 1)
    first = iterate_since(lambda k: bool(blind.at(k).any()), last)
    named = np.flatnonzero(gone)[:NAMED]
    since = tuple(iterate_since(partial(blind.one_at, int(i)), last) for i in named)
    names = _with_iterates(run.problem.free.labels_of(np.flatnonzero(gone)), since)
    returned = _returned(run, first)
    message = Status.INSENSITIVE.value.replace("some unknowns", names, 1)
    if returned is not None:
        k, optimality = returned
        message = message.replace("; ", f"; this is the best point before that, iterate {k}; ", 1)
        found = replace(found, optimality=optimality)
    return replace(found, status=Status.INSENSITIVE, message=message)


class _Blind:
    """Which of the lost unknowns the residual does not notice at an iterate."""

    def __init__(self, run: Ended, gone: Mask) -> None:
        self._run, self._gone = run, gone
        self._known: dict[int, Mask] = {}

    def at(self, k: int) -> Mask:
        """Those at iterate k, (n,); all where the residual is not finite."""
        if k not in self._known:
            self._known[k] = self._look(k)
        return self._known[k]

    def one_at(self, i: int, k: int) -> bool:
        """Whether unknown i is one of those at iterate k."""
        return bool(self.at(k)[i])

    def _look(self, k: int) -> Mask:
        run = self._run
        if k >= len(run.trace):
            return self._gone
        x = run.problem.free.pack(run.trace[k].values)
        here = run.problem.linearize_at(x, run.fixed)
        if not here.finite:
            return self._gone
        rounding = run.problem.rounding(x, run.fixed, here.residual)
        blind = run.sensitivity.gone(x, here, run.problem.support, rounding)
        return np.asarray(blind & self._gone)


def _returned(run: Ended, first: int) -> tuple[int, float] | None:
    """Make the best of the iterates before number `first` the best point of the run.

    Returns its number and its optimality; None if there is none that the constraints allow.
    """
    problem, fixed, there = run.problem, run.fixed, run.problem.stacked_constraints
    costs = [iterate.cost for iterate in run.trace[:first]]
    for k in np.argsort(costs, kind="stable"):
        x: Array = problem.free.pack(run.trace[k].values)
        violation = 0.0 if there is None else there.violation(there.values(x, fixed))
        if violation > 1 or not np.isfinite(costs[k]):
            continue
        with unwarned():
            here = problem.linearize_at(x, fixed)
        run.best.x, run.best.cost, run.best.violation = x, here.cost, violation
        return int(k), run.rounding_noise.optimality(x, here)
    return None


def _with_iterates(names: tuple[str, ...], since: tuple[int, ...]) -> str:
    """`a, b (from iterate 3 on), c (from iterate 5 on)`, and how many more there are."""
    by: dict[int, list[str]] = {}
    for name, k in zip(names, since, strict=False):
        by.setdefault(k, []).append(name)
    told = ", ".join(f"{', '.join(some)} (from iterate {k} on)" for k, some in sorted(by.items()))
    more = len(names) - len(since)
    return told + (f" and {more} more" if more else "")
