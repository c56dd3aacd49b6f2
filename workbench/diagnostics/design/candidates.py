"""Measurements that could be made, what matters of the unknowns, and by what measurements compare.

D-optimality does not depend on the units of the unknowns: the volume of the ellipsoid is multiplied
by the same number for every candidate. A- and E-optimality measure every unknown in its
characteristic scale; with other scales they may choose another candidate. See Pukelsheim, Optimal
Design of Experiments, 2006.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import casadi as cs
import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Points, Values
from workbench.blocks.checks import mapping, several, texts
from workbench.blocks.layout import block_of, entries
from workbench.diagnostics.remedies import with_more
from workbench.errors import BadArgument, NotFinite, UnknownName
from workbench.problem import Problem
from workbench.residuals import Residual

SCALES = "characteristic scales"  # the unit of what is measured in them
Size = Callable[[Array], float]  # of K (r, q), with K'K the covariance of what matters
Measured = Callable[[Layout, Index, Array], tuple[Array, str]]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A measurement that could be made: its residuals, at numbers of its own if it has any.

    Only the Jacobian of the residuals counts: what is observed has not been observed yet, and may
    be any numbers of the right shape. Many candidates may share the same residuals and differ in
    their values, as cameras do.

    Attributes:
        residuals: what it would add to a problem.
        values: numbers of blocks that replace those of the problem, such as a camera's.
    """

    residuals: tuple[Residual, ...]
    values: Values = field(default_factory=dict)

    def __post_init__(self) -> None:
        one = isinstance(self.residuals, Residual)
        residuals = several(
            "the residuals of a candidate",
            (self.residuals,) if one else self.residuals,
            Residual,
            BadArgument,
        )
        if not residuals:
            raise BadArgument("a candidate has one residual or more")
        self.__dict__["residuals"] = residuals
        mapping("the values of a candidate", self.values)

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the blocks that its residuals read."""
        return tuple(dict.fromkeys(name for one in self.residuals for name in one.reads))


Given = Mapping[str, Residual | Sequence[Residual] | Candidate]


def checked(candidates: Given) -> dict[str, Candidate]:
    """Every candidate as a Candidate. Raises BadArgument for none, and for what is none."""
    by_name = {}
    for name, one in mapping("the candidates", candidates).items():
        if not isinstance(name, str):
            raise BadArgument(f"the name of a candidate must be a string, not {name!r:.40}")
        try:
            by_name[name] = one if isinstance(one, Candidate) else Candidate(one)
        except BadArgument as error:
            raise BadArgument(f"candidate {name!r}: {error}") from error
    if not by_name:
        raise BadArgument("there are no candidates; give residuals by their names")
    return by_name


def rows_of(
    problem: Problem,
    candidates: Mapping[str, Candidate],
    values: Mapping[str, ArrayLike],
    known_problems: dict[object, Problem],
) -> dict[str, Array]:
    """The whitened rows (m, n) of each candidate by the problem's unknowns, at these values.

    `known_problems` keeps the problems of residuals for the next point. Raises UnknownName for one
    that reads a block of no known value, and NotFinite for one whose rows hold NaN or infinity.
    """
    for name, one in candidates.items():
        known = dict(values) | dict(one.values)
        for block in one.reads:
            if block not in known:
                more = (
                    f"candidate {name!r} reads it; write the name of a block of the problem, or "
                    "give it a value"
                )
                raise UnknownName("block", block, known, more=more)
    plain = {name: one for name, one in candidates.items() if not one.values}
    several = [residual for one in plain.values() for residual in one.residuals]
    J = (
        _by_unknowns(problem, several, values, known_problems)
        if plain
        else np.zeros((0, problem.free.size))
    )
    edges = np.cumsum([0, *(sum(r.size for r in one.residuals) for one in plain.values())])
    rows = {name: J[slice(*edge)] for name, edge in zip(plain, pairwise(edges), strict=True)}
    for name, one in candidates.items():
        if name not in plain:
            at = dict(values) | dict(one.values)
            rows[name] = _by_unknowns(problem, one.residuals, at, known_problems)
        if not np.isfinite(rows[name]).all():
            raise NotFinite(
                f"candidate {name!r} has NaN or infinity in its Jacobian here; a camera may be "
                "inside of what it looks at"
            )
    return {name: A[A.any(axis=1)] for name, A in rows.items()}


def _by_unknowns(
    problem: Problem,
    residuals: Sequence[Residual],
    values: Mapping[str, ArrayLike],
    known_problems: dict[object, Problem],
) -> Array:
    """The whitened rows (m, n) of some residuals by the problem's unknowns."""
    key = tuple(id(residual) for residual in residuals)
    if key not in known_problems:
        reads = {name for residual in residuals for name in residual.reads}
        free = [n for n in problem.free.spelled() if block_of(n, problem.free.names) in reads]
        numbered = [replace(r, name=f"{r.name} {i}") for i, r in enumerate(residuals)]
        known_problems[key] = Problem(
            numbered, free or sorted(reads)[:1], blocks=problem.known.values()
        )
    alone = known_problems[key]
    J = alone.linearize(values).dense
    rows = np.zeros((len(J), problem.free.size))
    for block in alone.free.blocks:
        if block.name in problem.free.names:
            rows[:, problem.free.slices[block.name]] = J[:, alone.free.slices[block.name]]
    return rows


def with_candidates(problem: Problem, candidates: Given, names: Iterable[str]) -> Problem:
    """The problem with the named candidates measured as well.

    Numbers of a candidate's own are constants in it. Raises UnknownName for a name that no
    candidate has.
    """
    known = checked(candidates)
    added = []
    for name in texts("the names of candidates", names):
        if name not in known:
            raise UnknownName("candidate", name, known)
        one = known[name]
        for i, residual in enumerate(one.residuals):
            called = f"{name} ({i + 1})" if len(one.residuals) > 1 else name
            added.append(_with_constants(replace(residual, name=called), one.values))
    return with_more(problem, added)


def _with_constants(residual: Residual, values: Mapping[str, ArrayLike]) -> Residual:
    """The residual with the symbols of some blocks replaced by numbers."""
    if not values:
        return residual
    parts = {name: getattr(residual, name) for name in ("expression", "weights", "domain")}
    written = {name: part for name, part in parts.items() if isinstance(part, cs.MX)}
    symbols = [s for s in cs.symvar(residual.written) if s.name() in values]
    numbers = [cs.MX(cs.DM(np.asarray(values[s.name()], dtype=float).T)) for s in symbols]
    constant = cs.substitute(list(written.values()), symbols, numbers)
    blocks = tuple(block for block in residual.blocks if block.name not in values)
    return replace(residual, blocks=blocks, **dict(zip(written, constant, strict=True)))


# What matters, and by what measurements compare.


@dataclass(frozen=True, eq=False)
class Quantity:
    """A number or a few that are functions of the unknowns, such as a stature or a distance.

    Attributes:
        name: what it is called.
        expression: (q, 1) an expression of symbols of blocks and of points.
        unit: the unit of every row.
        points: the points of bodies that it reads.
        blocks: blocks whose units and labels are known.
    """

    name: str
    expression: cs.MX
    unit: str = "1"
    points: tuple[Points, ...] = ()
    blocks: tuple[Block, ...] = ()

    @cached_property
    def residual(self) -> Residual:
        """The same as a residual with a sigma of 1. Raises BadResidual where it is none."""
        return Residual(
            self.name, self.expression, 1.0, self.unit, points=self.points, blocks=self.blocks
        )


@dataclass(frozen=True, eq=False)
class Criterion:
    """What matters, and a number for the size of its covariance: the smaller the better.

    Attributes:
        name: in words, for the end of a sentence.
        size: the number, a standard deviation in some sense.
        measured: the units in which entries count, such as `in_scales`.
        names: the blocks or entries that matter; all that is free if there are none.
        quantity: what matters instead of entries.
    """

    name: str
    size: Size
    measured: Measured
    names: tuple[str, ...] = ()
    quantity: Quantity | None = None

    def over(self, *names: str) -> "Criterion":
        """The same, where only some blocks or entries matter and the others may stay unknown."""
        chosen = texts("the names of what matters", names)
        words = f"{self.name} of {', '.join(chosen)}"
        return replace(self, name=words, names=chosen, quantity=None)

    def gradients(self, free: Layout, scales: Array) -> tuple[Array, str]:
        """Derivatives (n, q) of what matters by the unknowns in their scales, and their unit.

        Raises UnknownName for an entry that is not free.
        """
        return self.measured(free, entries(free, self.names or free.names), scales)


def in_scales(free: Layout, meant: Index, scales: Array) -> tuple[Array, str]:
    """Entries count by their characteristic scales."""
    return np.eye(free.size)[:, meant], SCALES


def in_their_unit(free: Layout, meant: Index, scales: Array) -> tuple[Array, str]:
    """Entries count in the unit that they have. Raises BadArgument if they have several."""
    units = list(dict.fromkeys(free.unit(int(i)) for i in meant))
    if len(units) > 1:
        raise BadArgument(
            f"one standard deviation is of numbers in one unit, and not of numbers in "
            f"{' and '.join(units)}; name entries of one unit, or take d_optimal.over(...)"
        )
    return (np.eye(free.size) * scales)[:, meant], units[0]


def geometric_mean(half: Array) -> float:
    """det(K'K)^(1 / 2 q): the geometric mean of the half axes of the ellipsoid, one sd long."""
    if not half.shape[1]:
        return 1.0  # of nothing
    R = scipy.linalg.qr(half, mode="r", check_finite=False)[0]
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(abs(np.diag(R))))))


def root_mean_square(half: Array) -> float:
    """sqrt(trace(K'K) / q), the root mean square of the standard deviations."""
    return float(np.linalg.norm(half) / np.sqrt(max(1, half.shape[1])))


def largest(half: Array) -> float:
    """sqrt of the largest eigenvalue of K'K: the standard deviation along the worst direction."""
    return float(np.linalg.norm(half, 2)) if half.shape[1] else 1.0


def total(half: Array) -> float:
    """sqrt(trace(K'K)); of one quantity its standard deviation, of a place the length of that."""
    return float(np.linalg.norm(half))


# D-optimality: the volume of the ellipsoid of uncertainty, whatever the units.
d_optimal = Criterion(
    "D-optimality, the mean half axis of the uncertainty ellipsoid", geometric_mean, in_scales
)
# A-optimality: the mean variance, in characteristic scales.
a_optimal = Criterion("A-optimality, the mean variance", root_mean_square, in_scales)
# E-optimality: the variance along the worst direction, in characteristic scales.
e_optimal = Criterion("E-optimality, the worst direction", largest, in_scales)
CRITERIA: Mapping[str, Criterion] = {"d": d_optimal, "a": a_optimal, "e": e_optimal}


def sd_of(what: str | Quantity) -> Criterion:
    """The standard deviation of an entry such as `trans[z]`, of a block, or of a quantity.

    Of several rows it is the root of the sum of their variances. Raises BadArgument for anything
    else, and when it is used, for a block of several units, and UnknownName for no free entry.
    """
    if isinstance(what, Quantity):
        return Criterion(
            f"the standard deviation of {what.name}", total, in_their_unit, quantity=what
        )
    if not isinstance(what, str):
        raise BadArgument(
            f"the standard deviation is that of the name of an entry, such as 'trans[z]', or of a "
            f"Quantity, not of something of type {type(what).__name__}"
        )
    return Criterion(f"the standard deviation of {what}", total, in_their_unit, (what,))
