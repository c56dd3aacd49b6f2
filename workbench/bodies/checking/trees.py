"""Findings about the tree of joints: its order, its root, and whether it is that of its family."""

from collections.abc import Iterator

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.checking.findings import FileFinding, counted, row_name
from workbench.bodies.checking.model_arrays import ModelArrays
from workbench.bodies.files.joint_names import NAMES, TREES

FAR = 0.15  # of the size of a model, from a joint to where its skin begins; 0.07 is seen
EXCHANGED = 0.03  # by how much two joints together are closer to their skin if they change places
FAR_IN_A_HEAD = 0.4  # the skin that a jaw moves begins far from its joint
REORDER = (
    "Sort the joints so that parents come before their children: the columns of kintree_table and "
    "weights, the rows of J_regressor, and the groups of 9 columns of posedirs, all in one order"
)


ORDERS = (
    "The rows of J_regressor, the columns of weights and the tree are in different orders, or the "
    "vertices are those of another mesh: take all from one file."
)


def about_tree(model: ModelArrays) -> Iterator[FileFinding]:
    """The order of joints in kintree_table, and whether the other arrays have the same order."""
    table = model.table
    if table is None or not table.shape[1]:
        return
    K = table.shape[1]
    numbers = np.arange(K)
    if np.array_equal(table[0], numbers) and not np.array_equal(table[1], numbers):
        yield FileFinding(
            "kintree_table",
            "The rows of kintree_table are swapped: row 0 must be the parents, row 1 the numbers "
            "of the joints. Swap them: kintree_table[::-1].",
        )
        return
    if not np.array_equal(table[1, 1:], numbers[1:]):
        yield FileFinding(
            "kintree_table",
            f"Row 1 of kintree_table must number the joints 0, 1, 2, ..., but begins "
            f"{table[1, :5].tolist()}. {REORDER}; then number them anew.",
        )
        return
    yield from _order(model, table)
    yield from _of_family(model)
    yield from _apart(model)


def _order(model: ModelArrays, table: Index) -> Iterator[FileFinding]:
    K, parents = table.shape[1], table[0]
    outside = [k for k in range(1, K) if not 0 <= parents[k] < K]
    if outside:
        yield FileFinding(
            "kintree_table",
            f"{row_name(model.names, outside[0]).capitalize()} has parent "
            f"{int(parents[outside[0]])}, which is no joint: there are joints 0 to {K - 1}, and "
            "joint 0 alone has no parent. Give it its parent, or leave the joint out.",
        )
        return
    late = [k for k in range(1, K) if parents[k] >= k]
    if late:
        k = late[0]
        circle = "" if _reach_root(parents) else " Some joints are their own ancestors."
        yield FileFinding(
            "kintree_table",
            f"{row_name(model.names, k).capitalize()} has parent {int(parents[k])}, which does not "
            f"come before it.{circle} {REORDER}.",
        )
    if 0 < parents[0] < K:
        yield FileFinding(
            "kintree_table",
            f"Joint 0 has parent {int(parents[0])}, but must be the root, whose parent files write "
            f"as -1 or 4294967295. {REORDER}.",
        )


def _reach_root(parents: Index) -> bool:
    """Whether every joint has the root among its ancestors."""
    at = np.arange(len(parents))
    for _ in range(len(parents)):
        at = np.where(at == 0, 0, parents[at])
    return bool((at == 0).all())


def _of_family(model: ModelArrays) -> Iterator[FileFinding]:
    """A tree of as many joints as a model of the family has, but another one."""
    K, parents = model.n_joints, model.parents
    if parents is None or K not in NAMES or "joint_names" in model.raw:
        return
    name = NAMES[K][0]
    wrong = [k for k in range(K) if parents[k] != TREES[name][k]]
    if wrong:
        k = wrong[0]
        names = model.names
        yield FileFinding(
            "kintree_table",
            f"There are {K} joints as in {name}, but the tree is another one: the parent of "
            f"{row_name(names, k)} is {row_name(names, parents[k])}, and in {name} it is "
            f"{row_name(names, TREES[name][k])}. The names that are shown are {name}'s and may be "
            "wrong. If the joints are in another order, sort them; otherwise add joint_names.",
        )


def _apart(model: ModelArrays) -> Iterator[FileFinding]:
    """Joints that are far from where their skin meets that of their parents."""
    away = joints_away(model)
    if away is None:
        return
    known = model.family in TREES  # in a tree that nobody knows, it may be meant
    own = np.diag(away)
    gains = own[:, None] + own - away - away.T
    i, j = (int(k) for k in np.unravel_index(int(np.nanargmax(gains)), gains.shape))
    if gains[i, j] > EXCHANGED:
        i, j = sorted((i, j))
        yield FileFinding(
            "J_regressor",
            f"{row_name(model.names, i).capitalize()} and {row_name(model.names, j)} would be "
            f"closer to the skin that they move if they changed places. {ORDERS}",
            known,
        )
        return
    far = np.flatnonzero(own > (FAR_IN_A_HEAD if model.family == "FLAME" else FAR))
    if len(far):
        k = int(np.nanargmax(own))
        joints = counted(len(far), "joint is", "joints are")
        yield FileFinding(
            "J_regressor",
            f"Of {len(own)} joints, {joints} far from the skin that they move: "
            f"{row_name(model.names, k)} is {own[k]:.0%} of the size of the model away from where "
            f"its skin begins. {ORDERS}",
            known,
        )


def joints_away(model: ModelArrays) -> Array | None:
    """The distance of each joint from where the skin of each begins, by the model's size: (K, K).

    The skin of a joint begins where it meets its parent's: at the mean of the vertices by the
    product of both weights. NaN in the columns of joints that have no such place; None if no joint
    has one.
    """
    joints, parents, template = model.joints, model.parents, model.template
    if joints is None or parents is None or model.weights is None or template is None:
        return None
    if not model.size > 0:
        return None
    places = np.full((len(parents), 3), np.nan)
    for k in range(1, len(parents)):
        shared = model.weights[:, k] * model.weights[:, parents[k]]
        total = float(shared.sum())
        if total > 0:
            places[k] = shared @ template / total
    away = np.asarray(np.linalg.norm(joints[:, None] - places, axis=2) / model.size)
    return away if np.isfinite(np.diag(away)).any() else None
