"""The motions of joints by which null directions of bodies are named, smallest first.

Singular vectors spread one joint's twist over the whole body. Null directions are therefore
searched for in small subspaces that have a name: one entry; one joint; a joint and one below it
that undoes its turn (the twist of a bone, the swivel of an elbow); a joint against a translation; a
limb.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, Index
from workbench.blocks import Layout, Tree

LIMB_TAKES_PART = 0.1  # of the largest entry: joints of a limb that turn less do not name a motion


@dataclass(frozen=True, eq=False)
class JointNullMotion:
    """A subspace of the free numbers with a name: each of its entries may move by itself.

    Attributes:
        kind: `entry`, `twist` or `joint`.
        name: what the motion is called in reports.
        joints: the joints that it turns.
        entries: (q,) the free numbers that it moves.
        tree: the kinematic tree whose joints it turns.
        undone_by: the name of the translation that takes part in it.
    """

    kind: str
    name: str
    joints: tuple[str, ...]
    entries: Index
    tree: Tree | None = None
    undone_by: str = ""

    def called(self, v: Array, free: Layout, least: float) -> tuple[str, tuple[str, ...]]:
        """The name of a direction v (n,), or (T n,) in T frames, and the joints that it turns.

        A limb's motion goes by the joints that turn by at least a tenth of its largest entry; one
        of a joint that another undoes by those that turn by more than `least` of it.
        """
        if self.tree is None:
            return self.name, self.joints
        v = np.linalg.norm(v.reshape(-1, free.size), axis=0)
        tree = self.tree
        least = (LIMB_TAKES_PART if self.kind == "joint" else least) * float(abs(v).max())
        turned = [
            k for k in range(len(tree.names)) if np.linalg.norm(v[tree.entries(k, free)]) > least
        ]
        names = tuple(tree.names[k] for k in turned)
        undone_by = self.undone_by
        if undone_by and np.linalg.norm(v[free.slices[undone_by]]) <= least:
            undone_by = ""
        if self.joints and set(names) == set(self.joints) and undone_by == self.undone_by:
            return self.name, self.joints
        name = _turns(tree, turned)
        if undone_by:
            name = f"{name}, undone by {undone_by}"
        return name, names if self.joints else ()


def joint_motions(free: Layout, trees: Sequence[Tree]) -> Iterator[JointNullMotion]:
    """All motions of joints; those with few entries come first, and single entries of all."""
    moving = [tree for tree in trees if tree.moves(free)]
    turned: dict[int, tuple[str, ...]] = {}
    for tree in moving:
        for k, name in enumerate(tree.names):
            for i in tree.entries(k, free):
                turned[i] = (*turned.get(i, ()), name)
    for i in range(free.size):
        yield _motion("entry", free.label(i), turned.get(i, ()), [i])
    for tree in moving:
        for k, name in enumerate(tree.names):
            if entries := tree.entries(k, free):
                yield _motion("twist", f"a turn of {tree.called(k)} alone", (name,), entries)
    for tree in moving:
        yield from _pairs(free, tree)
    places = [b for b in free.blocks if b.shape == (3,) and (b.whole is None or b.unit == "m")]
    places = [b for b in places if all(b.name not in tree.blocks for tree in moving)]
    for tree in moving:
        for block in places:
            part = free.slices[block.name]
            for k, name in enumerate(tree.names):
                if turn := tree.entries(k, free):
                    motion = f"a turn of {tree.called(k)}, undone by {block.name}"
                    yield _motion(
                        "twist",
                        motion,
                        (name,),
                        [*turn, *range(part.start, part.stop)],
                        tree,
                        block.name,
                    )
    for tree in moving:
        yield from _limbs(free, tree)


def _motion(
    kind: str,
    name: str,
    joints: tuple[str, ...],
    entries: Sequence[int],
    tree: Tree | None = None,
    undone_by: str = "",
) -> JointNullMotion:
    places: NDArray[np.int64] = np.array(entries, dtype=np.int64)
    return JointNullMotion(kind, name, joints, places, tree, undone_by)


def _pairs(free: Layout, tree: Tree) -> Iterator[JointNullMotion]:
    """A joint turns, and one below it turns back: nearest relatives first."""
    related = []
    for k in range(len(tree.parents)):
        above, distance = tree.parents[k], 1
        while above >= 0:
            related.append((distance, above, k))
            above, distance = tree.parents[above], distance + 1
    for _, above, k in sorted(related):
        names = tree.names[above], tree.names[k]
        turn, back = tree.entries(above, free), tree.entries(k, free)
        if turn and back:
            name = f"a turn of {tree.called(above)}, undone at {names[1]}"
            yield _motion("twist", name, names, turn + back, tree)


def _limbs(free: Layout, tree: Tree) -> Iterator[JointNullMotion]:
    """Turns of a joint and of all joints below it, small limbs first, the whole tree last."""
    K = len(tree.parents)
    below: list[list[int]] = [[k] for k in range(K)]
    for k in range(K - 1, 0, -1):
        if tree.parents[k] >= 0:  # a sequence has a root in every frame
            below[tree.parents[k]] += below[k]
    for k in sorted(range(K), key=lambda k: len(below[k])):
        entries = [e for j in sorted(below[k]) for e in tree.entries(j, free)]
        if len(entries) > 6:
            yield _motion("joint", f"turns from {tree.names[k]} down", (), entries, tree)


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
    above = {joint}
    while (joint := tree.parents[joint]) >= 0:
        above.add(joint)
    return above
