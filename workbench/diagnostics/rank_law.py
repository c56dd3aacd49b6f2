"""How many directions of a pose observed joints determine, from the kinematic tree alone.

An observed joint moves when a joint above it turns. Counting from the leaves to the root, rho_k is
the number of directions in which a turn of joint k can be determined, and U_k the space of small
moves of joint k itself that turns of the joints below it can hide. If all joints are observed, this
is 3 for the root's position (where translation is free), 3 for each joint with several children, 2
for each joint with one (its twist about the bone is hidden), 0 for a leaf.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.diagnostics.structure import only_joints
from workbench.problem import Problem

SMALL = 1e-9  # of a singular value, bones having length 1


def rank_of_observed_joints(
    parents: Sequence[int], joints: Array, observed: Sequence[int], *, translation: bool
) -> int:
    """Rank of the positions of the `observed` joints by all rotations (and the translation).

    `joints` (K, 3) are the posed positions; parents[k] < k. Any pose, any subset.
    """
    K = len(parents)
    seen = set(observed)
    below = [k in seen for k in range(K)]  # whether anything observed hangs on k
    for k in range(K - 1, 0, -1):
        below[parents[k]] = below[parents[k]] or below[k]
    if not below[0]:
        return 0
    children = [[c for c in range(k + 1, K) if parents[c] == k and below[c]] for k in range(K)]
    hidden: list[Array] = [np.zeros((3, 0))] * K  # a basis of U_k
    rank = 0
    for k in range(K - 1, -1, -1):
        if not below[k]:
            continue
        turns, moves = [], []  # of each child: what a turn of k, and a move of k, do to it
        for c in children[k]:
            e = joints[c] - joints[k]
            length = float(np.linalg.norm(e)) or 1.0
            left = np.eye(3) - hidden[c] @ hidden[c].T  # what c cannot hide
            turns.append(left @ _cross(e / length))  # of w -> w x e, up to sign
            moves.append(left / length)
        by_turn = np.vstack([np.zeros((0, 3)), *turns])
        rho = _rank(by_turn)
        rank += rho
        if k in seen:
            continue  # U_k = 0: the joint itself is looked at
        # moves of k that some turn of k can undo at every child
        by_move = np.vstack([np.zeros((0, 3)), *moves])
        column_space = np.linalg.svd(by_turn, full_matrices=False)[0][:, :rho]
        remains = by_move - column_space @ (column_space.T @ by_move)
        _, s, Vt = np.linalg.svd(remains, full_matrices=True)
        hidden[k] = Vt[int(np.sum(s > SMALL * max(1.0, s.max(initial=0.0)))) :].T
    return rank + (3 - hidden[0].shape[1] if translation else 0)


def law_of(problem: Problem, at: Mapping[str, ArrayLike]) -> tuple[int, str] | None:
    """The rank that the law predicts for a problem, and why; None if the law does not apply.

    The law applies if every residual reads the joints of one body, and nothing is free but its pose
    and perhaps its translation.
    """
    found = only_joints(problem, at)
    if found is None:
        return None
    tree, joints, seen = found
    moving = len(problem.free.names) > 1
    rank = rank_of_observed_joints(tree.parents, joints, seen, translation=moving)
    if len(seen) == len(tree.parents):
        return rank, law_in_words(tree.parents, translation=moving)
    return rank, f"{len(seen)} of {len(tree.parents)} joints are observed"


def law_in_words(parents: Sequence[int], *, translation: bool) -> str:
    """The sum for a tree all of whose joints are observed, spelled out."""
    counts = np.bincount([p for p in parents if p >= 0], minlength=len(parents))
    several, one = int(np.sum(counts > 1)), int(np.sum(counts == 1))
    total = 3 * several + 2 * one + (3 if translation else 0)
    first = "3 for the translation + " if translation else ""
    return (
        f"{first}3 x {several} joints with several children + 2 x {one} with one child, whose "
        f"twist about the bone moves no joint + 0 x {int(np.sum(counts == 0))} leaves = {total}"
    )


def _cross(e: Array) -> Array:
    x, y, z = e
    return np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # w -> w x e


def _rank(A: Array) -> int:
    s = np.linalg.svd(A, compute_uv=False) if A.size else np.zeros(0)
    return int(np.sum(s > SMALL * max(1.0, float(s.max(initial=0.0)))))
