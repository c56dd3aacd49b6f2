"""Points on a body as residuals see them: a placeholder, and where it comes from.

Each placeholder has a source that computes its points. Where the whole graph is needed, `Problem`
puts the source's expression in the place of the placeholder. A source may have arithmetic alone
(`expression` is None): then there is no whole graph, and all that uses the chain rule works.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn, Protocol

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Index
from workbench.blocks.block import Block, Symbolic
from workbench.blocks.functions import Buffered
from workbench.blocks.layout import Layout
from workbench.errors import BadArgument, BadResidual, NotSupported, TwoSymbolsOneName

Place = tuple[str, int]  # a block's name, and the first of three entries in a row


@dataclass(frozen=True)
class Tree:
    """The joints that a pose turns, by which motions are named.

    Attributes:
        pose: the name of the block that holds their rotation vectors, or of all blocks that do.
        names: the names of the joints.
        parents: parents[k] < k is the parent of joint k, -1 for the root.
        given_places: where the three numbers of each joint stand; None for a joint whose numbers
            are no entries of a block. Without them, all stand in order in the block `pose`.
        rigid_bones: whether joints keep their places on bones, as the rank law of observed joints
            requires; those found on a surface that deforms do not.
    """

    pose: str
    names: tuple[str, ...]
    parents: tuple[int, ...]
    given_places: tuple[Place | None, ...] | None = None
    rigid_bones: bool = True

    @cached_property
    def places(self) -> tuple[Place | None, ...]:
        """The block and first entry of each joint's three numbers; None where there are none."""
        if self.given_places is not None:
            return self.given_places
        return tuple((self.pose, 3 * k) for k in range(len(self.names)))

    @cached_property
    def blocks(self) -> tuple[str, ...]:
        """The names of the blocks that hold rotation vectors."""
        return tuple(dict.fromkeys(place[0] for place in self.places if place is not None))

    def children(self, joint: int) -> tuple[int, ...]:
        """The joints whose parent is `joint`."""
        return tuple(k for k, parent in enumerate(self.parents) if parent == joint)

    def called(self, joint: int) -> str:
        """`pose[left_hip]`: the joint by the name of the block that its numbers stand in."""
        place = self.places[joint]
        return f"{self.pose if place is None else place[0]}[{self.names[joint]}]"

    def entries(self, joint: int, free: Layout) -> list[int]:
        """The places, among the free numbers, of those numbers of the joint that are free."""
        place = self.places[joint]
        if place is None or place[0] not in free.slices:
            return []
        name, first = place
        return [i for e in range(first, first + 3) if (i := free.place(name, e)) is not None]

    def turned(self, free: Layout) -> dict[int, slice]:
        """Joints whose three numbers are all free, and where these stand among the free ones."""
        entries = {k: self.entries(k, free) for k in range(len(self.names))}
        return {k: slice(own[0], own[0] + 3) for k, own in entries.items() if len(own) == 3}

    def moves(self, free: Layout) -> bool:
        """Whether any number of a joint is free."""
        return any(self.entries(k, free) for k in range(len(self.names)))


@dataclass(frozen=True)
class Rest:
    """The names of blocks that are arrays of a skinned body, for naming motions of them."""

    pose: str  # rotation vectors, (K, 3) rad
    trans: str  # the translation, (3,) m
    template: str | None = None  # the rest surface (N, 3) m, if it is a block
    joints: str | None = None  # the joints at rest (K, 3) m, if they are a block
    posedirs: str | None = None  # pose blend shapes (N, 3, 9 (K - 1)) m, if they are a block


PLACEHOLDER = "placeholder("  # how the names of placeholders begin when a graph is printed


class PointsAt(ABC):
    """Points at one set of values. A source may have d numbers of each point instead of three."""

    @property
    @abstractmethod
    def points(self) -> Array:
        """The points, (N, 3), in metres."""

    @abstractmethod
    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write the points' derivative by each block of `into`, transposed: (size, 3 N).

        Each column is multiplied by `scale` (3 N,), where there is one. `into` holds zeros wherever
        the derivative is always zero: nothing need be written there.
        """

    def jacobian(self, name: str) -> csc_array:
        """The derivative by a block with a `pattern` or a number of `nonzeros`, (3 N, size).

        Each entry is stored once. None is outside of the pattern, and zeros inside of it may be
        left out.
        """
        raise NotImplementedError(f"the derivative by {name} is dense")

    @abstractmethod
    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradient of cotangent (3 N,) . points by each block that is read; flat."""


class NumericPoints(ABC):
    """Points by arithmetic on arrays, faster than any graph."""

    @property
    @abstractmethod
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks that the points depend on."""

    @abstractmethod
    def evaluate(self, values: Mapping[str, Array]) -> PointsAt:
        """The points where the blocks that are read have these values."""

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        """(M, N, 3) m for M values of each block, (M, *shape)."""
        M = len(next(iter(values.values())))  # of any block: the points may read none
        each = ({name: values[name][i] for name in self.reads} for i in range(M))
        return np.stack([self.evaluate(row).points for row in each])

    def evaluate_each(self, values: Mapping[str, Array], count: int) -> "PointsOfEach":
        """The points at M = `count` values of each block, (M, *shape), with their derivatives."""
        each = ({name: value[i] for name, value in values.items()} for i in range(count))
        return LoopedPoints([self.evaluate(row) for row in each])

    def pattern(self, name: str) -> csc_array | None:
        """Where the points' derivative by a block can be nonzero at any values, (3 N, size).

        The numbers that are stored in it have no meaning; each entry is stored once. None for a
        block by which the derivative is dense. By a block that has a pattern, the points at one set
        of values are asked for `jacobian`, and never for `write_jacobian`.
        """
        return None

    def nonzeros(self, name: str) -> int | None:
        """How many nonzeros the derivative by a block has at most, where their places change.

        By a block of which it returns a number, the points are asked for `jacobian`, whose nonzeros
        may be anywhere, and there is no `pattern`. None where they keep their places, or the
        derivative is dense.
        """
        return None

    def only(self, wanted: Mapping[str, Index]) -> "NumericPoints | None":
        """These points with derivatives by some entries alone; None if it saves nothing."""
        return None


class PointSource(Protocol):
    """Where points come from: an expression in the symbols of some blocks, arithmetic, or both.

    Arithmetic is faster, and all that exists for points that no graph can express, such as those on
    triangles that are chosen anew at every step. Such a source has a method `frozen`, which takes
    values and gives a source whose choice is held as it is there.
    """

    @property
    def count(self) -> int:
        """The number of points, N."""

    @property
    def expression(self) -> cs.MX | None:
        """The points, (3, N) in metres, in the blocks' symbols; None if there is no graph."""

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks that the points depend on."""

    @property
    def tree(self) -> Tree | None:
        """The kinematic tree that moves the points, where there is one."""

    @property
    def labels(self) -> tuple[str, ...] | None:
        """A name for each point, where they have names."""

    @property
    def numeric(self) -> NumericPoints | None:
        """The points by arithmetic, if the source knows their structure; None otherwise."""


@dataclass(frozen=True, eq=False)
class Points(Symbolic):
    """The points that a residual reads: a symbol that stands for the points of a source.

    For CasADi an expression in this symbol does not depend on the blocks from which the source
    computes the points; `graph` gives the points as an expression in these blocks.

    Attributes:
        symbol: the placeholder, (3, N) in metres; (d, N) where a source has d numbers of each
            point instead of its coordinates.
        source: where the points come from.
    """

    symbol: cs.MX
    source: PointSource

    def _no_expression(self, other: object) -> NoReturn:
        raise BadArgument(
            "points of a body are no expression to compute with; take their `.symbol` (3, N), and "
            "give the points themselves to the residual: Residual(..., points=[joints])"
        )

    __add__ = __radd__ = __sub__ = __rsub__ = _no_expression
    __mul__ = __rmul__ = __truediv__ = __matmul__ = __rmatmul__ = _no_expression
    __array_ufunc__ = None  # NumPy leaves its operators to those above

    @staticmethod
    def of(source: PointSource, name: str, numbers: int = 3) -> "Points":
        """A new placeholder for the points of a source, its symbol called `placeholder(name)`.

        `numbers` is d, how many numbers the source has of each point. Raises BadArgument for no
        points, which a residual cannot read.
        """
        if not source.count:
            raise BadArgument(f"{name}: no points are chosen; choose at least one")
        return Points(cs.MX.sym(f"{PLACEHOLDER}{name})", numbers, source.count), source)

    def frozen(self, values: Mapping[str, Array]) -> "Points":
        """The same placeholder, with what its source chooses anew held as it is at these values."""
        frozen = getattr(self.source, "frozen", None)
        source = self.source if frozen is None else frozen(values)
        return self if source is self.source else Points(self.symbol, source)

    @property
    def name(self) -> str:
        """What the points are called: the name of the symbol without `placeholder()`."""
        return str(self.symbol.name()).removeprefix(PLACEHOLDER).removesuffix(")")

    @property
    def count(self) -> int:
        """The number of points, N."""
        return int(self.symbol.shape[1])

    @property
    def labels(self) -> tuple[str, ...] | None:
        """A name for each point, where they have names."""
        return self.source.labels

    def graph(self) -> cs.MX:
        """The points as an expression in the blocks' symbols, (3, N) m; see `in_blocks`."""
        return in_blocks(self.symbol, (self,))


def in_blocks(expression: cs.MX, points: Iterable[Points]) -> cs.MX:
    """An expression with these placeholders replaced by the expressions of their sources.

    The result depends only on the symbols of blocks, so that casadi.jacobian, sparsity,
    casadi.Function and generated C code are right. Raises NotSupported for points whose source has
    only arithmetic.
    """
    symbols, expressions = [], []
    for p in points:
        symbols.append(p.symbol)
        expressions.append(p.source.expression)
        if p.source.expression is None:
            raise NotSupported(
                f"there is no graph of {p.symbol.name()}, whose points come from arithmetic alone; "
                "residuals, linearizations and gradients come from the chain rule and need none: "
                "take a solver that asks for these, such as LevenbergMarquardt"
            )
    if symbols:
        expression = cs.graph_substitute(expression, symbols, expressions)
    return scalars_repeated(expression)


def jacobian(expression: cs.MX, by: cs.MX | Block) -> cs.MX:
    """The derivative of a column (m, 1) by a block or its symbol, (m, n), in symbols.

    casadi.jacobian silently returns zero if the expression contains a placeholder for points of a
    body. Raises BadResidual for such an expression and for anything that is no expression, and
    TwoSymbolsOneName if the expression reads another symbol with the same name.
    """
    if not isinstance(expression, cs.MX):
        hint = "; take its graph()" if hasattr(expression, "graph") else ""
        raise BadResidual(
            "the derivative is that of a CasADi expression (MX), not of something of type "
            f"{type(expression).__name__}{hint}"
        )
    for name in unlisted(expression, ()):
        raise BadResidual(
            f"the expression reads {name}, a symbol that stands for points of a body, so that its "
            "derivative by a block would be zero; take graph() of the points, the residual or the "
            "problem instead"
        )
    symbol = by.symbol if isinstance(by, Block) else by
    read = {s.__hash__(): s.name() for s in cs.symvar(expression)}
    for other in cs.symvar(symbol):
        if other.__hash__() not in read and other.name() in read.values():
            raise TwoSymbolsOneName(other.name())
    return cs.jacobian(scalars_repeated(expression), symbol)


def distinct(points: Iterable[Points]) -> tuple[Points, ...]:
    """The points without repetition."""
    return tuple({p.symbol.__hash__(): p for p in points}.values())


def unlisted(expression: cs.MX, points: Iterable[Points]) -> tuple[str, ...]:
    """The names of placeholders that an expression reads without their being among `points`."""
    listed = {p.symbol.__hash__() for p in points}
    return tuple(
        s.name()
        for s in cs.symvar(expression)
        if s.name().startswith(PLACEHOLDER) and s.__hash__() not in listed
    )


BROADCASTING = {  # operations that repeat a scalar, and whose derivatives CasADi then loses
    cs.OP_ADD: cs.plus,
    cs.OP_SUB: cs.minus,
    cs.OP_FMOD: cs.fmod,
    cs.OP_REMAINDER: cs.remainder,
}


def scalars_repeated(expression: cs.MX) -> cs.MX:
    """An equal expression in which every scalar is repeated to a matrix before it is added to one.

    casadi.jacobian of the result by a symbol is right forwards and backwards. Functions that the
    expression calls without being inlined by CasADi are left as they are.
    """
    graph = cs.Function("graph", cs.symvar(expression), [expression])
    sums, repeated = [], []
    for k in range(graph.n_instructions()):
        if graph.instruction_id(k) in BROADCASTING:
            operation = graph.instruction_MX(k)
            a, b = operation.dep(0), operation.dep(1)
            if a.is_scalar() != b.is_scalar() and not (a if a.is_scalar() else b).is_constant():
                sums.append(operation)
                shape = (b if a.is_scalar() else a).shape
                a, b = (cs.repmat(x, *shape) if x.is_scalar() else x for x in (a, b))
                repeated.append(BROADCASTING[graph.instruction_id(k)](a, b))
    if not sums:
        return expression
    # each sum gets a symbol, and the sums are put back one after the other, in their order
    symbols = [cs.MX.sym(f"sum {i}", each.sparsity()) for i, each in enumerate(sums)]
    *parts, last = cs.graph_substitute([*repeated, expression], sums, symbols)
    known: list[cs.MX] = []
    for part in parts:
        known.append(_substituted(part, symbols[: len(known)], known))
    return _substituted(last, symbols, known)


def _substituted(expression: cs.MX, symbols: list[cs.MX], known: list[cs.MX]) -> cs.MX:
    read = {symbol.__hash__() for symbol in cs.symvar(expression)}
    own = [i for i, symbol in enumerate(symbols) if symbol.__hash__() in read]
    if not own:
        return expression
    return cs.graph_substitute(expression, [symbols[i] for i in own], [known[i] for i in own])


@dataclass(frozen=True, eq=False)
class ExpressedPoints(NumericPoints):
    """Points (3, N) that are an expression, such as the symbol of a block; a PointSource too."""

    expression: cs.MX  # (3, N) in metres, in the symbols of the blocks
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

    def evaluate(self, values: Mapping[str, Array]) -> "_ExpressedPointsAt":
        """The points where the blocks have these values."""
        arguments = [np.asarray(values[name], dtype=float) for name in self.reads]
        return _ExpressedPointsAt(self, arguments)

    @cached_property
    def _symbols(self) -> list[cs.MX]:
        return [block.symbol for block in self.blocks]

    @cached_property
    def _points(self) -> Buffered:
        return Buffered(cs.Function("points", self._symbols, [cs.densify(self.expression)]))

    @cached_property
    def _jacobians(self) -> dict[str, tuple[Buffered, csc_array]]:
        """For every block, the derivative's nonzeros as a function, and their places."""
        jacobians = {}
        for name, symbol in zip(self.reads, self._symbols, strict=True):
            J = cs.jacobian(cs.vec(self.expression), cs.vec(symbol))
            starts, rows = J.sparsity().get_ccs()
            places = csc_array((np.ones(len(rows)), rows, starts), shape=J.shape)
            jacobians[name] = Buffered(cs.Function("jacobian", self._symbols, [J])), places
        return jacobians


@dataclass(frozen=True, eq=False)
class _ExpressedPointsAt(PointsAt):
    of: ExpressedPoints
    arguments: list[Array]

    @cached_property
    def points(self) -> Array:
        return self.of._points(*self.arguments)[0].reshape(-1, 3)

    def jacobian(self, name: str) -> csc_array:
        function, places = self.of._jacobians[name]
        (entries,) = function(*self.arguments)
        return csc_array((entries, places.indices, places.indptr), shape=places.shape)

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        for name, target in into.items():
            target[...] = self.jacobian(name).toarray().T * (1.0 if scale is None else scale)

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        return {name: np.asarray(self.jacobian(name).T @ cotangent) for name in self.of.reads}


class PointsOfEach(Protocol):
    """Points at M sets of values; see PointsAt for those at one."""

    @property
    def points(self) -> Array:
        """The points, (M, N, 3), in metres."""

    def write_jacobians(self, some: slice, into: Mapping[str, Array]) -> None:
        """Write the derivatives by blocks at some of the values, into[name] (some, 3 N, size)."""

    def vjps(self, cotangents: Array) -> dict[str, Array]:
        """The gradients (M, size) of cotangent (M, 3 N) . points by each block."""


@dataclass(frozen=True, eq=False)
class LoopedPoints:
    """Points that are computed for one set of values after the other; see PointsOfEach."""

    places: list[PointsAt]

    @cached_property
    def points(self) -> Array:
        """The points, (M, N, 3), in metres."""
        return np.array([here.points for here in self.places])

    def write_jacobians(self, some: slice, into: Mapping[str, Array]) -> None:
        """Write the derivatives at some of the values, (some, 3 N, size)."""
        for array in into.values():
            array[:] = 0.0
        for i, here in enumerate(self.places[some]):
            here.write_jacobian({name: array[i].T for name, array in into.items()}, None)

    def vjps(self, cotangents: Array) -> dict[str, Array]:
        """The gradients (M, size) by each block that is read."""
        return stacked([here.vjp(own) for here, own in zip(self.places, cotangents, strict=True)])


def stacked(gradients: list[dict[str, Array]]) -> dict[str, Array]:
    """Gradients (M, size) by each block, from M of them."""
    names = gradients[0] if gradients else {}
    return {name: np.array([each[name] for each in gradients]) for name in names}
