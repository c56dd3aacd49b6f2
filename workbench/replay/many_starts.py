"""Many starts about one, and the ends to which they lead, for a live page."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench.blocks import Values
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.solvers import Solution, Spread, Starts
from workbench.solvers.starts import clusters, further_minima

MOST = 64  # starts
WIDEST = 3.2  # rad: half a turn and a bit
PLACE = 0.3  # m of trans for each rad of pose


def starts_about(
    problem: Problem, start: Values, pose: str, trans: str, spread: float, count: int
) -> list[Values]:
    """`count` starts, the first of which is the given one; the others are drawn about it.

    Rotation vectors are drawn with the standard deviation `spread` in rad, and places with 0.3 m
    for each rad. Raises BadArgument for a count or a spread that is out of range.
    """
    if not 1 < count <= MOST or not 0 < spread <= WIDEST:
        raise BadArgument(
            f"a live page takes 2 to {MOST} starts, spread by up to {WIDEST} rad, not {count} "
            f"spread by {spread}"
        )
    free = set(problem.free.names)
    sigmas = {name: s for name, s in ((pose, spread), (trans, PLACE * spread)) if name in free}
    return Starts(count, draw=Spread(sigmas)).drawn(problem, start)


def basins(problem: Problem, start: Values, ends: Sequence[Solution]) -> list[dict[str, Any]]:
    """Which ends are one minimum: the lowest cost and the numbers of the ends, lowest first."""
    finite = [k for k, end in enumerate(ends) if np.isfinite(end.cost)]
    fixed = problem.split(start)[1]
    points = [problem.free.pack(dict(start) | dict(ends[k].values)) for k in finite]
    groups = [[finite[i] for i in some] for some in clusters(problem, fixed, points)]
    found = []
    for members in groups:
        members.sort(key=lambda k: ends[k].cost)
        cost = float(f"{ends[members[0]].cost:.6g}")
        found.append({"cost": cost, "ends": members})
    return sorted(found, key=lambda one: float(one["cost"]))


def in_words(found: Sequence[Mapping[str, Any]], count: int) -> str:
    """How many starts led to the lowest end, and how sure it is that there is no other minimum."""
    if not found:
        return "no start led to an end with a cost"
    here, others = len(found[0]["ends"]), len(found) - 1
    said = f"{here} of {count} starts led to the lowest cost, {found[0]['cost']:.4g}"
    if not others:
        return f"{said}, and none elsewhere"
    said += f", the others to {others} other end{'s' * (others > 1)}"
    return f"{said}; {further_minima(count, len(found))}"
