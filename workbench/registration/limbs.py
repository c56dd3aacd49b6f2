"""Limbs that a fit has folded the wrong way: each begins again from its mean pose.

A fit to a scan goes downhill, and the way from an arm that is folded forwards to one that is folded
backwards leads uphill. The cost knows which of the two is right, so it is enough to begin at both.
"""

from collections.abc import Callable, Sequence

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.fitting.body_priors import pose_gaussian
from workbench.solvers import Solution

SHORTEST = 3  # joints of a limb
GAIN = 0.01  # of the cost, by which another pose of a limb must be better
SWEEPS = 3  # through all limbs, at most: several may be wrong

Solve = Callable[[Values], Solution]


def limbs(parents: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """The joints of every unbranched end of a tree that has three joints or more.

    For SMPL's tree these are the arms from the collar, from the shoulder and from the elbow on, and
    the legs from the hip and from the knee on; for a hand they are the fingers.

    >>> limbs((-1, 0, 1, 2, 3, 0, 5))
    ((1, 2, 3, 4), (2, 3, 4))
    """
    below: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            below[parent].append(joint)
    found = []
    for first in range(1, len(parents)):
        limb = [first]
        while len(below[limb[-1]]) == 1:
            limb += below[limb[-1]]
        if not below[limb[-1]] and len(limb) >= SHORTEST:
            found.append(tuple(limb))
    return tuple(found)


def with_limb_at_mean(body: Body, pose: Array, limb: Sequence[int]) -> Array:
    """The pose (K, 3) rad, in which the joints of a limb have the mean of `pose_prior`."""
    mean, _ = pose_gaussian(body)
    moved = np.array(pose)
    for joint in limb:
        moved[joint] = mean[joint - 1]
    return moved


def other_limbs(body: Body, solve: Solve, values: Values) -> Values | None:
    """Values with another pose of one or more limbs at which the cost is lower; None without any.

    `solve` finds the minimum near given values; it may be that of a coarser problem. Each limb is
    put to its mean pose in turn, and `solve` begins there. The lowest of these minima is taken if
    its cost is lower by more than 1 %; then all limbs are tried again from there.
    """
    pose = body.blocks()[0].name
    first = best = solve(values)
    for _ in range(SWEEPS):
        here = best.values
        starts = (with_limb_at_mean(body, here[pose], limb) for limb in limbs(body.parents))
        ends = [solve({**values, **here, pose: start}) for start in starts]
        lowest = min(ends, key=lambda end: end.cost, default=best)
        if lowest.cost >= (1 - GAIN) * best.cost:
            break
        best = lowest
    return None if best is first else {**values, **best.values}
