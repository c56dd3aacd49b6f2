"""Directions that the data do not determine, and draws from a posterior, for a replay."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.diagnostics import Diagnosis, Direction
from workbench.replay.arguments import Row
from workbench.replay.packing import packed

MOST = 40  # directions
UNSEEN = 0.5  # units along a direction that nothing holds
FARTHEST = 1.0  # units: two sigmas may be far out of the linear world
STEPS = 21  # at which the true change of the data is computed, from one end to the other
LEAST = 1e-3  # m: a direction that moves no point of the body by this much is not shown
DRAWS = 40

Surface = Callable[[Array], Array]


def reach_along(direction: Direction, tolerance: float) -> float:
    """How far a body is moved along a direction, in its units: two standard deviations, or less.

    A direction whose change is at most the `tolerance` is not seen, and has no standard deviation.
    """
    if direction.change <= tolerance:
        return UNSEEN
    return min(2 / direction.change, FARTHEST)


def moves(diagnosis: Diagnosis, row: Row, surface: Surface) -> list[dict[str, Any]]:
    """Null and weak directions of a diagnosis that move the body, the unseen ones first.

    `surface` takes the body's numbers to its vertices (N, 3) m.
    """
    unseen = ((one, "not seen by the data") for one in diagnosis.null_directions)
    weak = ((one, "hardly seen by the data") for one in diagnosis.weak_directions)
    return list(_moves(diagnosis, row, surface, (*unseen, *weak)))


def _moves(
    d: Diagnosis, row: Row, surface: Surface, directions: Iterable[tuple[Direction, str]]
) -> Iterable[dict[str, Any]]:
    x, fixed = d.problem.split(d.values)
    residual, known = d.problem.residual(x, fixed), row(d.values)
    here, found = surface(known), 0
    for one, kind in directions:
        step = row(d.free.unpack(x + one.vector, d.values)) - known
        reach = reach_along(one, d.tolerance)
        away = np.linalg.norm(surface(known + reach * step) - here, axis=1).max()
        if found == MOST or away < LEAST:
            continue
        found += 1
        exact = [
            float(np.linalg.norm(d.problem.residual(x + s * one.vector, fixed) - residual))
            for s in reach * np.linspace(-1, 1, STEPS)
        ]
        yield {
            "name": one.name,
            "kind": kind,
            "change": float(f"{one.change:.3g}"),
            "reach": reach,
            "step": packed(step, "f8"),
            "exact": [float(f"{number:.4g}") for number in exact],
        }


def gaussian_draws(
    diagnosis: Diagnosis, row: Row, count: int = DRAWS, seed: int = 0
) -> list[Array]:
    """Rows of numbers drawn from N(x, (J'J)^-1) about the solution; none where J'J is singular."""
    d = diagnosis
    if d.rank < d.shape[1]:
        return []
    x = d.free.pack(d.values)
    root = np.linalg.cholesky(d.here.covariance)
    z = np.random.default_rng(seed).standard_normal((count, len(x)))
    return [row(d.free.unpack(x + root @ one, d.values)) for one in z]
