"""The dictionary of motions that a null direction may turn out to be, smallest first.

A null space has no basis of its own: singular vectors smear one joint's twist over the whole body.
So it is looked for in small subspaces that have a name: one entry; one joint; a joint and one of
those below it, that undoes what it did (the twist of a bone, the swivel of an elbow); a joint
against a translation; a uniform shift of many points against another (a gauge); two blocks; a
limb; a block.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Tree

MANY = 400  # entries of a subspace that is searched as a whole


@dataclass(frozen=True, eq=False)
class NamedSubspace:
    """A subspace of the free numbers with a name: the columns of `basis` at the rows `entries`.

    Attributes:
        kind: `entry`, `twist`, `joint`, `shift` or `block`.
        name: what the motion is called in reports.
        joints: the joints that it turns.
        entries: (q,) the free numbers that it moves.
        basis: (q, p) orthonormal; None where every one of the entries may move by itself.
        tree: the kinematic tree whose joints it turns.
        undone_by: the name of the translation that takes part in it.
    """

    kind: str
    name: str
    joints: tuple[str, ...]
    entries: Index
    basis: Array | None = None
    tree: Tree | None = None
    undone_by: str = ""


def named_subspaces(
    free: Layout, trees: Sequence[Tree], pattern: csc_array | None = None
) -> Iterator[NamedSubspace]:
    """All of them, those that need few entries first.

    The `pattern` (m, n) of the Jacobian, where it is given, tells which points hang together.
    """
    moving = [tree for tree in trees if tree.moves(free)]
    turned = _joints_of(free, moving)
    for i in range(free.size):
        yield _free("entry", free.label(i), turned.get(i, ()), [i])
    for tree in moving:
        yield from _single_joints(free, tree)
    for tree in moving:
        yield from _pairs(free, tree)
    poses = {name for tree in moving for name in tree.blocks}
    others = [block for block in free.blocks if block.name not in poses]
    if pattern is not None:
        yield from _islands(free, others, pattern)
    yield from _shifts(free, others)
    yield from _against_translations(free, moving, others)
    for block in others:
        if 1 < block.size <= MANY:
            part = free.slices[block.name]
            yield _free("block", f"within {block.name}", (), range(part.start, part.stop))
    yield from _two_blocks(free, others)
    for tree in moving:
        yield from _limbs(free, tree)
    for tree in moving:
        yield from _limbs_against_translations(free, tree, others)


def _free(kind: str, name: str, joints: tuple[str, ...], entries: Sequence[int]) -> NamedSubspace:
    return NamedSubspace(kind, name, joints, np.array(entries, dtype=np.int64))


def _joints_of(free: Layout, moving: Sequence[Tree]) -> dict[int, tuple[str, ...]]:
    """The joints that a free number turns, by its place."""
    found: dict[int, tuple[str, ...]] = {}
    for tree in moving:
        for k, name in enumerate(tree.names):
            for i in tree.entries(k, free):
                found[i] = (*found.get(i, ()), name)
    return found


def _single_joints(free: Layout, tree: Tree) -> Iterator[NamedSubspace]:
    for k, name in enumerate(tree.names):
        if entries := tree.entries(k, free):
            yield _free("twist", f"a turn of {tree.called(k)} alone", (name,), entries)


def _pairs(free: Layout, tree: Tree) -> Iterator[NamedSubspace]:
    """A joint turns, and one below it turns back: nearest relatives first."""
    related = []
    for k in range(len(tree.parents)):
        above, apart = tree.parents[k], 1
        while above >= 0:
            related.append((apart, above, k))
            above, apart = tree.parents[above], apart + 1
    for _, above, k in sorted(related):
        names = tree.names[above], tree.names[k]
        turn, back = tree.entries(above, free), tree.entries(k, free)
        if turn and back:
            said = f"a turn of {tree.called(above)}, undone at {names[1]}"
            yield replace(_free("twist", said, names, turn + back), tree=tree)


def _islands(free: Layout, blocks: Sequence[Block], pattern: csc_array) -> Iterator[NamedSubspace]:
    """Rows of a block of points that residuals tie to each other, but not to its other rows."""
    for block in blocks:
        found = _uniform(free, block)
        if found is None or block.size < 9:
            continue
        entries = found[0].reshape(-1, 3)
        m, count = pattern.shape[0], len(entries)
        read = pattern[:, free.slices[block.name]].tocoo()
        ties = coo_array(
            (np.ones(read.nnz, dtype=np.int8), (read.row, m + read.col // 3)),
            shape=(m + count, m + count),
        )
        label = connected_components(ties, directed=False)[1][m:]
        order = np.argsort(label, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(label[order])) + 1):
            if 1 < rows.size < count:
                basis = np.tile(np.eye(3), (rows.size, 1)) / np.sqrt(rows.size)
                said = ", ".join(_row(block, int(row)) for row in rows[:3])
                name = (
                    f"a shift of {rows.size} rows of {block.name} "
                    f"({said}{', ...' if rows.size > 3 else ''})"
                )
                yield NamedSubspace("shift", name, (), entries[rows].ravel(), basis)


def _row(block: Block, row: int) -> str:
    return block.labels[row] if block.labels else str(row)


def _shifts(free: Layout, blocks: Sequence[Block]) -> Iterator[NamedSubspace]:
    """All rows of a block move by the same, alone or against another block's."""
    moved = [(block, _uniform(free, block)) for block in blocks]
    in_space = [(block, found) for block, found in moved if found is not None]
    for block, (entries, basis) in in_space:
        if block.size > 3:
            yield NamedSubspace("shift", f"a shift of all of {block.name}", (), entries, basis)
    for i, (a, (at_a, by_a)) in enumerate(in_space):
        for b, (at_b, by_b) in in_space[i + 1 :]:
            basis = np.zeros((at_a.size + at_b.size, 6))
            basis[: at_a.size, :3], basis[at_a.size :, 3:] = by_a, by_b
            name = f"a shift of {a.name}, undone by {b.name}"
            yield NamedSubspace("shift", name, (), np.concatenate([at_a, at_b]), basis)


def _uniform(free: Layout, block: Block) -> tuple[Index, Array] | None:
    """The three shifts of a block of points in space; None for any other block."""
    if not block.shape or block.shape[-1] != 3 or block.unit != "m":
        return None
    part = free.slices[block.name]
    entries = np.arange(part.start, part.stop)
    return entries, np.tile(np.eye(3), (block.size // 3, 1)) / np.sqrt(block.size / 3)


def _against_translations(
    free: Layout, moving: Sequence[Tree], blocks: Sequence[Block]
) -> Iterator[NamedSubspace]:
    for tree in moving:
        for block, moves in _translations(free, blocks):
            for k, name in enumerate(tree.names):
                if turn := tree.entries(k, free):
                    said = f"a turn of {tree.called(k)}, undone by {block.name}"
                    motion = _free("twist", said, (name,), [*turn, *moves])
                    yield replace(motion, tree=tree, undone_by=block.name)


def _two_blocks(free: Layout, blocks: Sequence[Block]) -> Iterator[NamedSubspace]:
    for i, a in enumerate(blocks):
        for b in blocks[i + 1 :]:
            if a.size + b.size <= MANY:
                parts = free.slices[a.name], free.slices[b.name]
                entries = [e for part in parts for e in range(part.start, part.stop)]
                yield _free("block", f"{a.name} against {b.name}", (), entries)


def _limbs(free: Layout, tree: Tree) -> Iterator[NamedSubspace]:
    """A joint and all below it, small limbs first; at last the whole tree."""
    K = len(tree.parents)
    below: list[list[int]] = [[k] for k in range(K)]
    for k in range(K - 1, 0, -1):
        if tree.parents[k] >= 0:  # a sequence has a root in every frame
            below[tree.parents[k]] += below[k]
    for k in sorted(range(K), key=lambda k: len(below[k])):
        entries = [e for j in sorted(below[k]) for e in tree.entries(j, free)]
        if len(entries) > 6:
            said = f"turns from {tree.names[k]} down"
            yield replace(_free("joint", said, (), entries), tree=tree)


def _limbs_against_translations(
    free: Layout, tree: Tree, blocks: Sequence[Block]
) -> Iterator[NamedSubspace]:
    """The root moves, and turns of the joints near it undo that at all that is looked at."""
    depth = [0] * len(tree.parents)
    for k, parent in enumerate(tree.parents[1:], start=1):
        depth[k] = depth[parent] + 1 if parent >= 0 else 0
    for block, moves in _translations(free, blocks):
        for most in range(1, max(depth) + 1):
            near = [e for k, d in enumerate(depth) if d <= most for e in tree.entries(k, free)]
            if not near:
                continue
            name = f"turns near {tree.names[0]}, undone by {block.name}"
            motion = _free("joint", name, (), [*near, *moves])
            yield replace(motion, tree=tree, undone_by=block.name)


def _translations(free: Layout, blocks: Sequence[Block]) -> Iterator[tuple[Block, list[int]]]:
    """Blocks of three numbers, and their entries."""
    for block in blocks:
        if block.shape == (3,) and (block.whole is None or block.unit == "m"):
            part = free.slices[block.name]
            yield block, list(range(part.start, part.stop))
