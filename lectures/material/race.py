"""A race of solvers in the plane of two unknowns, on a clock of effort."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.reports.replay.recording import packed
from workbench.reports.replay.runs import as_numbers
from workbench.reports.replays import ReplayPage, flat_page

SCRIPT = Path(__file__).with_suffix(".js")
GRID = 81  # places along each axis at which the cost is computed
MOST = 200  # iterates of a run
ABOVE = 1e-3  # is added to costs, so that lines of their logarithm end near the minimum
CAPTION = (
    "Drag the effort, or press play: every solver stands where this much work has brought it. The ways lie in "
    "the plane of the unknowns, with lines of equal cost. Beside it: how much of the decrease of the cost is left. "
    "Press a solver to hide it, and choose another problem."
)


@dataclass(frozen=True, eq=False)
class Way:
    """The run of a solver on a problem of two unknowns.

    Attributes:
        x: (k, 2) the iterates.
        effort: (k,) what had been spent at each.
        left: (k,) which share of the decrease of the cost was left.
    """

    x: Array
    effort: Array
    left: Array


@dataclass(frozen=True, eq=False)
class Plane:
    """A problem of two unknowns with the runs of solvers.

    Attributes:
        cost: the cost at many places (n, 2), (n,).
        best: (2,) the minimum.
        ways: the runs by the name of their solver.
    """

    cost: Callable[[Array], Array]
    best: Array
    ways: Mapping[str, Way]


def race_page(planes: Mapping[str, Plane], target: float) -> ReplayPage:
    """The page of a race on each of the problems; `target` is the share at which a run has arrived."""
    problems = [_problem(name, plane, target) for name, plane in planes.items()]
    return flat_page(SCRIPT, {"problems": problems}, CAPTION)


def _problem(name: str, plane: Plane, target: float) -> dict[str, Any]:
    ways = tuple(plane.ways.values())
    every, kept = np.vstack([way.x for way in ways]), np.array([ways[0].x[0], plane.best])
    # what has run away is cut off, but not the start, nor the best end
    low, high = (np.percentile(every, share, axis=0) for share in (4, 96))
    low, high = np.minimum(low, kept.min(axis=0)), np.maximum(high, kept.max(axis=0))
    room = 0.12 * np.maximum(high - low, 0.3)
    low, high = low - room, high + room
    axes = [np.linspace(low[d], high[d], GRID) for d in (0, 1)]
    cost = plane.cost(np.vstack([plane.best, np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)]))
    above = np.log10(cost[1:] - cost.min() + ABOVE)
    lowest, highest = (float(np.percentile(above, share)) for share in (3, 97))
    return {
        "name": name,
        "x": as_numbers([low[0], high[0]]),
        "y": as_numbers([low[1], high[1]]),
        "n": GRID,
        "values": packed(above, "f4"),
        "levels": as_numbers(np.linspace(lowest, highest, 12)),
        "best": as_numbers(plane.best),
        "target": target,
        "runs": [_run(solver, way) for solver, way in plane.ways.items()],
    }


def _run(solver: str, way: Way) -> dict[str, Any]:
    at = np.unique(np.linspace(0, len(way.x) - 1, MOST).astype(int))
    numbers = {"x": way.x, "effort": way.effort, "left": way.left}
    return {"solver": solver} | {key: as_numbers(every[at]) for key, every in numbers.items()}
