"""The dictionary of motions by which null directions are named, smallest first.

A null space has no basis of its own: singular vectors spread one joint's twist over the whole body.
Null directions are therefore searched for in small subspaces that have a name: one entry; one
joint; a joint and one below it that undoes its turn (the twist of a bone, the swivel of an elbow);
a joint against a translation; a uniform shift of many points against another one (a gauge); two
blocks; a limb; a block.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import scipy.linalg
from scipy.sparse import coo_array, csc_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Tree
from workbench.problem.sparsity import tied_columns

MANY = 400  # entries up to which a subspace is searched as a whole


@dataclass(frozen=True, eq=False)
class NamedSubspace:
    """A subspace of the free numbers with a name: the columns of `basis` at the rows `entries`.

    Attributes:
        kind: `entry`, `twist`, `joint`, `shift` or `block`, or that of a gauge (`Direction`).
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

    def vector(self, n: int) -> Array:
        """(n,) the motion, of a subspace of one."""
        v = np.zeros(n)
        assert self.basis is not None
        v[self.entries] = self.basis[:, 0]
        return v


def in_sizes(motion: NamedSubspace, sizes: Array) -> NamedSubspace:
    """A motion of unknowns x as one of unknowns y, with x = sizes * y."""
    there = sizes[motion.entries]
    if motion.basis is None or (there == there[0]).all():
        return motion
    return replace(motion, basis=np.linalg.qr(motion.basis / there[:, None])[0])


def named_subspaces(
    free: Layout, trees: Sequence[Tree], pattern: csc_array | None = None
) -> Iterator[NamedSubspace]:
    """All motions of the dictionary; those with few entries come first.

    With the `pattern` (m, n) of the Jacobian there are also shifts of groups of points that no
    residual ties to other points.
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


def _free(
    kind: str,
    name: str,
    joints: tuple[str, ...],
    entries: Sequence[int],
    tree: Tree | None = None,
    undone_by: str = "",
) -> NamedSubspace:
    """A subspace in which each of the entries may move by itself."""
    at = np.array(entries, dtype=np.int64)
    return NamedSubspace(kind, name, joints, at, None, tree, undone_by)


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
            name = f"a turn of {tree.called(above)}, undone at {names[1]}"
            yield _free("twist", name, names, turn + back, tree)


def _islands(free: Layout, blocks: Sequence[Block], pattern: csc_array) -> Iterator[NamedSubspace]:
    """Shifts of those points of a block that residuals tie to each other and not to the others."""
    for block in blocks:
        found = _uniform(free, block)
        if found is None or block.size < 9:
            continue
        entries = found[0].reshape(-1, 3)
        m, count = pattern.shape[0], len(entries)
        read = pattern[:, free.slices[block.name]].tocoo()
        for rows in tied_columns(coo_array((read.data, (read.row, read.col // 3)), (m, count))):
            if 1 < rows.size < count:
                basis = np.tile(np.eye(3), (rows.size, 1)) / np.sqrt(rows.size)
                first = ", ".join(block.labels[r] if block.labels else str(r) for r in rows[:3])
                more = ", ..." if rows.size > 3 else ""
                name = f"a shift of {rows.size} rows of {block.name} ({first}{more})"
                yield NamedSubspace("shift", name, (), entries[rows].ravel(), basis)


def _shifts(free: Layout, blocks: Sequence[Block]) -> Iterator[NamedSubspace]:
    """All points of a block move by the same vector, alone or against those of another block."""
    moved = [(block, _uniform(free, block)) for block in blocks]
    in_space = [(block, found) for block, found in moved if found is not None]
    for block, (entries, basis) in in_space:
        if block.size > 3:
            yield NamedSubspace("shift", f"a shift of all of {block.name}", (), entries, basis)
    for (a, (at_a, by_a)), (b, (at_b, by_b)) in combinations(in_space, 2):
        name = f"a shift of {a.name}, undone by {b.name}"
        basis = scipy.linalg.block_diag(by_a, by_b)
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
                    motion = f"a turn of {tree.called(k)}, undone by {block.name}"
                    yield _free("twist", motion, (name,), [*turn, *moves], tree, block.name)


def _two_blocks(free: Layout, blocks: Sequence[Block]) -> Iterator[NamedSubspace]:
    for a, b in combinations(blocks, 2):
        if a.size + b.size <= MANY:
            parts = free.slices[a.name], free.slices[b.name]
            entries = [e for part in parts for e in range(part.start, part.stop)]
            yield _free("block", f"{a.name} against {b.name}", (), entries)


def _limbs(free: Layout, tree: Tree) -> Iterator[NamedSubspace]:
    """Turns of a joint and of all joints below it, small limbs first, the whole tree last."""
    K = len(tree.parents)
    below: list[list[int]] = [[k] for k in range(K)]
    for k in range(K - 1, 0, -1):
        if tree.parents[k] >= 0:  # a sequence has a root in every frame
            below[tree.parents[k]] += below[k]
    for k in sorted(range(K), key=lambda k: len(below[k])):
        entries = [e for j in sorted(below[k]) for e in tree.entries(j, free)]
        if len(entries) > 6:
            yield _free("joint", f"turns from {tree.names[k]} down", (), entries, tree)


def _limbs_against_translations(
    free: Layout, tree: Tree, blocks: Sequence[Block]
) -> Iterator[NamedSubspace]:
    """The root moves, and turns of the joints near it undo that at all observed points."""
    depth = [0] * len(tree.parents)
    for k, parent in enumerate(tree.parents[1:], start=1):
        depth[k] = depth[parent] + 1 if parent >= 0 else 0
    for block, moves in _translations(free, blocks):
        for most in range(1, max(depth) + 1):
            near = [e for k, d in enumerate(depth) if d <= most for e in tree.entries(k, free)]
            if near:
                name = f"turns near {tree.names[0]}, undone by {block.name}"
                yield _free("joint", name, (), [*near, *moves], tree, block.name)


def _translations(free: Layout, blocks: Sequence[Block]) -> Iterator[tuple[Block, list[int]]]:
    """Blocks of three numbers, and their entries."""
    for block in blocks:
        if block.shape == (3,) and (block.whole is None or block.unit == "m"):
            part = free.slices[block.name]
            yield block, list(range(part.start, part.stop))
