"""Why a run ended in another basin: the way from there to the best end, in named motions."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.blocks.directions import in_units
from workbench.comparison.basins import Basin
from workbench.diagnostics import Diagnosis, diagnose_whole
from workbench.diagnostics.null_space import WEAK, Direction, named_by_joints
from workbench.problem import Problem
from workbench.problem.rounding import half_squared
from workbench.reading.facts import facts

THIN = 0.1  # of the median singular value: below, a direction counts as weak here
NAMED = 3  # directions that are told
SMALL = 0.1  # of the way: what goes less far along a direction is not worth its name
POINTS = 41  # on the straight line between the two ends
ENOUGH = 0.5  # of the way, for weak directions to explain it


@dataclass(frozen=True)
class Component:
    """How far the way goes along one weak direction.

    Attributes:
        name: the name of the direction.
        length: how far the way goes along it, in units of the unknowns.
        change: how many sigmas the residuals change per unit.
    """

    name: str
    length: float
    change: float


@dataclass(frozen=True)
class Explanation:
    """The straight way from a lost end to the best one.

    Attributes:
        cost: the cost at the lost end.
        best: the cost at the best end.
        length: the length of the way, in the units of the unknowns: radians, metres, standard
            deviations.
        share: the share of its square that lies along weak directions of the lost end, 0 to 1.
        components: the longest parts along named weak directions, the longest first.
        rest: the largest entries of the way, in words.
        ridge: by how much the cost rises above that of the lost end on the way.
    """

    cost: float
    best: float
    length: float
    share: float
    components: tuple[Component, ...]
    rest: str
    ridge: float

    def data(self) -> dict[str, Any]:
        """The explanation as data for JSON."""
        return asdict(self)

    @staticmethod
    def of(given: object, name: str) -> "Explanation":
        """From `data`; raises BadFile, saying `name`, if it is something else."""
        told = facts(given, name)
        return Explanation(
            cost=told.number("cost"),
            best=told.number("best"),
            length=told.number("length"),
            share=told.number("share"),
            components=told.several("components", _component),
            rest=told.text("rest"),
            ridge=told.number("ridge"),
        )

    def __str__(self) -> str:
        said = (
            f"It costs {self.cost - self.best:.4g} more than the best end ({self.cost:.6g} against "
            f"{self.best:.6g}). "
        )
        way = f"{self.share:.0%} of the way from here to there ({self.length:.3g} units)"
        if self.share >= ENOUGH and self.components:
            named = "; ".join(
                f"{p.name.partition(': ')[0]} ({p.length:.2g} units, {p.change:.2g} sigma per unit)"
                for p in self.components
            )
            said += (
                f"{way} goes along weak directions, so the data did little to keep a solver from "
                f"sliding here; the largest parts are {named}. "
            )
        else:
            said += (
                f"Only {way} goes along weak directions; it is mostly {self.rest}, which the data "
                "determine: this is another minimum, and not a slide. "
            )
        if self.ridge > 0:
            return said + (
                f"On the straight line between them the cost rises by {self.ridge:.3g}: a solver "
                "that only goes downhill does not return along it."
            )
        return said + "On the straight line between them the cost only falls."


def _component(given: object, name: str) -> Component:
    told = facts(given, name)
    return Component(told.text("name"), told.number("length"), told.number("change"))


def explain(
    problem: Problem, fixed: Array, lost: Basin, best: Basin, priors: tuple[str, ...] = ()
) -> Explanation:
    """Decompose the way from the lost end to the best one into directions with names.

    They are the directions that are weak at the lost end, without the residuals that are priors: a
    singular value is weak if it is below a tenth of the median one, or below one sigma for a whole
    unit and below a tenth of the largest.
    """
    way = best.x - lost.x
    length = float(np.linalg.norm(way))
    values = problem.values(lost.x, fixed)
    data = problem.without(*priors) if 0 < len(priors) < len(problem.residuals) else problem
    seen = diagnose_whole(data, values)
    along, components = _along(way, _weak(seen, data, problem))
    between = [lost.x + s * way for s in np.linspace(0, 1, POINTS)]
    costs = [half_squared(problem.residual(x, fixed)) for x in between]
    return Explanation(
        cost=lost.cost,
        best=best.cost,
        length=length,
        share=along,
        components=components,
        rest=in_units(way, problem.free) if length > 0 else "nothing",
        ridge=max(0.0, float(np.nanmax(costs)) - lost.cost),
    )


def _weak(seen: Diagnosis, data: Problem, whole: Problem) -> tuple[Direction, ...]:
    """The weak directions of the data, as vectors of all free numbers."""
    if seen.here.estimated or not seen.here.finite:
        return ()
    s = seen.here.spectrum.s
    thin = max(THIN * float(np.median(s)), min(WEAK, THIN * float(s.max(initial=0.0))))
    least = max(thin, seen.here.spectrum.tolerance)
    null = seen.here.spectrum.Vt[int(np.sum(s > least)) :].T
    found = list(named_by_joints(null, data.free, data.trees, seen.here))
    for k, direction in enumerate(found):
        vector = np.zeros(whole.free.size)
        for name in data.free.names:
            vector[whole.free.slices[name]] = direction.vector[data.free.slices[name]]
        found[k] = replace(direction, vector=vector)
    return tuple(found)


def _along(way: Array, weak: tuple[Direction, ...]) -> tuple[float, tuple[Component, ...]]:
    """The share of |way|^2 in the span of the directions, and the few that make most of it.

    Named directions are not orthogonal: all of them together would tell of large moves that
    cancel. So they are taken one by one, each time the one that is nearest to what is left.
    """
    if not weak or not way.any():
        return 0.0, ()
    V = np.column_stack([d.vector for d in weak])
    within = V @ np.linalg.lstsq(V, way)[0]
    share = float(np.sum(within**2) / np.sum(way**2))
    chosen: list[int] = []
    c: Array = np.zeros(0)
    left: Array = within
    while len(chosen) < min(NAMED, len(weak)):
        nearness = abs(V.T @ left)
        nearness[chosen] = 0
        if nearness.max() <= SMALL * np.linalg.norm(way):
            break
        chosen.append(int(np.argmax(nearness)))
        c = np.asarray(np.linalg.lstsq(V[:, chosen], within)[0], dtype=float)
        left = within - V[:, chosen] @ c
    components = [
        Component(weak[i].name, float(abs(x)), weak[i].change)
        for i, x in zip(chosen, c, strict=True)
    ]
    return min(1.0, share), tuple(sorted(components, key=lambda part: -part.length))
