"""Why a lost basin was lost: the way from its lowest point to the best one, in named motions."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.comparison.basins import Basin
from workbench.diagnostics.diagnosis import HARDLY, diagnose
from workbench.diagnostics.motions import motions
from workbench.diagnostics.null_space import Direction, directions, dominant
from workbench.problem import Problem

Array = NDArray[np.float64]
THIN = 0.1  # of the median singular value: below, a direction counts as weak here
NAMED = 3  # directions that are told
POINTS = 41  # on the straight line between the two ends
ENOUGH = 0.5  # of the way, for weak directions to explain it


@dataclass(frozen=True)
class Part:
    """How far the way goes along one weak direction."""

    name: str
    length: float  # in units of the unknowns
    change: float  # sigmas per unit


@dataclass(frozen=True)
class Explanation:
    """From a lost end to the best one."""

    cost: float
    best: float
    length: float  # of the way: radians, metres, standard deviations, as the unknowns have them
    share: float  # of its square that lies along weak directions of the lost end, 0 to 1
    parts: tuple[Part, ...]  # the longest, first
    rest: str  # the largest entries of the way
    ridge: float  # how much the cost rises above the lost end on the straight line
    predicted: float  # change of the cost along the whole way, by the linear model at the lost end

    def data(self) -> dict[str, Any]:
        """As JSON."""
        return asdict(self)

    @staticmethod
    def of(data: dict[str, Any]) -> "Explanation":
        """From `data`."""
        return Explanation(**{**data, "parts": tuple(Part(**p) for p in data["parts"])})

    def __str__(self) -> str:
        said = (
            f"It costs {self.cost - self.best:.4g} more than the best end ({self.cost:.6g} against "
            f"{self.best:.6g}), which lies {self.length:.3g} units away. "
        )
        if self.share >= ENOUGH and self.parts:
            named = "; ".join(
                f"{p.name} ({p.length:.2g}, where one unit changes the residuals by "
                f"{p.change:.2g} sigma)"
                for p in self.parts
            )
            said += (
                f"{self.share:.0%} of the way goes along directions that the residuals hardly "
                f"notice at the lost end, so that little held the solver back from sliding there: "
                f"{named}. "
            )
        else:
            said += (
                f"Only {self.share:.0%} of the way goes along directions that are weak at the lost "
                f"end; it is mostly {self.rest}, which the residuals do notice: not a slide, but "
                "another minimum. "
            )
        if self.ridge > 0:
            said += (
                f"On the straight line between them the cost rises by {self.ridge:.3g}: no method "
                "that only goes down comes back that way."
            )
        else:
            said += "On the straight line between them the cost only falls."
        return said


def explain(problem: Problem, fixed: Array, lost: Basin, best: Basin) -> Explanation:
    """Decompose the way on the named directions that are weak at the lost end: of a singular value
    below a tenth of the median one, or below one sigma for a whole unit and a tenth of the largest.
    """
    way = best.x - lost.x
    length = float(np.linalg.norm(way))
    values = problem.free.unpack(lost.x) | problem.fixed.unpack(fixed)
    seen = diagnose(problem, values)
    s = seen.singular_values
    thin = max(THIN * float(np.median(s)), min(HARDLY, THIN * float(s.max(initial=0.0))))
    weak: tuple[Direction, ...] = ()
    if not seen.here.estimated:
        dictionary = motions(problem.free, problem.trees, seen.structure.pattern)
        weak = directions(seen.here, problem.free, dictionary, thin)
    along, parts = _along(way, weak)
    t = np.linspace(0, 1, POINTS)
    costs = [_cost(problem, lost.x + s * way, fixed) for s in t]
    predicted = 0.5 * float(np.sum((lost.residual + seen.here.along(way)) ** 2))
    return Explanation(
        cost=lost.cost,
        best=best.cost,
        length=length,
        share=along,
        parts=parts,
        rest=dominant(way, problem.free) if length > 0 else "nothing",
        ridge=max(0.0, float(np.nanmax(costs)) - lost.cost),
        predicted=predicted - lost.cost,
    )


def _along(way: Array, weak: tuple[Direction, ...]) -> tuple[float, tuple[Part, ...]]:
    """The share of |way|^2 in the span of the directions, and the longest parts of it."""
    if not weak or not way.any():
        return 0.0, ()
    V = np.column_stack([d.vector for d in weak])
    c = np.linalg.lstsq(V, way)[0]
    share = float(np.sum((V @ c) ** 2) / np.sum(way**2))
    order = [int(i) for i in np.argsort(-abs(c), kind="stable")[:NAMED]]
    told = [i for i in order if abs(c[i]) > 0.1 * abs(c[order[0]])]
    return min(1.0, share), tuple(
        Part(weak[i].name, float(abs(c[i])), weak[i].change) for i in told
    )


def _cost(problem: Problem, x: Array, fixed: Array) -> float:
    r = problem.residual(x, fixed)
    return 0.5 * float(r @ r)
