"""How the derivative of points by blocks is put together from that by pose, betas and trans.

Landmarks may have offsets as a fourth argument.

A row of the pose may be one entry of a block that nothing else reads. Then it is written where that
entry's row belongs, without a copy. All other rows are written aside, and matrix products carry
them on to the blocks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks.affine import Affine, alone, filled
from workbench.bodies.forward.rows import Rows, Target

ROLES = ("pose", "betas", "trans", "offsets")
Maps = tuple[Affine, ...]  # in this order; offsets are left out where there are none


def plain_names(maps: Maps) -> tuple[str, ...] | None:
    """The name of a block for each argument, if the arguments are these and nothing else."""
    names = tuple(one.plain for one in maps if one.plain is not None)
    # of one block in two roles the derivatives have to be added
    return names if len({*names}) == len(maps) else None


@dataclass(frozen=True)
class Run:
    """Rows of an argument, one after the other, and the rows of a block's array that hold them.

    Attributes:
        first: the first of the argument's rows.
        count: how many rows these are.
        block: the block whose array holds them; empty for the room aside.
        entry: the row of that array that holds the first of them.
    """

    first: int
    count: int
    block: str
    entry: int


@dataclass(frozen=True, eq=False)
class ArgumentRows:
    """What becomes of the rows of one argument.

    Attributes:
        count: the number of rows of the argument.
        held: how many rows are written aside.
        runs: the rows, in runs that stand side by side in one array.
        matrices: by block, the matrix from rows aside to the block's `combined` entries.
    """

    count: int
    held: int
    runs: tuple[Run, ...]
    matrices: Mapping[str, Array | csr_array]

    def target(self, into: Mapping[str, Array], aside: Array) -> Target:
        """Where the rows are written: in the blocks' arrays, and in the room aside."""
        parts = tuple(
            (
                run.first,
                (into[run.block] if run.block else aside)[run.entry : run.entry + run.count],
            )
            for run in self.runs
        )
        return parts[0][1] if self.runs[0].count == self.count else Rows(self.count, parts)


@dataclass(frozen=True, eq=False)
class Assembly:
    """The parts by their roles, and by block the entries that are sums of rows written aside."""

    parts: Mapping[str, ArgumentRows]
    combined: Mapping[str, Index]


def assembly_of(maps: Maps, names: tuple[str, ...], wanted: Mapping[str, Index]) -> Assembly:
    """How the derivative by the named blocks is assembled; `wanted` may name entries of them.

    Entries are counted within those that are wanted.
    """
    entries = {name: _wanted(maps, name, wanted) for name in names}
    places = {name: {int(e): i for i, e in enumerate(at)} for name, at in entries.items()}
    straight = [
        {
            row: (at[0], places[at[0]][at[1]])
            for row, at in enumerate(single)
            if at is not None and at[0] in places and at[1] in places[at[0]]
        }
        for single in alone(maps)
    ]
    reached = {name: set(range(len(at))) for name, at in entries.items()}
    for rows in straight:
        for name, entry in rows.values():
            reached[name].discard(entry)
    combined = {name: np.array(sorted(left)) for name, left in reached.items() if left}
    parts = {}
    for role, one, rows in zip(ROLES, maps, straight, strict=False):
        slopes = {
            name: csr_array(one.terms[name][:, entries[name][left]])
            for name, left in combined.items()
            if name in one.terms
        }
        aside = sorted({int(row) for slope in slopes.values() for row in slope.nonzero()[0]})
        if rows or aside:
            to = {row: ("", i) for i, row in enumerate(aside)} | rows
            matrices = {n: filled(csr_array(m[aside].T)) for n, m in slopes.items() if m.nnz}
            parts[role] = ArgumentRows(len(one.offset), len(aside), tuple(_runs(to)), matrices)
    return Assembly(parts, combined)


def _wanted(maps: Maps, name: str, wanted: Mapping[str, Index]) -> Index:
    if name in wanted:
        return wanted[name]
    sizes = (one.terms[name].shape[1] for one in maps if name in one.terms)
    return np.arange(next(sizes))


def _runs(to: Mapping[int, tuple[str, int]]) -> list[Run]:
    """Rows side by side that stand side by side in one array as well."""
    rows = sorted(to)
    apart = [
        i
        for i, (a, b) in enumerate(pairwise(rows), start=1)
        if b != a + 1 or to[b] != (to[a][0], to[a][1] + 1)
    ]
    edges = [0, *apart, len(rows)]
    return [Run(rows[i], j - i, *to[rows[i]]) for i, j in pairwise(edges)]
