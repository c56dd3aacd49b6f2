"""Gauges of frames: a place moves or a turn turns, of a body or a camera; a vector turns."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.gauge_names import named_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.similarities import along_axes, axis_of, similarity, steps_of
from workbench.diagnostics.things import LENGTHS
from workbench.diagnostics.undoing import (
    SAME,
    Field,
    Found,
    Unseen,
    only,
    places,
    places_of,
    undoing,
    undone,
)
from workbench.geometry.rotation import inverse_left_jacobian
from workbench.problem import Problem

ANGLES = ("rad", "deg")
BEFORE_OR_AFTER = (("a rotation about", 1.0), ("a rotation about its own", -1.0))


def posed(problem: Problem) -> set[str]:
    """The names of blocks that turn joints of a body."""
    return {name for tree in problem.trees for name in tree.blocks}


def place_gauges(problem: Problem, unseen: Unseen) -> Iterator[NamedSubspace]:
    """A place moves along a fixed direction, and other places undo that."""
    free = problem.free
    spatial = [b for b in free.blocks if b.unit in LENGTHS[1:] and b.shape in ((2,), (3,))]
    for block in spatial:
        if others := [b for b in spatial if b is not block and b.size == block.size]:
            at = places_of(free, block)
            moves = only(at, free.size, lambda x: np.eye(len(x)))
            yield from _along(
                "translation",
                "a translation along",
                moves,
                places(free, others),
                block,
                free,
                unseen,
            )


def turn_gauges(problem: Problem, unseen: Unseen) -> Iterator[NamedSubspace]:
    """A body's root, or all rotation vectors of a block, turn about one axis, and others undo it.

    The axis is one of the world, or one of the frame that is turned. A single turn that other
    unknowns undo in every way, or in all but one, says little: they have to be turns and places.
    """
    free, n, poses = problem.free, problem.free.size, posed(problem)
    turns = [b for b in free.blocks if b.unit in ANGLES and _threes(b) and b.name not in poses]
    single = [b for b in turns if b.size == 3]
    spatial = [*single, *(b for b in free.blocks if b.shape == (3,) and b.unit in LENGTHS[1:])]
    roots = [np.array(tree.entries(0, free), dtype=np.int64) for tree in problem.trees]
    moved = [(r, free.block_of(int(r[0]))[0]) for r in roots if len(r) == 3 and turns]
    moved += [(places_of(free, b), b) for b in turns]
    for at, block in moved:
        frames = [b for b in spatial if b is not block]
        ways = [places(free, frames)] if frames else []
        if len(at) > 3 or (unseen.nearby and unseen.fixed(at) > 1):
            ways.append(np.setdiff1d(np.arange(n), at))
        for others in ways:
            for words, sign in BEFORE_OR_AFTER:
                if sign > 0 or unseen.nearby:
                    field = only(at, n, partial(_turning, sign=sign))
                    yield from _along("rotation", words, field, others, block, free, unseen)


def free_turns(problem: Problem, unseen: Unseen, found: Found) -> Iterator[NamedSubspace]:
    """A single turn about one axis that nothing sees, or that one other block undoes in any way.

    The axis is one of the world, or one of what is turned: a cylinder may turn about its own.
    """
    free, n, poses = problem.free, problem.free.size, posed(problem)
    turns = [b for b in free.blocks if b.unit in ANGLES and b.shape == (3,) and b.name not in poses]
    for block in turns if unseen.nearby else ():
        at = places_of(free, block)
        for words, sign in BEFORE_OR_AFTER:
            field = only(at, n, partial(_turning, sign=sign))
            yield from by_one("rotation", words, field, block, free, unseen, found)


def by_one(
    kind: str,
    said: str,
    moves: Field,
    main: Block,
    free: Layout,
    unseen: Unseen,
    found: Found,
) -> Iterator[NamedSubspace]:
    """The motions of a block along axes that nothing undoes, or one other block.

    Others are asked only if nothing found so far moves the block in all ways in which it may move.
    """
    at = places_of(free, main)
    others = [places_of(free, b) for b in free.blocks if b is not main]
    for some in (at[:0], *others) if found.left(at) else (at[:0],):
        coefficients, whole = undoing(moves, some, unseen)
        for a in along_axes(coefficients, slice(0, None)):
            if (v := whole(a)).any():
                name = f"{said} {axis_of(a)}"
                yield named_gauge(kind, name, v, free, [main], least=unseen.same)


def _turned_vector(x: Array) -> Array:
    """How one vector (d,) moves with the rotations: (d, 1 or 3)."""
    return similarity(x[None])[:, x.size : steps_of(x.size) - 1]


def _turning(w: Array, sign: float) -> Array:
    """How rotation vectors (3 K,) move with a turn before them, or after them: (3 K, 3)."""
    return sign * inverse_left_jacobian(sign * w.reshape(-1, 3)).reshape(-1, 3)


def _threes(block: Block) -> bool:
    return len(block.shape) > 0 and block.shape[-1] == 3 and len(block.shape) < 3


def _along(
    kind: str,
    said: str,
    moves: Field,
    others: Index,
    main: Block,
    free: Layout,
    unseen: Unseen,
) -> Iterator[NamedSubspace]:
    """The motions along the axes, where others really move."""
    coefficients, whole = undoing(moves, others, unseen)
    several = main.size > 3
    for a in along_axes(coefficients, slice(0, None)):
        v = whole(a)
        if v.any() and (several or np.linalg.norm(v[others]) > SAME * np.linalg.norm(v)):
            name = f"{said} {axis_of(a)}"
            yield named_gauge(kind, name, v, free, [main], least=unseen.same)


def vector_gauges(problem: Problem, unseen: Unseen) -> Iterator[NamedSubspace]:
    """One vector turns, such as the tool of an arm or gravity, and others undo that.

    With a unit of length, angles are enough; any others where they could not undo every motion.
    """
    free, poses = problem.free, posed(problem)
    angles = [b for b in free.blocks if b.unit in ANGLES and b.name not in poses]
    vectors = [b for b in free.blocks if b.shape in ((2,), (3,)) and b.unit not in ANGLES]
    for block in vectors:
        at, d = places_of(free, block), block.size
        ways: list[Sequence[Block]] = [angles] if angles and block.unit in LENGTHS[1:] else []
        if unseen.nearby and unseen.fixed(at):
            ways.append([b for b in free.blocks if b is not block])
        field = only(at, free.size, _turned_vector)
        for some in ways:
            others = places(free, some)
            for v, a in undone(field, others, unseen):
                if min(np.linalg.norm(v[at]), np.linalg.norm(v[others])) > SAME * np.linalg.norm(v):
                    about = "" if d == 2 else f" about {axis_of(a)}"
                    name = f"a rotation{about}"
                    yield named_gauge("rotation", name, v, free, [block], least=unseen.same)
