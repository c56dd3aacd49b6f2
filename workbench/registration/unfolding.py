"""An end of a fit to a scan from which limbs begin again in other poses."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.problem import Problem
from workbench.registration.fit_stage import StageRuns
from workbench.registration.limbs import limb_poses, other_limbs
from workbench.solvers.solution import Hypothesis, Solution

ITERATIONS, SETTLED = 12, 0.01  # of a run that tries another pose of a limb


@dataclass(frozen=True, eq=False)
class Known:
    """Ends that were found, to which another run need not lead.

    Attributes:
        body: the body.
        near: in m, the mean distance of joints from an end, within which a run leads to it.
        ends: the joints (K, 3) m of each end.
    """

    body: Body
    near: float
    ends: list[Array] = field(default_factory=list)

    def add(self, values: Values) -> None:
        """Remember the body with these values as an end that was found."""
        self.ends.append(joints_of(self.body, values))

    def knows(self, values: Values) -> bool:
        """Whether the joints at these values are within `near` of an end, in the mean."""
        if not self.ends:
            return False
        off = np.linalg.norm(np.array(self.ends) - joints_of(self.body, values), axis=-1)
        return bool((off.mean(axis=1) < self.near).any())


def unfolded(
    body: Body, runs: StageRuns, screen: Problem, one: Hypothesis, near: float
) -> Hypothesis:
    """The hypothesis, or a lower one in which limbs have other poses.

    `screen` is a coarser problem, which says at which poses of limbs it is worth to begin. A run
    that comes within `near` m of the lowest end so far, in the mean of the joints, is given up.
    """
    lowest: list[Solution] = []

    def solve(start: Values) -> Solution:
        known = Known(body, near)
        for end in lowest:
            known.add(end.values)
        end = runs.run(one.starts[0], start, ITERATIONS, SETTLED, known=known.knows)
        lowest[:] = [min([*lowest, end], key=lambda one: one.cost)]
        return end

    end = other_limbs(body, solve, one.values, poses=limb_poses(body), cost=_cost(screen))
    if end is None:
        return one
    return Hypothesis(end.values, end.cost, end.status, one.starts, end.violation)


def joints_of(body: Body, values: Values) -> Array:
    """The joints (K, 3) m of a body whose blocks have these values."""
    return body.joints(*(values[block.name] for block in body.blocks()))


def _cost(screen: Problem) -> Callable[[Values], float]:
    """The cost of values as they stand."""

    def cost(values: Values) -> float:
        rows = screen.residual(*screen.split(values))
        return float(rows @ rows) / 2

    return cost
