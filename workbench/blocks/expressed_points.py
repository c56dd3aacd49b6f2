"""Points that are an expression in the symbols of blocks, evaluated by CasADi."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array
from workbench.blocks.block import Block
from workbench.blocks.functions import Buffered
from workbench.blocks.tree import Tree


@dataclass(frozen=True, eq=False)
class ExpressedPoints:
    """A source of points (3, N) that are an expression, such as the symbol of a block (N, 3).

    See PointSource, NumericPoints and SparsePoints: it is all of these.

    Attributes:
        expression: the points in the symbols of the blocks, (3, N) in metres.
        blocks: the blocks that the expression reads.
        tree: the kinematic tree that moves the points, where there is one.
        labels: a name for each point, where they have names.
    """

    expression: cs.MX
    blocks: tuple[Block, ...]
    tree: Tree | None = None
    labels: tuple[str, ...] | None = None

    @property
    def count(self) -> int:
        """The number of points, N."""
        return int(self.expression.shape[1])

    @property
    def numeric(self) -> "ExpressedPoints":
        """Itself, for it computes its points."""
        return self

    @cached_property
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks that the points depend on."""
        return tuple(block.name for block in self.blocks)

    def pattern(self, name: str) -> csc_array:
        """Where the derivative by a block can be nonzero, (3 N, size)."""
        return self._jacobians[name][1]

    def evaluate(self, values: Mapping[str, Array]) -> "ExpressedPointsAt":
        """The points where the blocks have these values."""
        arguments = [np.asarray(values[name], dtype=float) for name in self.reads]
        return ExpressedPointsAt(self, arguments, self._points(*arguments)[0].reshape(-1, 3))

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        """The points (M, N, 3) m for M values of each block."""
        M = len(next(iter(values.values())))  # of any block: the points may read none
        each = ({name: values[name][i] for name in self.reads} for i in range(M))
        return np.stack([self.evaluate(one).points for one in each])

    @cached_property
    def _symbols(self) -> list[cs.MX]:
        return [block.symbol for block in self.blocks]

    @cached_property
    def _points(self) -> Buffered:
        return Buffered(cs.Function("points", self._symbols, [cs.densify(self.expression)]))

    @cached_property
    def _jacobians(self) -> dict[str, tuple[Buffered, csc_array]]:
        """For every block, the derivative's nonzeros as a function, and their places."""
        found = {}
        for name, symbol in zip(self.reads, self._symbols, strict=True):
            J = cs.jacobian(cs.vec(self.expression), cs.vec(symbol))
            starts, rows = J.sparsity().get_ccs()
            places = csc_array((np.ones(len(rows)), rows, starts), shape=J.shape)
            found[name] = Buffered(cs.Function("slopes", self._symbols, [J])), places
        return found


@dataclass(frozen=True, eq=False)
class ExpressedPointsAt:
    """The points at one set of values; see PointsAt and SparsePointsAt.

    Attributes:
        of: the source.
        arguments: the values of its blocks.
        points: the points, (N, 3) m.
    """

    of: ExpressedPoints
    arguments: list[Array]
    points: Array

    def jacobian(self, name: str) -> csc_array:
        """The derivative by a block, (3 N, size)."""
        function, places = self.of._jacobians[name]
        (entries,) = function(*self.arguments)
        return csc_array((entries, places.indices, places.indptr), shape=places.shape)

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write the derivative, transposed, with all its zeros, into[block] (size, 3 N)."""
        for name, target in into.items():
            found = self.jacobian(name).toarray().T
            target[...] = found if scale is None else found * scale

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """The gradient of sum(pull * points), pull (3 N,), by each block; flat."""
        return {name: np.asarray(self.jacobian(name).T @ pull) for name in self.of.reads}
