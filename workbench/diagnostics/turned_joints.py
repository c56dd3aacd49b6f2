"""Names of motions by the joints that really move.

A direction that is found among all turns of a limb may move little of the limb: one that turns a
hand, and the collar by a hundredth as much, is called a turn of the hand.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.blocks import Layout, Tree
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.problem import Linearization

MOVES = 0.1  # of the largest entry: a motion is not named by joints of a limb that turn less
TAKES_PART = 1e-6  # of the largest entry: less is rounding
AS_LITTLE = 1.5  # times the change of the residuals along the whole direction


def named_by_joints(
    motion: NamedSubspace, v: Array, here: Linearization, free: Layout, limit: float
) -> tuple[str, tuple[str, ...]]:
    """The name of a direction v (n,) that was found as this motion, and the joints that it turns.

    A limb's motion goes by the joints that turn by at least a tenth of its largest entry. One of a
    joint that another undoes keeps both names, however little one of them turns, unless the larger
    turn alone changes the residuals by no more than `limit` per unit.
    """
    tree = motion.tree
    if tree is None:
        return motion.name, motion.joints
    joints, most = [tree.entries(k, free) for k in range(len(tree.names))], float(np.abs(v).max())
    angles = np.array([np.linalg.norm(v[entries]) for entries in joints])
    undone = motion.undone_by
    if motion.kind == "joint":
        turned = np.flatnonzero(angles > MOVES * most)
        if undone and np.linalg.norm(v[free.slices[undone]]) <= MOVES * most:
            undone = ""
    else:
        turned = _needed(v, joints, angles, here, limit)
    names = tuple(tree.names[k] for k in turned)
    if motion.joints and set(names) == set(motion.joints):
        return motion.name, motion.joints
    name = _turns(tree, [int(k) for k in turned])
    turns = names if motion.joints else ()
    return f"{name}, undone by {undone}" if undone else name, turns


def _needed(
    v: Array, joints: Sequence[list[int]], angles: Array, here: Linearization, limit: float
) -> NDArray[np.signedinteger]:
    """The fewest joints, the largest turns first, that are noticed as little as all of v is."""
    order = np.argsort(-angles, kind="stable")
    order = order[angles[order] > TAKES_PART * np.abs(v).max()]
    limit = max(limit, AS_LITTLE * float(np.linalg.norm(here.along(v))))
    for count in range(1, order.size):
        w, others = v.copy(), np.setdiff1d(np.arange(angles.size), order[:count])
        w[[entry for k in others for entry in joints[k]]] = 0.0
        if np.linalg.norm(here.along(w)) <= limit * np.linalg.norm(w):
            return np.sort(order[:count])
    return np.sort(order)


def _turns(tree: Tree, joints: list[int]) -> str:
    """`a turn of pose[left_hand]`, `turns from left_wrist down` or `turns below spine3`."""
    if len(joints) == 1:
        return f"a turn of {tree.called(joints[0])}"
    if not joints:
        return "turns"
    shared = set.intersection(*(_ancestry(tree, k) for k in joints))
    if not shared:  # joints of several frames
        more = ", ..." if len(joints) > 2 else ""
        return f"turns of {' and '.join(tree.called(k) for k in joints[:2])}{more}"
    top = max(shared)  # parents come first
    name = tree.names[top]
    return f"turns from {name} down" if top in joints else f"turns below {name}"


def _ancestry(tree: Tree, joint: int) -> set[int]:
    """The joint and all above it."""
    found = {joint}
    while (joint := tree.parents[joint]) >= 0:
        found.add(joint)
    return found
