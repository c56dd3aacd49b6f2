"""Residuals of frames as one of a sequence, and residuals between frames."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Points
from workbench.blocks.checks import reals
from workbench.blocks.composed_points import FrameBlocks
from workbench.errors import BadArgument, BadResidual
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual

Described = Mapping[str, Block]  # the blocks of a frame, by name
Column = tuple[cs.MX, Described, tuple[Points, ...]]  # of one frame, in its blocks and points


@dataclass(frozen=True, eq=False)
class Frames:
    """The frames of a sequence, from which a residual between frames is made.

    `frames["pose"]` is the block of all frames, (T, K, 3), whose symbol has a column for each joint
    of each frame, (3, K T). `frames.points(points)` are the points of a frame in all frames.
    """

    blocks: FrameBlocks
    _points: dict[tuple[int, tuple[int, ...]], Points] = field(default_factory=dict, repr=False)

    @property
    def count(self) -> int:
        """T, the number of frames."""
        return self.blocks.count

    def __getitem__(self, name: str) -> Block:
        """A block of the sequence. Raises UnknownName."""
        return self.blocks[name]

    def points(self, points: Points, some: Sequence[int] | None = None) -> Points:
        """Points of a frame in all frames, or in some: (3, N T), those of the first frame first.

        `some` are numbers of frames, in any order. Raises BadResidual for one that does not exist.
        """
        chosen = tuple(range(self.count)) if some is None else tuple(some)
        for t in chosen:
            if not 0 <= t < self.count:
                raise BadResidual(f"there is no frame {t}; the frames are 0 to {self.count - 1}")
        key = points.symbol.__hash__(), chosen
        if key not in self._points:
            self._points[key] = self.blocks.points(points, chosen)
        return self._points[key]

    def stacked(self, by_frame: Mapping[int, Column]) -> tuple[cs.MX, tuple[Points, ...]]:
        """Columns of single frames, stacked, and the points of frames that they read.

        Frames that share one expression, not only equal ones, are evaluated by one map.
        """
        columns: dict[int, cs.MX] = {}
        reads: list[Points] = []
        groups: dict[int, list[int]] = {}  # of frames with the same expression
        for t in sorted(by_frame):
            groups.setdefault(id(by_frame[t][0]), []).append(t)
        for frames in map(tuple, groups.values()):
            expression, blocks, points = by_frame[frames[0]]
            pairs = [(p, self.points(p, frames)) for p in points]
            reads += [in_all for _, in_all in pairs]
            symbols = [(one.symbol, in_all.symbol) for one, in_all in pairs]
            symbols_read = {s.name() for s in cs.symvar(expression)}
            own_blocks = [block for name, block in blocks.items() if name in symbols_read]
            values = self.blocks.in_frames(expression, own_blocks, frames, symbols)
            if len(groups) == 1:
                return cs.vec(values), tuple(reads)
            columns |= zip(frames, cs.horzsplit(values), strict=True)
        return cs.vertcat(*[columns[t] for t in sorted(columns)]), tuple(reads)

    def residual(self, by_frame: "_Parts") -> Residual:
        """One residual of the sequence, from residuals of single frames with one name.

        Raises BadResidual where they differ in more than their rows, points and numbers.
        """
        order = sorted(by_frame)
        parts = [by_frame[t][0] for t in order]
        first = parts[0]
        for t, part in zip(order, parts, strict=True):
            for what in ("kernel", "unit", "rows_per_point"):
                if getattr(part, what) != getattr(first, what):
                    raise BadResidual(
                        f"residual {part.name!r} has another {what} in frame {t} than in frame "
                        f"{order[0]}; call it by another name there"
                    )
        expression, points = self.stacked(
            {t: (part.expression, blocks, part.points) for t, (part, blocks) in by_frame.items()}
        )
        weights, of_weights = self._weights(by_frame)
        domain, of_domain = self._domain(by_frame)
        distinct = {id(part): part for part in parts}.values()
        reads = dict.fromkeys(name for part in distinct for name in part.reads)
        return Residual(
            first.name,
            expression,
            np.concatenate([_numbers_for_rows(part.sigma, part, part.size) for part in parts]),
            first.unit,
            first.kernel,
            tuple({p.symbol.__hash__(): p for p in (*points, *of_weights, *of_domain)}.values()),
            weights=weights,
            blocks=tuple(self[name] for name in reads),
            rows_per_point=first.rows_per_point,
            by_frame=tuple(zip(order, parts, strict=True)),
            domain=domain,
        )

    def _domain(self, by_frame: "_Parts") -> tuple[cs.MX | None, tuple[Points, ...]]:
        """The domain of all frames: ones in frames that have none."""

        def domain_of(part: Residual) -> cs.MX:
            points = part.size // part.rows_per_point
            return cs.MX.ones(points) if part.domain is None else part.domain

        if all(part.domain is None for part, _ in by_frame.values()):
            return None, ()
        return self._stacked_once(by_frame, domain_of)

    def _weights(self, by_frame: "_Parts") -> tuple[cs.MX | Array | None, tuple[Points, ...]]:
        """The weights of all frames, for points unless a frame has one for each row."""
        parts = [by_frame[t][0] for t in sorted(by_frame)]
        if all(part.weights is None for part in parts):
            return None, ()
        by_row = any(
            _weight_count(part.weights) not in (1, part.size // part.rows_per_point)
            for part in parts
        )

        def count(part: Residual) -> int:
            return part.size if by_row else part.size // part.rows_per_point

        if not any(isinstance(part.weights, cs.MX) for part in parts):
            numbers = [_numbers_for_rows(part.weights, part, count(part)) for part in parts]
            return np.concatenate(numbers), ()
        return self._stacked_once(
            by_frame, lambda part: _symbols_for_rows(part.weights, part, count(part))
        )

    def _stacked_once(
        self, by_frame: "_Parts", column_of: Callable[[Residual], cs.MX]
    ) -> tuple[cs.MX, tuple[Points, ...]]:
        """Columns made of the residuals of frames, once for each, so that frames stay alike."""
        distinct = {id(part): part for part, _ in by_frame.values()}
        columns = {key: column_of(part) for key, part in distinct.items()}
        return self.stacked(
            {t: (columns[id(part)], blocks, part.points) for t, (part, blocks) in by_frame.items()}
        )


_Parts = Mapping[int, tuple[Residual, Described]]  # of frames, and their blocks
Between = Callable[[Frames], Residual]  # a residual that reads more than one frame


def _weight_count(weights: cs.MX | ArrayLike | None) -> int:
    if weights is None:
        return 1
    return int(weights.shape[0]) if isinstance(weights, cs.MX) else int(np.size(weights))


def _numbers_for_rows(value: ArrayLike | None, residual: Residual, count: int) -> Array:
    """Numbers for `count` rows or points, (count,)."""
    numbers = np.asarray(1.0 if value is None else value, dtype=float)
    if numbers.ndim and len(numbers) != count:
        numbers = np.repeat(numbers, residual.rows_per_point)
    return np.array(np.broadcast_to(numbers, (count,)))


def _symbols_for_rows(weights: cs.MX | ArrayLike | None, residual: Residual, count: int) -> cs.MX:
    """Weights for `count` rows or points as an expression, (count, 1)."""
    if not isinstance(weights, cs.MX):
        return cs.MX(cs.DM(_numbers_for_rows(weights, residual, count)))
    if weights.shape[0] == count:
        return weights
    times = count if weights.shape[0] == 1 else residual.rows_per_point
    return cs.vec(cs.repmat(weights.T, times, 1))


def smooth(
    what: str | Points,
    *,
    sigma: ArrayLike,
    order: int = 1,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Between:
    """A residual between the frames of a sequence: differences of `order` 1 or 2 are near zero,

        x[t + 1] - x[t]            at constant values, or
        x[t + 2] - 2 x[t + 1] + x[t]      at constant speed,

    for t from 0 on. x is a block of each frame, by its name, or points of a frame, in metres.
    `sigma` is the standard deviation of a difference, in the unit of x: one number, or one for each
    entry of a frame. Rotation vectors are taken as numbers: that is right while they stay away from
    half a turn, where the same rotation has two of them.

    The result makes the residual once it is given the frames, as `sequence(...)` does. That raises
    UnknownName or BadResidual for what does not fit. Raises BadArgument for another order.
    """
    if order not in (1, 2):
        raise BadArgument(f"differences between frames are of order 1 or 2, not {order!r}")
    if not isinstance(what, str | Points):
        raise BadArgument(
            "what is smooth is the name of a block of each frame, or Points of a frame, not "
            f"something of type {type(what).__name__}"
        )

    of = what.name if isinstance(what, Points) else what
    own_name = name or (f"smooth({of})" if order == 1 else f"smooth({of}, order 2)")
    sigmas = reals(f"the sigma of residual {own_name!r}", sigma)
    if not ((sigmas > 0) & np.isfinite(sigmas)).all():
        raise BadResidual(f"residual {own_name!r} needs a finite sigma above zero, not {sigmas}")

    def between(frames: Frames) -> Residual:
        values, unit, labels, reads, blocks = _moving(frames, what)
        T = frames.count
        if order >= T:
            raise BadResidual(
                f"differences of order {order} take {order + 1} frames, and there are {T}"
            )
        x = cs.reshape(values, values.numel() // T, T)  # a column for each frame
        difference = x[:, 1:] - x[:, :-1]
        if order == 2:
            difference = difference[:, 1:] - difference[:, :-1]
        size = int(difference.shape[0])
        if sigmas.size not in (1, size):
            raise BadResidual(
                f"residual {own_name!r} takes one sigma, or one for each of the {size} "
                f"entries of a frame, not {sigmas.size} of them"
            )
        return Residual(
            own_name,
            cs.vec(difference),
            np.tile(sigmas.ravel(), T - order) if sigmas.size > 1 else float(sigmas.ravel()[0]),
            unit,
            kernel,
            reads,
            tuple(f"{t} to {t + order}{label}" for t in range(T - order) for label in labels),
            blocks=blocks,
        )

    return between


def _moving(
    frames: Frames, what: str | Points
) -> tuple[cs.MX, str, list[str], tuple[Points, ...], tuple[Block, ...]]:
    """Values of all frames, their unit, a label of each entry of a frame, and what is read."""
    if isinstance(what, Points):
        in_all = frames.points(what)
        names = what.labels or tuple(map(str, range(what.count)))
        labels = [f", {point}, {axis}" for point in names for axis in "xyz"]
        return in_all.symbol, "m", labels, (in_all,), ()
    block = frames[what]
    if not block.framed:
        raise BadResidual(
            f"all frames share the block {what!r}, so nothing changes between them; "
            "smoothness is of a block that each frame has for itself, or of points"
        )
    return block.symbol, block.unit, _entries(block), (), (block,)


def _entries(block: Block) -> list[str]:
    """`, left_knee, x` for each entry of a frame."""
    size = block.size // block.shape[0]
    inner = (block.entry(i)[1:-1].partition(", ")[2] for i in range(size))
    return [f", {label}" if label else "" for label in inner]
