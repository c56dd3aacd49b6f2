"""Points of a body under the names of a problem's blocks.

Arithmetic knows a pose, betas, a translation and perhaps offsets (`BodyPoints`). A problem knows
blocks by the names that it gives them, of which these arguments are affine maps. `BlockPoints`
stands between the two.

Where the arguments are whole blocks, derivatives are written where they belong. Otherwise the
derivatives by the arguments are computed first, and multiplied by those of the affine maps.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks.affine import Affine, fast_to_multiply
from workbench.blocks.points import LoopedPoints, NumericPoints, PointsAt, PointsOfEach


@dataclass(frozen=True, eq=False)
class Rows:
    """Where some `rows` of a matrix of `count` rows are written: into `array`, in their order."""

    count: int
    rows: Index
    array: Array

    def __len__(self) -> int:
        """The number of rows of the whole matrix."""
        return self.count


RowTarget = Array | Rows  # where rows are written: all, or some


def write(into: RowTarget, rows: Array, scale: Array | float | None) -> None:
    """Write all `rows` of a matrix or some, as `into` says, each column times its scale."""
    factor = 1.0 if scale is None else scale
    if isinstance(into, Rows):
        into.array[...] = rows[into.rows] * factor
    else:
        np.multiply(rows, factor, out=into)


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
        return [self.evaluate(*each) for each in zip(poses, betas, trans, *offsets, strict=True)]

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

    Of a block in `wanted`, derivatives are taken by these entries alone, and otherwise by all.
    """

    points: BodyPoints
    maps: Maps
    wanted: Mapping[str, Index] = field(default_factory=dict)
    _chains: dict[tuple[str, ...], dict[str, ArgumentRows]] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks."""
        return tuple(dict.fromkeys(name for part in self.maps for name in part.reads))

    @cached_property
    def plain(self) -> tuple[str, ...] | None:
        """The names of the blocks pose, betas, trans and so on, if the arguments are whole blocks.

        None if an argument is made of blocks in another way.
        """
        return plain_names(self.maps)

    def only(self, wanted: Mapping[str, Index]) -> BlockPoints:
        """These points, with derivatives by the named entries of the named blocks only."""
        return BlockPoints(self.points, self.maps, {**wanted})

    def evaluate(self, values: Mapping[str, Array]) -> BlockPointsAt:
        """Where the blocks have these values."""
        arguments = (part.value(values) for part in self.maps)
        return BlockPointsAt(self, self.points.evaluate(*arguments))

    def evaluate_each(self, values: Mapping[str, Array], count: int) -> PointsOfEach:
        """The points at M = `count` sets of values, in fewer calls than by `evaluate` for each."""
        if self.plain is not None and not self.wanted:
            arguments = [part.value_batch(values) for part in self.maps]
            together = self.points.together(dict(zip(ROLES, self.plain, strict=False)), *arguments)
            if together is not None:
                return together
        sets = [{name: values[name][i] for name in self.reads} for i in range(count)]
        arguments = [np.array([part.value(one_set) for one_set in sets]) for part in self.maps]
        return LoopedPoints(
            [BlockPointsAt(self, here) for here in self.points.evaluate_each(*arguments)]
        )

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        """The points of M sets of values, (M, N, 3) m."""
        return self.points.evaluate_batch(*(part.value_batch(values) for part in self.maps))

    def chain(self, names: tuple[str, ...]) -> dict[str, ArgumentRows]:
        """By role, the numbers of arguments through which points depend on these blocks."""
        if names not in self._chains:
            every = zip(ROLES, self.maps, strict=False)
            parts = {role: ArgumentRows.of(affine, names, self.wanted) for role, affine in every}
            self._chains[names] = {role: part for role, part in parts.items() if len(part.rows)}
        return self._chains[names]


@dataclass(frozen=True, eq=False)
class ArgumentRows:
    """The numbers of an argument that depend on some blocks.

    Attributes:
        count: how many numbers the argument has.
        rows: (R,) those that depend on any of the blocks.
        onto: by block, the transposed derivative of these by its entries, (entries, R).
    """

    count: int
    rows: Index
    onto: Mapping[str, Array | csr_array]

    @staticmethod
    def of(affine: Affine, names: tuple[str, ...], wanted: Mapping[str, Index]) -> ArgumentRows:
        """The numbers of an affine map; of the named blocks the wanted entries alone count."""
        terms = {name: affine.terms[name] for name in names if name in affine.terms}
        by = {
            n: csr_array(m[:, wanted[n].tolist()]) if n in wanted else m for n, m in terms.items()
        }
        reached = [row for matrix in by.values() for row in matrix.nonzero()[0].tolist()]
        rows = np.unique(np.array(reached, dtype=np.int64))
        onto = {n: fast_to_multiply(csr_array(m[rows].T)) for n, m in by.items() if m.nnz}
        return ArgumentRows(len(affine.offset), rows, onto)


@dataclass(frozen=True, eq=False)
class BlockPointsAt(PointsAt):
    """The points at one set of values."""

    of: BlockPoints
    body_points: BodyPointsAt

    @property
    def points(self) -> Array:
        """The points at these values, (N, 3) m."""
        return self.body_points.points

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write the transposed derivative into[block] (size, 3 N)."""
        of = self.of
        if of.plain is not None:
            targets: dict[str, RowTarget] = {}
            for role, affine, name in zip(ROLES, of.maps, of.plain, strict=False):
                if name in into:
                    rows, free = into[name], of.wanted.get(name)
                    targets[role] = rows if free is None else Rows(len(affine.offset), free, rows)
            self.body_points.write_jacobian(targets, scale)
        elif into:
            parts, width = of.chain(tuple(into)), next(iter(into.values())).shape[1]
            by_role = {role: np.zeros((len(part.rows), width)) for role, part in parts.items()}
            self.body_points.write_jacobian(
                {role: Rows(part.count, part.rows, by_role[role]) for role, part in parts.items()},
                scale,
            )
            for name, target in into.items():
                products = [p.onto[name] @ by_role[r] for r, p in parts.items() if name in p.onto]
                target[...] = sum(products[1:], products[0]) if products else 0.0

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """Gradients of cotangent . points by the blocks, flat; by the entries that are wanted."""
        by_role, of = self.body_points.vjp(cotangent), self.of
        gradient: dict[str, Array] = {}
        if of.plain is not None:
            gradient = {name: by_role[role] for role, name in zip(ROLES, of.plain, strict=False)}
        for role, affine in zip(ROLES, () if of.plain else of.maps, strict=False):
            for name, part in affine.vjp(by_role[role]).items():
                gradient[name] = gradient[name] + part if name in gradient else part
        return {n: g[of.wanted[n]] if n in of.wanted else g for n, g in gradient.items()}


def plain_names(maps: Maps) -> tuple[str, ...] | None:
    """The name of a block for each argument, if the arguments are these and nothing else."""
    names = tuple(affine.plain for affine in maps if affine.plain is not None)
    # of one block in two roles the derivatives have to be added
    return names if len({*names}) == len(maps) else None
