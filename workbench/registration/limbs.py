"""Limbs that a fit has folded the wrong way: each begins again from poses that are usual.

The way from an arm that is folded forwards to one that is folded backwards leads uphill. The cost
knows which of the two is right, so it is enough to begin at both.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.fitting.body_priors import pose_gaussian
from workbench.priors.poses import shipped_mixture
from workbench.problem import Problem
from workbench.solvers.solution import Hypothesis, Solution

if TYPE_CHECKING:
    from workbench.registration.model_fit import StageRuns

SHORTEST_LIMB = 3  # joints of a limb
LEAST_GAIN = 0.01  # of the cost, by which another pose of a limb must be better
MOST_SWEEPS = 3  # through all limbs, at most: several may be wrong
STARTS_IN_SWEEP = 12  # starts of a sweep, of those that were compared as they stand
ITERATIONS, SETTLED = 12, 0.01  # of a run that tries another pose of a limb


def limbs(parents: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """The joints of every unbranched end of a tree that has three joints or more.

    For SMPL's tree these are the arms from the collar, from the shoulder and from the elbow on, and
    the legs from the hip and from the knee on; for a hand they are the fingers.
    """
    below: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            below[parent].append(joint)
    ends = []
    for first in range(1, len(parents)):
        limb = [first]
        while len(below[limb[-1]]) == 1:
            limb += below[limb[-1]]
        if not below[limb[-1]] and len(limb) >= SHORTEST_LIMB:
            ends.append(tuple(limb))
    return tuple(ends)


def limb_poses(body: Body) -> tuple[Array, ...]:
    """Poses (K - 1, 3) rad of all joints but the root, at which limbs may begin again.

    They are the mean of `pose_prior` and, for a body with the joints of which it was learned, the
    means of the eight components of `shipped_mixture`: arms that hang, are bent, or are raised.
    """
    mean, mixture = np.reshape(pose_gaussian(body)[0], (-1, 3)), shipped_mixture()
    if tuple(body.joint_names[1:]) != tuple(mixture.joint_names):
        return (mean,)
    return mean, *mixture.means.reshape(-1, len(mean), 3)


def with_limb(pose: Array, limb: Sequence[int], other: Array) -> Array:
    """The pose (K, 3) rad with the joints of a limb as in `other` (K - 1, 3), without the root."""
    moved, joints = np.array(pose), np.array(limb)
    moved[joints] = other[joints - 1]
    return moved


def unfolded(
    body: Body, runs: "StageRuns", screen: Problem, hypothesis: Hypothesis, near: float
) -> Hypothesis:
    """The hypothesis, or a lower one in which one or more limbs have other poses.

    Each limb is put to each of `limb_poses` in turn, and a run begins at the 12 of these whose cost
    is lowest as they stand in `screen`, a coarser problem. A run that comes within `near` m of the
    lowest end so far, in the mean of the joints, is given up. The lowest of their ends is taken if
    its cost is lower by more than 1 %; then all limbs are tried again from there.
    """
    pose, poses = body.blocks()[0].name, limb_poses(body)
    lowest: list[Solution] = []

    def solve(start: Values) -> Solution:
        ends = [joints_of(body, end.values) for end in lowest]
        end = runs.run(hypothesis.starts[0], start, ITERATIONS, SETTLED, ends=ends, near=near)
        lowest[:] = [min([*lowest, end], key=lambda end: end.cost)]
        return end

    def cost(values: Values) -> float:
        rows = screen.residual(*screen.split(values))
        return float(rows @ rows) / 2

    first = best = solve(hypothesis.values)
    for _ in range(MOST_SWEEPS):
        here = {**hypothesis.values, **best.values}
        starts = [
            {**here, pose: with_limb(here[pose], limb, other)}
            for limb in limbs(body.parents)
            for other in poses
        ]
        ends = [solve(start) for start in sorted(starts, key=cost)[:STARTS_IN_SWEEP]]
        end = min(ends, key=lambda end: end.cost, default=best)
        if end.cost >= (1 - LEAST_GAIN) * best.cost:
            break
        best = end
    if best is first:
        return hypothesis
    return Hypothesis(best.values, best.cost, best.status, hypothesis.starts, best.violation)


def joints_of(body: Body, values: Values) -> Array:
    """The joints (K, 3) m of a body whose blocks have these values."""
    return body.joints(*(values[block.name] for block in body.blocks()))
