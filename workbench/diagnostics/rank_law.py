"""How many directions of a pose observed joints determine, from the kinematic tree alone.

Counting from the leaves to the root, rho_k is the number of directions in which a turn of joint k
can be determined, and U_k the space of small moves of joint k itself that turns of the joints below
it can hide. If all joints are observed, this is 3 for the root's position (where translation is
free), 3 for each joint with several children, 2 for each with one, 0 for a leaf.
"""

from collections.abc import Mapping, Sequence

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Tree
from workbench.blocks.functions import Buffered
from workbench.bodies.forward.sources import BodySource
from workbench.problem import Problem

RANK_TOLERANCE = 1e-9  # of a singular value, bones having length 1


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
            visible = np.eye(3) - hidden[c] @ hidden[c].T  # what c cannot hide
            turns.append(visible @ _cross(e / length))  # of w -> w x e, up to sign
            moves.append(visible / length)
        by_turn = np.vstack([np.zeros((0, 3)), *turns])
        rho = _rank(by_turn)
        rank += rho
        if k in seen:
            continue  # U_k = 0: the joint itself is looked at
        # moves of k that some turn of k can undo at every child
        by_move = np.vstack([np.zeros((0, 3)), *moves])
        column_space = np.linalg.svd(by_turn, full_matrices=False)[0][:, :rho]
        not_undone = by_move - column_space @ (column_space.T @ by_move)
        _, s, Vt = np.linalg.svd(not_undone, full_matrices=True)
        hidden[k] = Vt[int(np.sum(s > RANK_TOLERANCE * max(1.0, s.max(initial=0.0)))) :].T
    return rank + (3 - hidden[0].shape[1] if translation else 0)


def law_of(problem: Problem, at: Mapping[str, ArrayLike]) -> tuple[int, str] | None:
    """The rank that the law predicts for a problem, and why.

    None unless every residual reads the joints of one body, and nothing is free but its pose and
    perhaps its translation.
    """
    observed = _only_joints(problem, at)
    if observed is None:
        return None
    tree, joints, seen = observed
    moving = len(problem.free.names) > 1
    rank = rank_of_observed_joints(tree.parents, joints, seen, translation=moving)
    if len(seen) == len(tree.parents):
        return rank, law_in_words(tree.parents, translation=moving)
    return rank, f"{len(seen)} of {len(tree.parents)} joints are observed"


def _only_joints(
    problem: Problem, at: Mapping[str, ArrayLike]
) -> tuple[Tree, Array, tuple[int, ...]] | None:
    """The tree, the posed joints (K, 3) m and which of them are read, if the law applies."""
    if len(problem.points) != 1:
        return None
    (points,) = problem.points
    tree, free = points.source.tree, problem.free
    if tree is None or not tree.rigid_bones or points.labels != tree.names:
        return None
    if sum(p < 0 for p in tree.parents) != 1:
        return None
    poses = [block for block in free.blocks if block.name in tree.blocks]
    if not len(tree.turned(free)) == len(tree.names) == sum(block.size for block in poses) / 3:
        return None  # the law is of joints that turn freely, each by three numbers of its own
    if any(residual.weights is not None for residual in problem.residuals):
        return None  # a weight of zero hides a joint
    others = [block for block in free.blocks if block.name not in tree.blocks]
    if [block.shape for block in others] not in ([], [(3,)]) or free.parts:
        return None
    if isinstance(points.source, BodySource) and others:
        maps = points.source.arguments.maps
        if maps is None or maps[2].plain != others[0].name:
            return None
    stacked = cs.vertcat(*[residual.expression for residual in problem.residuals])
    if {s.name() for s in cs.symvar(stacked)} & set(free.names):
        return None  # a prior, or a residual of another kind
    by_points = cs.jacobian_sparsity(stacked, points.symbol)
    starts, rows = by_points.get_ccs()
    reads = np.diff(starts).reshape(-1, 3)
    # the law counts whole positions: every coordinate read, each by rows of its own
    if len(set(rows)) != len(rows) or not np.isin(reads, (0, 1)).all():
        return None
    seen = reads.all(axis=1)
    if (reads.any(axis=1) != seen).any():
        return None
    blocks = points.source.blocks
    posed = [cs.densify(points.source.expression)]
    function = Buffered(cs.Function("joints", [block.symbol for block in blocks], posed))
    (joints,) = function(*(np.asarray(at[block.name], dtype=float) for block in blocks))
    return tree, joints.reshape(-1, 3), tuple(np.flatnonzero(seen).tolist())


def law_in_words(parents: Sequence[int], *, translation: bool) -> str:
    """The sum for a tree all of whose joints are observed, spelled out."""
    counts = np.bincount([p for p in parents if p >= 0], minlength=len(parents))
    several, single = int(np.sum(counts > 1)), int(np.sum(counts == 1))
    total = 3 * several + 2 * single + (3 if translation else 0)
    first = "3 for the translation + " if translation else ""
    return (
        f"{first}3 x {several} joints with several children + 2 x {single} with one child, whose "
        f"twist about the bone moves no joint + 0 x {int(np.sum(counts == 0))} leaves = {total}"
    )


def _cross(e: Array) -> Array:
    x, y, z = e
    return np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # w -> w x e


def _rank(A: Array) -> int:
    s = np.linalg.svd(A, compute_uv=False) if A.size else np.zeros(0)
    return int(np.sum(s > RANK_TOLERANCE * max(1.0, float(s.max(initial=0.0)))))
