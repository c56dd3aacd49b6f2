"""The form of every error term."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks import Block, Points, in_blocks
from workbench.blocks.block import Symbolic
from workbench.blocks.checks import numbers, reals, several, texts
from workbench.blocks.points import unlisted
from workbench.errors import BadResidual
from workbench.residuals.kernels import Kernel, OfNorms, quadratic


@dataclass(frozen=True, eq=False)
class Residual(Symbolic):
    """A named column of numbers in `unit` that should be zero up to the standard deviation `sigma`.

    Problems see it whitened: row i adds 1/2 w_i rho((r_i / sigma_i)^2) to the cost, which is
    dimensionless and minus a log likelihood up to a constant. The weight w_i is a count and has no
    unit: a row of weight 2 counts as if it had been observed twice, one of weight 0 not at all. It
    stands outside of the kernel, so it does not change which residuals the kernel takes for
    outliers. `points` are the placeholders that the expression reads; `labels` name its rows.

    Where d = `rows_per_point` rows in succession are the coordinates of one point, 3 in space and
    2 in an image, a sigma or a weight may be given for each of the m / d points instead of each
    row, and a kernel `of_norms` can tell which rows belong together. With such a kernel
    weights are given by point: the rows of one point cannot have different weights.

    The expression is written in placeholders of points, which are symbols of their own; `graph` is
    the same in the symbols of blocks. A residual of a sequence has the rows of all frames, and says
    in `by_frame` which residual of a single frame they come from; what these say cannot be replaced
    for all rows.

    Some residuals have numbers where they mean nothing, as those of points behind a camera. Such a
    residual has a `domain`: a number for each point, which is below zero where the rows of this
    point mean nothing. Posteriors have no density where that is so for a point of a weight above 0,
    nor where the cost is no number. Fits do not know of it.

    Raises BadResidual for what is no column of symbols, does not fit the number of rows, or is out
    of range, and for placeholders that are not among its points; NotNumbers for text and the like.

    Attributes:
        name: the residual's name, unique in a problem.
        expression: (m, 1) in `unit`, an expression in symbols of blocks and placeholders of points.
        sigma: the standard deviation in `unit`: one for all rows, (m,), or (m / d,).
        unit: what a row measures.
        kernel: the robust kernel; `quadratic` for none.
        points: the placeholders that the expression reads.
        labels: a name for each row, or None.
        weights: one for all rows, (m,), or (m / d,); None where every row has the weight 1.
        blocks: units and labels of symbols that the expression reads.
        rows_per_point: d, how many successive rows are the coordinates of one point.
        by_frame: in a sequence, the frames and their residuals; empty otherwise.
        domain: (m / d, 1) below zero where the rows of a point mean nothing; None if they mean
            something everywhere.
        components: of a mixture, the residual of each component alone. Searches for the modes of
            a posterior begin where one of them stands in place of the mixture.
    """

    name: str
    expression: cs.MX
    sigma: float | Array
    unit: str = "1"
    kernel: Kernel = quadratic
    points: tuple[Points, ...] = ()
    labels: tuple[str, ...] | None = None
    weights: cs.MX | ArrayLike | None = None
    blocks: tuple[Block, ...] = ()
    rows_per_point: int = 1
    by_frame: tuple[tuple[int, "Residual"], ...] = ()
    domain: cs.MX | None = None
    components: tuple["Residual", ...] = ()
    _of_frames: tuple[object, ...] = field(default=(), repr=False)  # what `by_frame` says in full

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise BadResidual(f"a residual's name is a text, not {self.name!r}")
        check_symbolic(f"residual {self.name!r}: the expression", self.expression)
        what = f"of residual {self.name!r}"
        self.__dict__["points"] = several(f"the points {what}", self.points, Points, BadResidual)
        self.__dict__["blocks"] = several(f"the blocks {what}", self.blocks, Block, BadResidual)
        if self.labels is not None:
            self.__dict__["labels"] = texts(f"the labels {what}", self.labels, BadResidual)
        self._check_rows()
        self._check_sigma()
        self._check_kernel_and_weights()
        if self.domain is not None:
            count = self.size // self.rows_per_point
            check_symbolic(f"residual {self.name!r}: the domain", self.domain)
            if self.domain.shape != (count, 1):
                raise BadResidual(
                    f"residual {self.name!r} needs a domain of shape ({count}, 1), one number "
                    f"for each point, not of {self.domain.shape}"
                )
        check_listed(f"residual {self.name!r}", self.written, self.points)
        self._check_frames()

    def _check_rows(self) -> None:
        if self.expression.shape[1] != 1:
            raise BadResidual(
                f"residual {self.name!r} must be a column (m, 1), not {self.expression.shape}; "
                "casadi.vec makes one"
            )
        d = self.rows_per_point
        if not isinstance(d, (int, np.integer)) or d < 1 or self.size % d:
            raise BadResidual(
                f"residual {self.name!r} has {self.size} rows, which are no points of {d!r} rows "
                "each; rows_per_point is 3 in space, 2 in an image and 1 for single numbers"
            )
        if self.labels is not None and len(self.labels) != self.size:
            raise BadResidual(
                f"residual {self.name!r} has {self.size} rows but {len(self.labels)} labels; give "
                "one for each row"
            )

    def _check_sigma(self) -> None:
        m, d = self.size, self.rows_per_point
        sigma = reals(f"the sigma of residual {self.name!r}", self.sigma)
        fits = sigma.shape in ((), (m,), (m // d,))
        if not fits or not ((sigma > 0) & np.isfinite(sigma)).all():
            each = f"row ({m})" if d == 1 else f"row ({m}) or point ({m // d})"
            raise BadResidual(
                f"the sigma of residual {self.name!r} is finite and above zero, in {self.unit}: "
                f"one number, or one for each {each}; not {self.sigma}"
            )

    def _check_kernel_and_weights(self) -> None:
        if not callable(self.kernel):
            raise BadResidual(
                f"residual {self.name!r} needs a function as its kernel, such as quadratic, "
                f"geman_mcclure or huber(1.345), not {self.kernel!r}"
            )
        m, d = self.size, self.rows_per_point
        of_norms = isinstance(self.kernel, OfNorms)
        if of_norms and d == 1:
            raise BadResidual(
                f"residual {self.name!r} has a kernel of norms, but each of its rows stands "
                "alone; say rows_per_point=3 for points in space or 2 for pixels, or give the "
                "kernel itself"
            )
        counts = (m // d,) if of_norms or d == 1 else (m, m // d)
        why = "; its kernel is one of norms, and a point has one weight" if of_norms else ""
        check_weights(self.name, self.weights, counts, why)

    def _check_frames(self) -> None:
        """Raise BadResidual if what the residuals of frames say was replaced for all rows."""
        computed_from = self.expression, self.sigma, self.kernel, self.weights, self.domain
        if not self.by_frame or not self._of_frames:
            self.__dict__["_of_frames"] = computed_from if self.by_frame else ()
        elif any(now is not then for now, then in zip(computed_from, self._of_frames, strict=True)):
            raise BadResidual(
                f"residual {self.name!r} has the rows of {len(self.by_frame)} frames, and the "
                "frames would not see what was replaced; replace it in the residual of a frame, "
                "before sequence(...), or weigh all rows alike by residual.weighed(factor)"
            )

    @property
    def size(self) -> int:
        """m, the number of rows."""
        return int(self.expression.shape[0])

    @property
    def whitened(self) -> cs.MX:
        """In sigmas, shrunk by the kernel and then weighted: sqrt(w) g(s) r / sigma, (m, 1)."""
        d, r = self.rows_per_point, self.expression / self._for_rows(cs.DM(self.sigma))
        if self.kernel is not quadratic:
            squares = cs.reshape(r**2, d, self.size // d)  # a column for each point
            r = cs.vec(self.kernel(squares)) * r
        return r if self.weights is None else self._for_rows(root(self.weights)) * r

    def _for_rows(self, numbers: cs.MX | cs.DM) -> cs.MX | cs.DM:
        """Numbers of points (N, 1) for each of their rows (m, 1); others as they are."""
        if numbers.shape[0] in (1, self.size):
            return numbers
        return cs.vec(cs.repmat(numbers.T, self.rows_per_point, 1))

    def graph(self) -> cs.MX:
        """The expression in the symbols of blocks alone, (m, 1) in `unit`, not whitened."""
        return in_blocks(self.expression, self.points)

    def frozen(self, values: Mapping[str, Array]) -> "Residual":
        """The residual with contacts and the like held as they are at these values."""
        points = tuple(placeholder.frozen(values) for placeholder in self.points)
        if all(own is point for own, point in zip(points, self.points, strict=True)):
            return self
        framed = {block.name for block in self.blocks if block.framed}
        by_frame = tuple(
            (t, part.frozen({n: v[t] if n in framed else v for n, v in values.items()}))
            for t, part in self.by_frame
        )
        return replace(self, points=points, by_frame=by_frame, _of_frames=())

    def weighed(self, factor: float) -> "Residual":
        """The same residual with every weight multiplied by a number from 0 on."""
        own = 1.0 if self.weights is None else self.weights
        weights = factor * (own if isinstance(own, cs.MX) else np.asarray(own, dtype=float))
        distinct = {id(part): part for _, part in self.by_frame}
        # each once, so that frames stay alike
        weighed = {key: part.weighed(factor) for key, part in distinct.items()}
        by_frame = tuple((t, weighed[id(part)]) for t, part in self.by_frame)
        return replace(self, weights=weights, by_frame=by_frame, _of_frames=())

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the blocks that it depends on, directly or through its points."""
        return blocks_read(self.written, self.points)

    @property
    def written(self) -> cs.MX:
        """The expression, and the weights and the domain as far as they are expressions."""
        symbolic = (x for x in (self.weights, self.domain) if isinstance(x, cs.MX))
        return cs.veccat(self.expression, *symbolic)

    def label(self, row: int) -> str:
        """The name of one row: `keypoints(camera 1/observed)[left_wrist, u]`.

        In a sequence the frame comes first, as in `[12, left_wrist, u]`.
        """
        if self.by_frame:
            starts = np.cumsum([0, *(part.size for _, part in self.by_frame)])
            i = int(np.searchsorted(starts, row, side="right")) - 1
            t, part = self.by_frame[i]
            inner = part.label(row - int(starts[i])).removeprefix(f"{part.name}[")
            return f"{self.name}[{t}, {inner}"
        return f"{self.name}[{self.labels[row] if self.labels else row}]"


def blocks_read(expression: cs.MX, points: Sequence[Points]) -> tuple[str, ...]:
    """Names of the blocks that an expression of symbols and points depends on."""
    placeholders = {p.symbol.__hash__() for p in points}
    own = (s for s in cs.symvar(expression) if s.__hash__() not in placeholders)
    names = [s.name() for s in own]
    names += [b.name for p in points for b in p.source.blocks]
    return tuple(dict.fromkeys(names))


def check_symbolic(what: str, value: object) -> None:
    """Raise BadResidual unless the value is a CasADi symbol or an expression of symbols."""
    if not isinstance(value, cs.MX):
        hint = "; take its .symbol" if isinstance(value, (Block, Points)) else ""
        raise BadResidual(
            f"{what} must be a CasADi symbol or expression (MX), not something of type "
            f"{type(value).__name__}{hint}"
        )


def check_listed(what: str, expression: cs.MX, points: Sequence[Points]) -> None:
    """Raise BadResidual if an expression reads points of a body that are not among its `points`."""
    for name in unlisted(expression, points):
        raise BadResidual(
            f"{what} reads {name}, a symbol that stands for points of a body, but does not say "
            "which; give the Points themselves, as in points=(points,), and not their .symbol alone"
        )


def root(weights: cs.MX | ArrayLike) -> cs.MX | cs.DM:
    """sqrt(w), by which a whitened row is multiplied so that its square counts w times.

    The derivative is 0 at w = 0, where that of the root is infinite. NaN below zero.
    """
    if not isinstance(weights, cs.MX):
        return cs.DM(np.sqrt(reals("weights", weights)))
    zero = weights == 0
    return cs.if_else(zero, 0, cs.sqrt(cs.if_else(zero, 1, weights)))


def check_weights(
    name: str, weights: cs.MX | ArrayLike | None, counts: tuple[int, ...], why: str
) -> None:
    """Raise BadResidual unless there is one weight, or one of `counts`, none below zero.

    `why` ends the sentence about weights that do not fit. If weights depend on symbols, only
    their shape is checked. Raises NotNumbers for text.
    """
    if weights is None:
        return
    if isinstance(weights, cs.MX):
        shape, fits = weights.shape, weights.shape in ((1, 1), *((n, 1) for n in counts))
        known = None if cs.symvar(weights) else np.asarray(cs.evalf(weights), dtype=float)
    else:
        known = reals(f"the weights of residual {name!r}", weights)
        shape, fits = known.shape, known.shape in ((), *((n,) for n in counts))
    if not fits:
        raise BadResidual(
            f"residual {name!r} needs one weight or {' or '.join(map(str, counts))} of them, not "
            f"an array of shape {shape}{why}"
        )
    if known is not None and not ((known >= 0) & np.isfinite(known)).all():
        wrong = known[~((known >= 0) & np.isfinite(known))].flat[0]
        raise BadResidual(
            f"residual {name!r} needs finite weights from 0 on, not {wrong:g}; a row of weight 0 "
            "has no influence"
        )


def expressed(points: Points | cs.MX) -> tuple[cs.MX, tuple[Points, ...]]:
    """Points or a bare matrix (3, N), as an expression and what it reads; raises BadResidual."""
    if isinstance(points, Points):
        return points.symbol, (points,)
    check_symbolic("the points of a residual", points)
    if points.shape[0] != 3:
        raise BadResidual(
            f"the points of a residual are a matrix (3, N), one column each, not {points.shape}; "
            + ("transpose it" if points.shape[1] == 3 else "take the symbol of a block (N, 3)")
        )
    return points, ()


def as_matrix(name: str, what: str, value: cs.MX | ArrayLike, shape: tuple[int, ...]) -> cs.MX:
    """Observations with their axes reversed: a symbol as it is, numbers of `shape` as a constant.

    Raises NotNumbers, or BadResidual for an array of another shape or with a row that is not
    finite.
    """
    if isinstance(value, cs.MX):
        return value
    if isinstance(value, (Block, Points)):
        check_symbolic(f"residual {name!r}: {what}", value)
    if isinstance(value, cs.DM):
        value = np.asarray(value).T  # as a user sees it
        value = value[0] if len(shape) == len(value) == 1 else value
    array = reals(f"residual {name!r}: {what}", value)
    if array.shape != shape:
        raise BadResidual(
            f"residual {name!r} needs {what} as a block's symbol or an array of shape {shape}, "
            f"not of {array.shape}"
        )
    bad = ~np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
    if bad.any():
        row = int(np.argmax(bad))
        raise BadResidual(
            f"residual {name!r}: row {row} of {what} is {array[row]}, and {bad.sum()} of "
            f"{len(array)} rows are not finite; leave them out, or give them confidence 0 and "
            "any number where there is a confidence"
        )
    return cs.MX(cs.DM(array.T))


def confidences(name: str, value: cs.MX | ArrayLike, count: int, what: str) -> cs.MX:
    """Confidences (count, 1) of so many keypoints or the like, which `what` names.

    Raises NotNumbers, or BadResidual for another number of them.
    """
    weights = as_matrix(name, "the confidence", value, (count,))
    if weights.shape != (count, 1):
        raise BadResidual(
            f"residual {name!r} has {count} {what}, but confidences of shape {weights.shape}; give "
            "one for each"
        )
    return weights


def numbered(name: str, what: str, value: ArrayLike, width: int, count: int) -> Index:
    """Numbers of vertices (M, width), checked: each is from 0 to `count` - 1.

    `what` is `pairs (E` or the like. Raises NotNumbers or BadResidual.
    """
    plural = what.partition(" ")[0]
    indices = numbers(f"residual {name!r}: {plural}", value)
    if indices.ndim != 2 or indices.shape[1] != width or indices.dtype.kind not in "iu":
        raise BadResidual(
            f"residual {name!r} needs {what}, {width}) of whole numbers, not an array of shape "
            f"{indices.shape} of {indices.dtype}"
        )
    if indices.size and not 0 <= indices.min() <= indices.max() < count:
        raise BadResidual(f"residual {name!r} needs vertices from 0 to {count - 1} in its {plural}")
    return indices.astype(np.int64)


def row_labels(points: Points | cs.MX, axes: Sequence[str]) -> tuple[str, ...] | None:
    """Labels such as `left_wrist, x` for each coordinate of points that have names."""
    names = points.labels if isinstance(points, Points) else None
    return None if names is None else tuple(f"{n}, {a}" for n in names for a in axes)


def named(function: str, *symbols: cs.MX) -> str:
    """A name such as `function(block, block)`, from the blocks that the symbols depend on."""
    blocks = dict.fromkeys(s.name() for symbol in symbols for s in cs.symvar(symbol))
    return f"{function}({', '.join(blocks)})"


def named_after(function: str, observed: cs.MX | ArrayLike, points: Points | cs.MX) -> str:
    """A name as by `named`, from the observed block or else from the blocks of the points."""
    if isinstance(observed, cs.MX):
        return named(function, observed)
    if isinstance(points, Points):
        return f"{function}({', '.join(block.name for block in points.source.blocks)})"
    return named(function, points)


def same_shape(name: str, expression: cs.MX, observed: cs.MX) -> None:
    """Raise BadResidual unless the two can be subtracted entry by entry."""
    if expression.shape != observed.shape:
        (a, n), (b, m) = expression.shape, observed.shape
        transposed = expression.shape == observed.shape[::-1]
        raise BadResidual(
            f"residual {name!r} compares {n} points ({n}, {a}) with a block of shape ({m}, {b}); "
            + (
                f"it is transposed: the symbol of a block ({n}, {a}) is a matrix ({a}, {n}), and "
                "is given as it is, as observed.symbol without .T"
                if transposed
                else "they must be the same"
            )
        )
