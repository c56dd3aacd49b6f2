"""Directions that change no residual, or hardly change any, each with a name and in units.

A null space is found, and searched for motions with a name, in unknowns whose columns have length
1: there rounding is the same for all. A direction is a combination of the basis from the first to
the last step, so that whatever it is called, it lies in the null space.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Layout, Tree
from workbench.blocks.layout import in_units, signed
from workbench.diagnostics.active_set import ConstrainedJacobian
from workbench.diagnostics.bases import BY_LINEAR_PROGRAM, beyond, null_basis, sparsest
from workbench.diagnostics.gauges import (
    INSIDE,
    TAKES_PART,
    Gauge,
    GaugeMotion,
    KnownMotions,
    NullSpace,
    gauges,
)
from workbench.diagnostics.generators import places_of, together
from workbench.diagnostics.joint_motions import JointNullMotion, joint_motions
from workbench.diagnostics.words import listed
from workbench.problem import Linearization
from workbench.threads import limited_threads

if TYPE_CHECKING:
    from workbench.diagnostics.diagnosis import Diagnosis

NEARLY_INSIDE = 0.05  # of its length: what a gauge may have outside of the weak directions
WEAK = 0.99  # sigmas per characteristic scale; a prior as wide as that has 1
MOST_NAMED = 500  # null directions of a sparse Jacobian, up to which names are looked for
MOST_WEAK = 12  # weak directions that are looked for where there are no singular values
MOST_TRADED = 8  # numbers that undo each other in a ratio of no known form
ROUNDING = (1e-7, 1e-9, 1e-11, 1e-13)  # of the largest entry: less is none, where J allows it


@dataclass(frozen=True, eq=False)
class Direction:
    """A unit vector (n,) of free numbers, and how much the whitened residual changes along it.

    Attributes:
        name: what the direction is called in reports. Where no words for a motion say it all, it
            ends in `terms`.
        kind: of gauges `translation`, `rotation`, `scale`, `offset`, `mixing`, `projective` or
            `gauge`, and `trade-off` where single numbers undo each other; of others `entry`,
            `twist`, `joint` or `mixed`.
        joints: the joints that it turns, as far as they are known.
        vector: (n,) the direction.
        change: |J d|, in sigmas per unit of the direction.
        terms: the vector in units, what matters most first, as `in_units` says it.
    """

    name: str
    kind: str
    joints: tuple[str, ...]
    vector: Array = field(repr=False)
    change: float
    terms: str = field(default="", repr=False)


def null_directions(d: "Diagnosis") -> tuple[Direction, ...]:
    """Directions that change no residual and that no constraint forbids, with names.

    Single entries come first, then gauges, then motions of joints, then what is left.
    """
    constrained = d.constrained
    count, stacked = d.here.shape[1] - constrained.rank, constrained.stacked
    if not count:
        return ()
    if constrained.sparse is not None and count > MOST_NAMED:
        return tuple(_by_entries(d))
    space = null_space(d)
    known = KnownMotions(space)
    directions = []
    for motion in [*_named(d, known, d.gauges), *_unnamed(d, known)]:
        y = space.basis @ motion.coefficients
        y /= np.linalg.norm(y)
        v = _without_rounding(y, space.lengths, stacked, constrained.tolerance)
        directions.append(_direction(motion, signed(v), stacked, d.here, d.free, d.scales.sizes))
    return tuple(directions)


def _by_entries(d: "Diagnosis") -> Iterator[Direction]:
    """Null directions that are too many for names, each by its entries."""
    free, null = d.free, d.constrained.null
    for v in sparsest(null, np.zeros((len(null), 0))).T:
        change, terms = float(np.linalg.norm(d.constrained.stacked.along(v))), ""
        if np.count_nonzero(v) == 1:
            name = free.label(int(np.argmax(abs(v))))
            yield Direction(name, "entry", (), signed(v), change, f"+1 of {name}")
        else:
            terms = in_units(signed(v), free, d.here.column_norms, scales=d.scales.sizes)
            yield Direction(terms, "mixed", (), signed(v), change, terms)


def weak_directions(d: "Diagnosis") -> tuple[Direction, ...]:
    """Directions along which a scale changes the residuals by less than a sigma, weakest first.

    The vectors have length 1 once every unknown is measured by its own characteristic scale. Of a
    sparse Jacobian there are MOST_WEAK at the most, each named by its entries.
    """
    if not d.weak_count:
        return ()
    if d.sparse is not None:
        with limited_threads():
            s, vectors = d.sparse.weakest(MOST_WEAK)
        weak = vectors[:, s < WEAK]
    else:
        spectrum = d.measured.stacked.spectrum
        weak = spectrum.Vt[int(np.sum(spectrum.s > WEAK)) : spectrum.rank].T
    if not weak.shape[1]:
        return ()
    sizes = d.scales.sizes
    if d.sparse is not None:
        motions = [GaugeMotion("mixed", "", a) for a in np.eye(weak.shape[1])]
    else:
        x = d.problem.split(d.values)[0]
        known = KnownMotions(NullSpace(x, 1 / sizes, weak, NEARLY_INSIDE))
        motions = [*_named(d, known), *_unnamed(d, known)]
    directions = []
    for motion in motions:
        v = signed(weak @ motion.coefficients) * sizes
        directions.append(_direction(motion, v, d.constrained.stacked, d.here, d.free, sizes))
    return tuple(sorted(directions, key=lambda direction: direction.change))


def named_by_joints(
    basis: Array,
    free: Layout,
    trees: Sequence[Tree],
    here: Linearization,
    tolerance: float = NEARLY_INSIDE,
) -> tuple[Direction, ...]:
    """Directions that span an orthonormal basis (n, d), by the motions of joints near to them."""
    space = NullSpace(np.zeros(free.size), np.ones(free.size), basis, tolerance)
    known = KnownMotions(space)
    motions = list(of_joints(list(joint_motions(free, trees)), free, known))
    rest = _sparse(space, null_basis(known.coefficients.T, 0.5), known.coefficients)
    motions += [GaugeMotion("mixed", "", a) for a in rest.T]
    return tuple(_direction(m, signed(basis @ m.coefficients), here, here, free) for m in motions)


def null_space(d: "Diagnosis") -> NullSpace:
    """What no residual notices at the point and nearby, its columns having length 1."""
    lengths, sizes = d.constrained.stacked.column_norms, d.scales.sizes
    lengths = np.where(lengths > 0, lengths, 1 / sizes)
    basis = null_in_units(d.constrained, lengths)
    x = d.problem.split(d.values)[0]
    single_entries = int(np.sum(np.sum(basis**2, axis=1) >= 1 - INSIDE**2))
    points = d.points_nearby if single_entries < basis.shape[1] else ()
    nearby = tuple((point, null_in_units(near, lengths)) for point, near in points)
    return NullSpace(x, lengths, basis, nearby=nearby)


def null_in_units(constrained: ConstrainedJacobian, lengths: Array) -> Array:
    """(n, d) an orthonormal basis of the null space of unknowns y = lengths * x.

    The dimension is that of the Jacobian in the unknowns' own units, which decides the rank.
    """
    n, stacked = len(lengths), constrained.stacked
    d = n - constrained.rank
    if constrained.sparse is not None or stacked.estimated:
        null = constrained.null * lengths[:, None]
        return np.asarray(np.linalg.qr(null / np.linalg.norm(null, axis=0))[0])
    read = np.flatnonzero(stacked.column_norms > 0)
    R = stacked.unit_triangle[:, read] * (stacked.column_norms / lengths)[read]
    Vt = np.linalg.svd(R, full_matrices=True)[2]
    basis = np.zeros((n, d))
    silent = np.setdiff1d(np.arange(n), read)[:d]
    basis[silent, np.arange(len(silent))] = 1.0
    basis[read, len(silent) :] = Vt[len(read) - (d - len(silent)) :].T
    return basis


def _named(
    d: "Diagnosis", known: KnownMotions, declared: Sequence[Gauge] = ()
) -> Iterator[GaugeMotion]:
    """The motions that have a name: single entries, gauges, motions of joints."""
    free, trees = d.free, d.problem.trees
    motions = list(joint_motions(free, trees))
    entries = [motion for motion in motions if motion.kind == "entry"]
    others = [motion for motion in motions if motion.kind != "entry"]
    yield from of_joints(entries, free, known)
    if not known.complete():
        yield from gauges(d.problem, d.values, known, d.structure.pattern, declared)
    yield from of_joints(others, free, known)


def of_joints(
    motions: Sequence[JointNullMotion], free: Layout, known: KnownMotions, *, apart: bool = True
) -> Iterator[GaugeMotion]:
    """The motions that move the entries of one of these subspaces alone, or nearly so.

    Several of one subspace are told apart by few entries, if they are to be.
    """
    space = known.space
    parts = np.sum(space.basis**2, axis=1)
    for motion in motions:
        if known.complete():
            return
        if parts[motion.entries].sum() < 1 - space.tolerance**2 - 1e-12:
            continue
        inside = _moving_only(space, motion.entries)
        if not inside.shape[1]:
            continue
        new = beyond(known.coefficients, inside)[1]
        several = new.shape[1] > 1
        if several and apart:
            new = _sparse(space, new, known.coefficients)
        for a in new.T:
            v = space.basis @ a
            if not known.add(a):
                continue
            name, joints = motion.called(v / space.lengths, free, max(INSIDE, space.tolerance))
            whole = motion.kind == "entry" or (motion.kind == "twist" and not several)
            title = name if whole and space.exact else f"{name}: "
            yield GaugeMotion(motion.kind, title, a, joints)


def _moving_only(space: NullSpace, entries: Index) -> Array:
    """Coefficients (d, k) of the motions that move these entries alone."""
    _, s, Vt = np.linalg.svd(space.basis[entries], full_matrices=False)
    return np.asarray(Vt[s >= np.sqrt(1 - space.tolerance**2)].T)


def _sparse(space: NullSpace, new: Array, old: Array) -> Array:
    """Coefficients (d, k) that with the old ones span the same, of vectors with few entries."""
    vectors = sparsest(np.linalg.qr(space.basis @ new)[0], space.basis @ old)
    return np.asarray(space.basis.T @ vectors)


def _unnamed(d: "Diagnosis", known: KnownMotions) -> Iterator[GaugeMotion]:
    """What has no other name: a few numbers that undo each other, or many."""
    space = known.space
    if known.complete():
        return
    if len(space.basis) > BY_LINEAR_PROGRAM and space.exact:
        yield from _of_rows(d, known)
    rest = null_basis(known.coefficients.T, 0.5)
    for a in _sparse(space, rest, known.coefficients).T if rest.size else ():
        if known.add(a):
            yield _by_numbers(d, space, a)
    for a in null_basis(known.coefficients.T, 0.5).T:  # such as rounding took away
        yield _by_numbers(d, space, a)


def _of_rows(d: "Diagnosis", known: KnownMotions) -> Iterator[GaugeMotion]:
    """Motions of one row of a block alone: of a point that one camera sees, along its ray."""
    for block in d.free.blocks:
        width = block.shape[-1] if len(block.shape) > 1 else block.size
        if width <= 1:
            continue
        for row in places_of(d.free, block).reshape(-1, width):
            for a in _moving_only(known.space, row).T:
                if known.add(a):
                    yield _by_numbers(d, known.space, a)


def _by_numbers(d: "Diagnosis", space: NullSpace, a: Array) -> GaugeMotion:
    """A trade-off of a few numbers, or a direction that has only its entries for a name.

    Numbers that undo each other nearby too, or however far, are a trade-off, unless there are too
    few rows for all; one at this point alone is no gauge. What holds to first order only says so.
    """
    free, v = d.free, space.basis @ a
    moved = np.flatnonzero(abs(v) > TAKES_PART * abs(v).max())
    change = _change_at_one_scale(d, v / space.lengths) if space.exact else 0.0
    straight = change <= INSIDE
    blocks = list(dict.fromkeys(free.block_of(int(i))[0].name for i in moved))
    own = together(free, blocks)
    x = space.x * space.lengths
    if space.exact and straight and own.size > 1 and _parallel(v[own], x[own]):
        return GaugeMotion("scale", f"a common factor of {listed(blocks)}", a)
    if not straight and not _null_nearby(d, space, moved):
        return GaugeMotion("mixed", f"to first order ({change:.2g} sigma at one scale): ", a)
    if space.exact and len(moved) <= MOST_TRADED:
        among = f"within {blocks[0]}" if len(blocks) == 1 else f"of {listed(blocks)}"
        kind = "mixed" if _null_nearby(d, space, moved) is False else "trade-off"
        return GaugeMotion(kind, f"a trade-off {among}: ", a)
    return GaugeMotion("mixed", "", a)


def _null_nearby(d: "Diagnosis", space: NullSpace, moved: Index) -> bool | None:
    """Whether at the points nearby, too, these numbers alone undo each other; None if unknown.

    With no more rows than the rank, some numbers undo each other at any point, which says nothing.
    """
    if not space.nearby or d.constrained.rank >= d.constrained.stacked.shape[0]:
        return None
    largest = (
        np.linalg.svd(basis[moved], compute_uv=False).max(initial=0.0) for _, basis in space.nearby
    )
    return all(s >= np.sqrt(1 - space.tolerance**2) for s in largest)


def _parallel(v: Array, w: Array) -> bool:
    lengths = float(np.linalg.norm(v) * np.linalg.norm(w))
    return bool(lengths > 0 and abs(abs(v @ w) - lengths) <= INSIDE**2 * lengths)


def _change_at_one_scale(d: "Diagnosis", v: Array) -> float:
    """By how much the residuals change a step along v (n,) of at most one scale of each unknown."""
    x, fixed = d.problem.split(d.values)
    before = d.problem.residual(x, fixed)
    step = v / float(np.max(abs(v) / d.scales.sizes))
    after = d.problem.residual(x + step, fixed)
    if not np.isfinite(after).all():
        return float("inf")
    return float(np.linalg.norm(after - before) / max(1.0, float(np.linalg.norm(before))))


def _direction(
    motion: GaugeMotion,
    v: Array,
    stacked: Linearization,
    here: Linearization,
    free: Layout,
    scales: Array | None = None,
) -> Direction:
    """A motion as a vector v (n,) of the unknowns; constraints are rows of `stacked`."""
    terms = in_units(v, free, here.column_norms, scales=scales)
    name = f"{motion.name}{terms}" if motion.name.endswith(": ") else motion.name or terms
    change = float(np.linalg.norm(stacked.along(v)))
    return Direction(name, motion.kind, motion.joints, v, change, terms)


def _without_rounding(y: Array, lengths: Array, stacked: Linearization, tolerance: float) -> Array:
    """The vector y / lengths, of length 1, without entries whose part in J x counts as nothing."""
    x = y / lengths
    least = max(float(np.linalg.norm(stacked.along(x))), tolerance * float(np.linalg.norm(x)))
    for part in ROUNDING:
        w = np.where(abs(y) > part * abs(y).max(), x, 0.0)
        if np.linalg.norm(stacked.along(w)) <= least:
            return np.asarray(w / np.linalg.norm(w))
    return np.asarray(x / np.linalg.norm(x))
