"""Points of a body under the names of a problem's blocks.

Arithmetic knows a pose, betas, a translation and perhaps offsets (`BodyPoints`). A problem knows
blocks by the names that it gives them, of which these arguments are affine maps. `BlockPoints`
stands between the two.

A row of the pose may be one entry of a block that nothing else reads. Then its derivative is
written where that entry's row belongs, without a copy. All other rows are written aside, and matrix
products carry them on to the blocks.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks.affine import Affine, alone, filled
from workbench.blocks.points import LoopedPoints, NumericPoints, PointsAt, PointsOfEach


@dataclass(frozen=True, eq=False)
class Rows:
    """A matrix of `count` rows, of which some stand in arrays and the others are not wanted.

    `parts` are the first row of each array, and the array (rows, columns).
    """

    count: int
    parts: tuple[tuple[int, Array], ...]

    @staticmethod
    def of(target: Array | Rows) -> Rows:
        """All rows of one array; or the rows as they are."""
        return target if isinstance(target, Rows) else Rows(len(target), ((0, target),))

    @property
    def whole(self) -> Array | None:
        """The array that holds all of them, if there is one."""
        if len(self.parts) != 1 or len(self.parts[0][1]) != self.count:
            return None
        return self.parts[0][1]

    def __len__(self) -> int:
        """The number of rows, including those that are not wanted."""
        return self.count


RowTarget = Array | Rows  # where rows are written: into one array, or into parts of several


def write(into: RowTarget, found: Array, scale: Array | float | None) -> None:
    """Write the rows that are wanted, out of an array of all rows, each column times its scale."""
    factor = 1.0 if scale is None else scale
    for first, array in Rows.of(into).parts:
        np.multiply(found[first : first + len(array)], factor, out=array)


ROLES = ("pose", "betas", "trans", "offsets")
Maps = tuple[Affine, ...]  # in this order; offsets are left out where there are none


class BodyPointsAt(ABC):
    """Points of a body at one pose, betas and translation, and offsets if any; see PointsAt."""

    @property
    @abstractmethod
    def points(self) -> Array:
        """The points, (N, 3) m."""

    @abstractmethod
    def write_jacobian(self, into: Mapping[str, RowTarget], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas` and so on, (size, 3 N) each.

        Each column is multiplied by its scale (3 N,); rows that are not wanted are left out.
        """

    def write_jacobian_over_zeros(self, into: Mapping[str, RowTarget], scale: Array | None) -> None:
        """The same where `into` holds zeros wherever the derivative is always zero."""
        self.write_jacobian(into, scale)

    @abstractmethod
    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradients of cotangent (3 N,) . points by `pose`, `betas` and so on, flat."""


class BodyPoints(ABC):
    """Points of a body by arithmetic on its arguments, in the order of `ROLES`.

    These are its pose (K, 3) rad, betas (B,) and translation (3,) m; those of displaced landmarks
    have offsets (N, 3) m as well.
    """

    @abstractmethod
    def evaluate(self, pose: Array, betas: Array, trans: Array, *offsets: Array) -> BodyPointsAt:
        """The points at one set of arguments."""

    def evaluate_each(
        self, poses: Array, betas: Array, trans: Array, *offsets: Array
    ) -> Sequence[BodyPointsAt]:
        """The points at each of M sets of arguments, (M, K, 3) rad, (M, B) and so on."""
        return [self.evaluate(*one) for one in zip(poses, betas, trans, *offsets, strict=True)]

    def together(self, names: Mapping[str, str], *arguments: Array) -> PointsOfEach | None:
        """The same by arithmetic on all of them; None where it takes one at a time.

        `names` are those of the blocks that hold the arguments, by the words of `ROLES`.
        """
        return None

    @abstractmethod
    def evaluate_batch(self, poses: Array, betas: Array, trans: Array, *offsets: Array) -> Array:
        """The points (M, N, 3) m of M sets of arguments."""


@dataclass(frozen=True, eq=False)
class BlockPoints(NumericPoints):
    """Points on a body whose arguments are affine maps of a problem's blocks.

    `wanted` has the entries by which derivatives are taken of those blocks that
    are free in part; of all others they are taken by every entry.
    """

    points: BodyPoints
    maps: Maps
    wanted: Mapping[str, Index] = field(default_factory=dict)
    _assemblies: dict[tuple[str, ...], BlockAssembly] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks."""
        return tuple(dict.fromkeys(name for one in self.maps for name in one.reads))

    @cached_property
    def plain(self) -> tuple[str, ...] | None:
        """The names of the blocks pose, betas, trans and so on, if the arguments are whole blocks.

        None if an argument is made of blocks in another way, or a block is free in part.
        """
        return None if self.wanted else plain_names(self.maps)

    def only(self, wanted: Mapping[str, Index]) -> BlockPoints:
        """These points, with derivatives by the named entries of the named blocks only."""
        return BlockPoints(self.points, self.maps, {**wanted})

    def evaluate(self, values: Mapping[str, Array]) -> BlockPointsAt:
        """Where the blocks have these values."""
        return BlockPointsAt(self, self.points.evaluate(*(one.value(values) for one in self.maps)))

    def evaluate_each(self, values: Mapping[str, Array], count: int) -> PointsOfEach:
        """The points at M = `count` sets of values, in fewer calls than by `evaluate` for each."""
        if self.plain is not None:
            arguments = [one.value_batch(values) for one in self.maps]
            together = self.points.together(dict(zip(ROLES, self.plain, strict=False)), *arguments)
            if together is not None:
                return together
        each = [{name: values[name][i] for name in self.reads} for i in range(count)]
        arguments = [np.array([one.value(some) for some in each]) for one in self.maps]
        return LoopedPoints(
            [BlockPointsAt(self, here) for here in self.points.evaluate_each(*arguments)]
        )

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        """The points of M sets of values, (M, N, 3) m."""
        return self.points.evaluate_batch(*(one.value_batch(values) for one in self.maps))

    def assembly(self, names: tuple[str, ...]) -> BlockAssembly:
        """How the derivative by these blocks is put together."""
        if names not in self._assemblies:
            self._assemblies[names] = assembly_of(self.maps, names, self.wanted)
        return self._assemblies[names]


@dataclass(frozen=True, eq=False)
class BlockPointsAt(PointsAt):
    """The points at one set of values."""

    of: BlockPoints
    here: BodyPointsAt

    @property
    def points(self) -> Array:
        """The points at these values, (N, 3) m."""
        return self.here.points

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write the transposed derivative into[block] (size, 3 N)."""
        self._write(self.here.write_jacobian, into, scale)

    def write_jacobian_over_zeros(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """The same where `into` holds zeros wherever the derivative is always zero."""
        self._write(self.here.write_jacobian_over_zeros, into, scale)

    def _write(
        self,
        by: Callable[[Mapping[str, RowTarget], Array | None], None],
        into: Mapping[str, Array],
        scale: Array | None,
    ) -> None:
        if self.of.plain is not None:
            ours = zip(ROLES, self.of.plain, strict=False)
            by({our: into[name] for our, name in ours if name in into}, scale)
            return
        if not into:
            return
        assembly, width = self.of.assembly(tuple(into)), next(iter(into.values())).shape[1]
        aside = {role: np.zeros((part.held, width)) for role, part in assembly.parts.items()}
        by({role: part.target(into, aside[role]) for role, part in assembly.parts.items()}, scale)
        for name, entries in assembly.combined.items():
            total = np.zeros((len(entries), width))
            for role, part in assembly.parts.items():
                if name in part.matrices:
                    total += part.matrices[name] @ aside[role]
            into[name][entries] = total

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """Gradients of cotangent . points by the blocks, flat; by the entries that are wanted."""
        found, of = self.here.vjp(cotangent), self.of
        if of.plain is not None:
            return {name: found[role] for role, name in zip(ROLES, of.plain, strict=False)}
        gradient: dict[str, Array] = {}
        for role, one in zip(ROLES, of.maps, strict=False):
            for name, part in one.vjp(found[role]).items():
                gradient[name] = gradient[name] + part if name in gradient else part
        return {n: g[of.wanted[n]] if n in of.wanted else g for n, g in gradient.items()}


def plain_names(maps: Maps) -> tuple[str, ...] | None:
    """The name of a block for each argument, if the arguments are these and nothing else."""
    names = tuple(one.plain for one in maps if one.plain is not None)
    # of one block in two roles the derivatives have to be added
    return names if len({*names}) == len(maps) else None


@dataclass(frozen=True)
class RowRun:
    """Rows of an argument, one after the other, and the rows of a block's array that hold them.

    Attributes:
        first: the first of the argument's rows.
        count: how many rows these are.
        block: the block whose array holds them; empty for the array aside.
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
    runs: tuple[RowRun, ...]
    matrices: Mapping[str, Array | csr_array]

    def target(self, into: Mapping[str, Array], aside: Array) -> RowTarget:
        """Where the rows are written: in the blocks' arrays, and in the array aside."""
        parts = tuple(
            (
                run.first,
                (into[run.block] if run.block else aside)[run.entry : run.entry + run.count],
            )
            for run in self.runs
        )
        return parts[0][1] if self.runs[0].count == self.count else Rows(self.count, parts)


@dataclass(frozen=True, eq=False)
class BlockAssembly:
    """The parts by their roles, and by block the entries that are sums of rows written aside."""

    parts: Mapping[str, ArgumentRows]
    combined: Mapping[str, Index]


def assembly_of(maps: Maps, names: tuple[str, ...], wanted: Mapping[str, Index]) -> BlockAssembly:
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
        onto = {
            name: csr_array(one.terms[name][:, entries[name][left]])
            for name, left in combined.items()
            if name in one.terms
        }
        aside = sorted({int(row) for matrix in onto.values() for row in matrix.nonzero()[0]})
        if rows or aside:
            to = {row: ("", i) for i, row in enumerate(aside)} | rows
            matrices = {n: filled(csr_array(m[aside].T)) for n, m in onto.items() if m.nnz}
            parts[role] = ArgumentRows(len(one.offset), len(aside), tuple(_runs(to)), matrices)
    return BlockAssembly(parts, combined)


def _wanted(maps: Maps, name: str, wanted: Mapping[str, Index]) -> Index:
    if name in wanted:
        return wanted[name]
    sizes = (one.terms[name].shape[1] for one in maps if name in one.terms)
    return np.arange(next(sizes))


def _runs(to: Mapping[int, tuple[str, int]]) -> list[RowRun]:
    """Rows side by side that stand side by side in one array as well."""
    rows = sorted(to)
    apart = [
        i
        for i, (a, b) in enumerate(pairwise(rows), start=1)
        if b != a + 1 or to[b] != (to[a][0], to[a][1] + 1)
    ]
    edges = [0, *apart, len(rows)]
    return [RowRun(rows[i], j - i, *to[rows[i]]) for i, j in pairwise(edges)]
