"""A race of solvers in the plane of two unknowns, on a clock of effort."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.replay.packing import packed
from workbench.reports.flat_page import flat_page
from workbench.reports.replay_page import ReplayPage

SCRIPT = Path(__file__).with_suffix(".js")
GRID = 81  # places along each axis at which the cost is computed
MOST = 200  # iterates of a run
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

    cost: Any
    best: Array
    ways: Mapping[str, Way]


def race_page(planes: Mapping[str, Plane], target: float) -> ReplayPage:
    """The page of a race on each of the problems; `target` is the share at which a run has arrived."""
    problems = [_problem(name, plane, target) for name, plane in planes.items()]
    return flat_page(SCRIPT, {"problems": problems}, CAPTION)


def _problem(name: str, plane: Plane, target: float) -> dict[str, Any]:
    every = np.vstack([plane.best, *(way.x for way in plane.ways.values())])
    low, high = (
        np.percentile(every, share, axis=0) for share in (4, 96)
    )  # what has run away is cut
    start = next(iter(plane.ways.values())).x[0]
    low, high = (
        np.minimum.reduce([low, start, plane.best]),
        np.maximum.reduce([high, start, plane.best]),
    )
    room = 0.12 * np.maximum(high - low, 0.3)
    low, high = low - room, high + room
    axes = np.linspace(low, high, GRID).T
    places = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    cost = np.asarray(plane.cost(places))
    above = np.log10(
        cost - min(cost.min(), float(np.ravel(plane.cost(plane.best[None]))[0])) + 1e-3
    )
    return {
        "name": name,
        "x": [low[0], high[0]],
        "y": [low[1], high[1]],
        "n": GRID,
        "values": packed(above, "f4"),
        "levels": np.linspace(*np.percentile(above, (3, 97)), 12).tolist(),
        "best": plane.best.tolist(),
        "target": target,
        "runs": [_run(solver, way) for solver, way in plane.ways.items()],
    }


def _run(solver: str, way: Way) -> dict[str, Any]:
    at = np.unique(np.linspace(0, len(way.x) - 1, MOST).astype(int))
    return {
        "solver": solver,
        "x": _digits(way.x[at]),
        "effort": _digits(way.effort[at]),
        "left": _digits(way.left[at]),
    }


def _digits(array: Array | Sequence[float]) -> Any:
    if np.ndim(array):
        return [_digits(one) for one in np.asarray(array)]
    return float(f"{float(np.asarray(array)):.6g}")
