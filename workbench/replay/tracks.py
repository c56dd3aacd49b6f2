"""The ways of solvers as a replay shows them: some of their iterates, and numbers along the way."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Index
from workbench.problem import Problem
from workbench.replay.arguments import Row
from workbench.replay.packing import packed
from workbench.solvers import Iterate, Solution
from workbench.threads import limited_threads

MOST = 64  # iterates of a solver that are kept
LARGEST = 500  # unknowns, up to which the condition number is computed at every kept iterate


def kept(count: int, most: int = MOST) -> Index:
    """Which of `count` iterates are kept: the first and the last, and more at the beginning.

    >>> kept(3).tolist(), kept(1000, 5).tolist()
    ([0, 1, 2], [0, 5, 31, 177, 999])
    """
    if count <= most:
        return np.arange(count)
    return np.unique(np.round(np.geomspace(1, count, most) - 1).astype(int))


def tracks(
    solutions: Mapping[str, Solution],
    problem: Problem,
    row: Row,
    start: Mapping[str, Any],
    data: Problem | None = None,
) -> list[dict[str, Any]]:
    """The runs of solvers, by name, on one problem from one start.

    `data` is the same problem without its priors: what the data alone determine at each iterate.
    """
    with limited_threads():
        return [_track(name, one, problem, row, start, data) for name, one in solutions.items()]


def _track(
    name: str,
    solution: Solution,
    problem: Problem,
    row: Row,
    start: Mapping[str, Any],
    data: Problem | None,
) -> dict[str, Any]:
    at = kept(len(solution.trace))
    iterates = [solution.trace[i] for i in at]
    ranks = [] if data is None else _ranks(data, iterates, start)
    return {
        "name": name,
        "status": solution.status.name.lower().replace("_", " "),
        "iterations": solution.iterations,
        "iterates": at.tolist(),
        "x": packed([row(one.values) for one in iterates], "f4"),
        "cost": [float(f"{one.cost:.12g}") for one in iterates],
        "optimality": as_numbers([one.optimality for one in iterates]),
        "damping": as_numbers([one.damping for one in iterates]),
        "condition": as_numbers(list(_conditions(problem, iterates, start))),
        "rank": as_numbers(ranks),
        "unknowns": problem.free.size,
        "seconds": as_numbers([one.seconds for one in iterates]),
        "evaluations": [one.evaluations.total for one in iterates],
    }


def _conditions(
    problem: Problem, iterates: Iterable[Iterate], start: Mapping[str, Any]
) -> Iterable[float]:
    for one in iterates:
        if problem.free.size > LARGEST:
            yield float("nan")
        else:
            s = np.linalg.svd(problem.linearize(dict(start) | one.values).dense, compute_uv=False)
            yield float(s[0] / s[-1]) if s.size and s[-1] > 0 else float("nan")


def _ranks(data: Problem, iterates: Iterable[Iterate], start: Mapping[str, Any]) -> list[float]:
    """How many directions the data alone see at each iterate; NaN where they cannot be asked."""
    if data.free.size > LARGEST:
        return []
    found = []
    for one in iterates:
        here = data.linearize(dict(start) | one.values)
        finite = np.isfinite(here.dense).all()
        found.append(float(here.rank) if finite else float("nan"))
    return found


def as_numbers(array: ArrayLike) -> Any:
    """An array as nested lists of nine digits each, with null where there is no number."""
    numbers = np.asarray(array, dtype=float)
    if numbers.ndim:
        return [as_numbers(one) for one in numbers]
    return float(f"{numbers:.9g}") if np.isfinite(numbers) else None
