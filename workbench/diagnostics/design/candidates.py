"""Measurements that could be made, and what each of them would say: whitened rows by unknowns."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.checks import mapping, several, texts
from workbench.blocks.entries import block_of
from workbench.diagnostics.remedies import with_more
from workbench.errors import (
    BadArgument,
    NotFinite,
    NotSupported,
    UnknownName,
    joined,
    listed,
)
from workbench.problem import Problem
from workbench.problem.steps import EPS
from workbench.residuals import Residual


@dataclass(frozen=True, eq=False)
class Candidate:
    """A measurement that could be made: its residuals, at numbers of its own if it has any.

    Only the Jacobian of the residuals counts: what is observed has not been observed yet, and may
    be any numbers of the right shape. Many candidates may share the same residuals and differ in
    their values, as cameras do.

    Attributes:
        residuals: what it would add to a problem.
        values: numbers of blocks that replace those of the problem, such as a camera's.
        own: blocks that are unknown in this candidate alone, such as the pose in a frame. They
            have values and are integrated out; priors on them belong to the residuals.
    """

    residuals: tuple[Residual, ...]
    values: Values = field(default_factory=dict)
    own: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        given = (self.residuals,) if isinstance(self.residuals, Residual) else self.residuals
        found = several("the residuals of a candidate", given, Residual, BadArgument)
        if not found:
            raise BadArgument("a candidate has one residual or more")
        self.__dict__["residuals"] = found
        self.__dict__["own"] = texts("the unknowns of a candidate's own", self.own)
        mapping("the values of a candidate", self.values)

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the blocks that its residuals read."""
        return tuple(dict.fromkeys(name for one in self.residuals for name in one.reads))


Given = Mapping[str, Residual | Sequence[Residual] | Candidate]


def checked(candidates: Given) -> dict[str, Candidate]:
    """Every candidate as a Candidate. Raises BadArgument for none, and for what is none."""
    found = {}
    for name, one in mapping("the candidates", candidates).items():
        if not isinstance(name, str):
            raise BadArgument(f"a candidate is called by a text, not by {name!r:.40}")
        try:
            found[name] = one if isinstance(one, Candidate) else Candidate(one)
        except BadArgument as error:
            raise BadArgument(f"candidate {name!r}: {error}") from error
    if not found:
        raise BadArgument("there are no candidates; give residuals by their names")
    return found


def rows_of(
    problem: Problem,
    candidates: Mapping[str, Candidate],
    values: Mapping[str, ArrayLike],
    made: dict[object, Problem],
) -> dict[str, Array]:
    """The whitened rows (m, n) of each candidate by the problem's unknowns, at these values.

    Unknowns of a candidate's own are integrated out: rows lose what these could explain, so that
    their information is the Schur complement. `made` keeps the problems that were made, for the
    next point. Raises UnknownName for a candidate that reads a block of no known value, and
    NotFinite for one whose rows hold NaN or infinity.
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
    plain = {name: one for name, one in candidates.items() if not one.values and not one.own}
    found = _at_once(problem, plain, values, made) if plain else {}
    for name, one in candidates.items():
        if name not in plain:
            key = (*(id(residual) for residual in one.residuals), one.own)
            if key not in made:
                made[key] = _of_residuals(problem, _own_unknowns(problem, name, one), one.own)
            found[name] = _without_own(problem, made[key], one, dict(values) | dict(one.values))
        if not np.isfinite(found[name]).all():
            raise NotFinite(
                f"candidate {name!r} has NaN or infinity in its Jacobian here; a camera may be "
                "inside of what it looks at"
            )
    return {name: A[A.any(axis=1)] for name, A in found.items()}


def _at_once(
    problem: Problem,
    plain: Mapping[str, Candidate],
    values: Mapping[str, ArrayLike],
    made: dict[object, Problem],
) -> dict[str, Array]:
    """The rows of candidates that have no numbers of their own, by one problem of them all."""
    several = [residual for one in plain.values() for residual in one.residuals]
    key = tuple(id(residual) for residual in several)
    if key not in made:
        made[key] = _of_residuals(problem, several, ())
    J = _by_unknowns(problem, made[key], made[key].linearize(values).dense)
    edges = np.cumsum([0, *(sum(r.size for r in one.residuals) for one in plain.values())])
    return {name: J[slice(*edge)] for name, edge in zip(plain, pairwise(edges), strict=True)}


def _of_residuals(problem: Problem, residuals: Sequence[Residual], own: tuple[str, ...]) -> Problem:
    """The problem of some residuals in the unknowns that they read, and some of their own."""
    reads = {name for residual in residuals for name in residual.reads}
    names = (n for n in problem.free.spelled() if block_of(n, problem.free.names) in reads)
    numbered = [replace(r, name=f"{r.name} {i}") for i, r in enumerate(residuals)]
    free = (*names, *own)
    return Problem(numbered, free or sorted(reads)[:1], blocks=problem.known.values())


def _own_unknowns(problem: Problem, name: str, one: Candidate) -> tuple[Residual, ...]:
    """The residuals of a candidate whose own unknowns are in order. Raises BadArgument."""
    both = set(one.own) & set(problem.free.names)
    if both:
        raise BadArgument(
            f"candidate {name!r} has {joined(sorted(both))} as its own unknowns, but the problem "
            "has them free too; give them another prefix, or leave them out of one of the two"
        )
    missing = [block for block in one.own if block not in one.reads]
    if missing:
        raise BadArgument(
            f"candidate {name!r} does not read {joined(missing)}, which are to be its own "
            f"unknowns; it reads {listed(one.reads)}"
        )
    return one.residuals


def _by_unknowns(problem: Problem, alone: Problem, J: Array) -> Array:
    """The columns of J (m, k) in their places among the problem's unknowns, (m, n)."""
    rows = np.zeros((len(J), problem.free.size))
    for block in alone.free.blocks:
        if block.name in problem.free.names:
            rows[:, problem.free.slices[block.name]] = J[:, alone.free.slices[block.name]]
    return rows


def _without_own(
    problem: Problem, alone: Problem, one: Candidate, values: Mapping[str, ArrayLike]
) -> Array:
    """Rows by the problem's unknowns, without what a candidate's own unknowns explain."""
    J = alone.linearize(values).dense
    rows = _by_unknowns(problem, alone, J)
    if not one.own:
        return rows
    own = np.hstack([J[:, alone.free.slices[name]] for name in one.own])
    basis, s, _ = np.linalg.svd(own, full_matrices=False)
    basis = basis[:, s > EPS * max(own.shape) * s.max(initial=0.0)]
    return np.asarray(rows - basis @ (basis.T @ rows))


def with_candidates(problem: Problem, candidates: Given, names: Iterable[str]) -> Problem:
    """The problem with the named candidates measured as well.

    Numbers of a candidate's own are constants in it. Raises UnknownName for a name that no
    candidate has, and NotSupported for candidates with unknowns of their own.
    """
    known = checked(candidates)
    added = []
    for name in texts("the names of candidates", names):
        if name not in known:
            raise UnknownName("candidate", name, known)
        one = known[name]
        if one.own:
            raise NotSupported(
                f"candidate {name!r} has unknowns of its own ({', '.join(one.own)}); build the "
                "problem with it by hand, each of them a block under a name of its own"
            )
        several_of = len(one.residuals) > 1
        for i, residual in enumerate(one.residuals):
            called = f"{name} ({i + 1})" if several_of else name
            added.append(_with_constants(replace(residual, name=called), one.values))
    return with_more(problem, added)


def _with_constants(residual: Residual, values: Mapping[str, ArrayLike]) -> Residual:
    """The residual with the symbols of some blocks replaced by numbers."""
    if not values:
        return residual
    given = {name: getattr(residual, name) for name in ("expression", "weights", "domain")}
    written = {name: part for name, part in given.items() if isinstance(part, cs.MX)}
    symbols = [s for s in cs.symvar(residual.written) if s.name() in values]
    numbers = [cs.MX(cs.DM(np.asarray(values[s.name()], dtype=float).T)) for s in symbols]
    parts = cs.substitute(list(written.values()), symbols, numbers)
    blocks = tuple(block for block in residual.blocks if block.name not in values)
    return replace(residual, blocks=blocks, **dict(zip(written, parts, strict=True)))
