"""Directions that change no residual, or hardly change any, each with a name and in units.

A null space is found, and searched for motions with a name, in unknowns whose columns have length
1: there rounding is the same for all. A direction is a combination of the basis from the first to
the last step, so that whatever it is called, it lies in the null space.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Layout, Tree
from workbench.blocks.layout import in_units, signed
from workbench.diagnostics.active_set import ConstrainedJacobian
from workbench.diagnostics.bases import MANY, beyond, null_basis, sparsest
from workbench.diagnostics.gauges import PART, SAME, Found, Gauge, GaugeMotion, NullSpace, gauges
from workbench.diagnostics.generators import together
from workbench.diagnostics.joint_motions import JointNullMotion, joint_motions
from workbench.diagnostics.words import listed
from workbench.problem import Linearization
from workbench.threads import limited_threads

if TYPE_CHECKING:
    from workbench.diagnostics.diagnosis import Diagnosis

NEARLY = 0.05  # of its length: what a gauge may have outside of the weak directions
WEAK = 0.99  # sigmas per characteristic scale; a prior as wide as that has 1
SEARCHED = 500  # null directions of a sparse Jacobian, up to which names are looked for
LISTED = 12  # weak directions that are looked for where there are no singular values
FEW = 8  # numbers that undo each other in a ratio of no known form
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
    count, sparse = d.here.shape[1] - d.constrained.rank, d.constrained.sparse
    if not count:
        return ()
    if sparse is not None and count > SEARCHED:
        return tuple(_by_entries(d))
    space, held, free = null_space(d), d.constrained, d.free
    found = Found(space)
    directions = []
    for motion in [*_named(d, found, d.gauges), *_left(d, found)]:
        y = space.basis @ motion.coefficients
        v = _without_rounding(y / np.linalg.norm(y), space.lengths, held.stacked, held.tolerance)
        directions.append(_direction(motion, signed(v), held.stacked, d.here, free, d.scales.sizes))
    return tuple(directions)


def _by_entries(d: "Diagnosis") -> Iterator[Direction]:
    """Null directions that are too many for names, each by its entries."""
    free, null = d.problem.free, d.constrained.null
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
    sparse Jacobian there are LISTED at the most, each named by its entries.
    """
    if not d.weak_count:
        return ()
    if d.sparse is not None:
        with limited_threads():
            s, vectors = d.sparse.weakest(LISTED)
        weak = vectors[:, s < WEAK]
    else:
        spectrum = d.measured.stacked.spectrum
        weak = spectrum.Vt[int(np.sum(spectrum.s > WEAK)) : spectrum.rank].T
    if not weak.shape[1]:
        return ()
    sizes = d.scales.sizes
    space = NullSpace(d.problem.split(d.values)[0], 1 / sizes, weak, NEARLY)
    found = Found(space)
    motions = [GaugeMotion("mixed", "", a) for a in np.eye(weak.shape[1])]
    if d.sparse is None:
        motions = [*_named(d, found), *_left(d, found)]
    directions = []
    for motion in motions:
        v = signed(weak @ motion.coefficients) * sizes
        directions.append(_direction(motion, v, d.constrained.stacked, d.here, d.free, sizes))
    return tuple(sorted(directions, key=lambda one: one.change))


def named_by_joints(
    basis: Array, free: Layout, trees: Sequence[Tree], here: Linearization, same: float = NEARLY
) -> tuple[Direction, ...]:
    """Directions that span an orthonormal basis (n, d), by the motions of joints near to them."""
    space = NullSpace(np.zeros(free.size), np.ones(free.size), basis, same)
    found = Found(space)
    motions = list(of_joints(list(joint_motions(free, trees)), free, found))
    rest = _sparse(space, null_basis(found.known.T, 0.5), found.known)
    motions += [GaugeMotion("mixed", "", a) for a in rest.T]
    return tuple(_direction(m, signed(basis @ m.coefficients), here, here, free) for m in motions)


def null_space(d: "Diagnosis") -> NullSpace:
    """What no residual notices at the point and nearby, its columns having length 1."""
    lengths, sizes = d.constrained.stacked.column_norms, d.scales.sizes
    lengths = np.where(lengths > 0, lengths, 1 / sizes)
    basis = null_in_units(d.constrained, lengths)
    x = d.problem.split(d.values)[0]
    silent = int(np.sum(np.sum(basis**2, axis=1) >= 1 - SAME**2))
    nearby = d.points_nearby if silent < basis.shape[1] else ()
    there = tuple((y, null_in_units(held, lengths)) for y, held in nearby)
    return NullSpace(x, lengths, basis, nearby=there)


def null_in_units(constrained: ConstrainedJacobian, lengths: Array) -> Array:
    """(n, d) an orthonormal basis of the null space of unknowns y = lengths * x.

    The dimension is that of the Jacobian in the unknowns' own units, which decides the rank.
    """
    n = len(lengths)
    d, held = n - constrained.rank, constrained.stacked
    if constrained.sparse is not None or held.estimated:
        null = constrained.null * lengths[:, None]
        return np.asarray(np.linalg.qr(null / np.linalg.norm(null, axis=0))[0])
    read = np.flatnonzero(held.column_norms > 0)
    R = held.unit_triangle[:, read] * (held.column_norms / lengths)[read]
    Vt = np.linalg.svd(R, full_matrices=True)[2]
    basis = np.zeros((n, d))
    silent = np.setdiff1d(np.arange(n), read)[:d]
    basis[silent, np.arange(len(silent))] = 1.0
    basis[read, len(silent) :] = Vt[len(read) - (d - len(silent)) :].T
    return basis


def _named(d: "Diagnosis", found: Found, declared: Sequence[Gauge] = ()) -> Iterator[GaugeMotion]:
    """The motions that have a name: single entries, gauges, motions of joints."""
    problem = d.problem
    free = problem.free
    motions = list(joint_motions(free, problem.trees))
    yield from of_joints([one for one in motions if one.kind == "entry"], free, found)
    if not found.all():
        yield from gauges(problem, d.values, found, d.structure.pattern, declared)
    yield from of_joints([one for one in motions if one.kind != "entry"], free, found)


def of_joints(
    motions: Sequence[JointNullMotion], free: Layout, found: Found, *, apart: bool = True
) -> Iterator[GaugeMotion]:
    """The motions that move the entries of one of these subspaces alone, or nearly so.

    Several of one subspace are told apart by few entries, if they are to be.
    """
    space = found.space
    parts = np.sum(space.basis**2, axis=1)
    for motion in motions:
        if found.all():
            return
        at = motion.entries
        if parts[at].sum() < 1 - space.same**2 - 1e-12:
            continue
        _, s, Vt = np.linalg.svd(space.basis[at], full_matrices=False)
        inside = Vt[s >= np.sqrt(1 - space.same**2)].T
        if not inside.shape[1]:
            continue
        new = beyond(found.known, inside)[1]
        several = new.shape[1] > 1
        if several and apart:
            new = _sparse(space, new, found.known)
        for a in new.T:
            v = space.basis @ a
            if not found.adds(a):
                continue
            name, joints = motion.called(v / space.lengths, free, max(SAME, space.same))
            whole = motion.kind == "entry" or (motion.kind == "twist" and not several)
            yield GaugeMotion(
                motion.kind, name if whole and space.exact else f"{name}: ", a, joints
            )


def _sparse(space: NullSpace, new: Array, known: Array) -> Array:
    """Coefficients (d, k) that with those known span the same, of vectors with few entries."""
    vectors = sparsest(np.linalg.qr(space.basis @ new)[0], space.basis @ known)
    return np.asarray(space.basis.T @ vectors)


def _left(d: "Diagnosis", found: Found) -> Iterator[GaugeMotion]:
    """What has no other name: a few numbers that undo each other, or many."""
    space = found.space
    if found.all():
        return
    if len(space.basis) > MANY and space.exact:
        yield from _of_rows(d, found)
    rest = null_basis(found.known.T, 0.5)
    for a in _sparse(space, rest, found.known).T if rest.size else ():
        if found.adds(a):
            yield _unnamed(d, space, a)
    for a in null_basis(found.known.T, 0.5).T:  # such as rounding took away
        yield _unnamed(d, space, a)


def _of_rows(d: "Diagnosis", found: Found) -> Iterator[GaugeMotion]:
    """Motions of one row of a block alone: of a point that one camera sees, along its ray."""
    space, free = found.space, d.problem.free
    for block in free.blocks:
        wide = block.shape[-1] if len(block.shape) > 1 else block.size
        at = np.arange(free.slices[block.name].start, free.slices[block.name].stop)
        if wide <= 1:
            continue
        for row in at.reshape(-1, wide):
            _, s, Vt = np.linalg.svd(space.basis[row], full_matrices=False)
            for a in Vt[s >= np.sqrt(1 - SAME**2)]:
                if found.adds(a):
                    yield _unnamed(d, space, a)


def _unnamed(d: "Diagnosis", space: NullSpace, a: Array) -> GaugeMotion:
    """A trade-off of a few numbers, or a direction that has only its entries for a name.

    Numbers that undo each other nearby too, or however far, are a trade-off, unless there are too
    few rows for all; one at this point alone is no gauge. What holds to first order only says so.
    """
    free, v = d.problem.free, space.basis @ a
    some = np.flatnonzero(abs(v) > PART * abs(v).max())
    change = _one_scale(d, v / space.lengths) if space.exact else 0.0
    straight = change <= SAME
    counted = d.constrained.rank >= d.constrained.stacked.shape[0]
    everywhere = bool(space.nearby) and not counted
    for _, basis in space.nearby if everywhere else ():
        s = np.linalg.svd(basis[some], compute_uv=False)
        everywhere &= bool(s.max(initial=0.0) >= np.sqrt(1 - space.same**2))
    here_alone = bool(space.nearby) and not counted and not everywhere
    blocks = list(dict.fromkeys(free.block_of(int(i))[0].name for i in some))
    own = together(free, blocks)
    if (
        space.exact
        and straight
        and own.size > 1
        and _parallel(v[own], (space.x * space.lengths)[own])
    ):
        return GaugeMotion("scale", f"a common factor of {listed(blocks)}", a)
    if space.exact and len(some) <= FEW and (straight or everywhere):
        among = f"within {blocks[0]}" if len(blocks) == 1 else f"of {listed(blocks)}"
        kind = "mixed" if here_alone else "trade-off"
        return GaugeMotion(kind, f"a trade-off {among}: ", a)
    if straight or everywhere:
        return GaugeMotion("mixed", "", a)
    return GaugeMotion("mixed", f"to first order ({change:.2g} sigma at one scale): ", a)


def _parallel(v: Array, w: Array) -> bool:
    lengths = float(np.linalg.norm(v) * np.linalg.norm(w))
    return bool(lengths > 0 and abs(abs(v @ w) - lengths) <= SAME**2 * lengths)


def _one_scale(d: "Diagnosis", v: Array) -> float:
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
    held: Linearization,
    here: Linearization,
    free: Layout,
    scales: Array | None = None,
) -> Direction:
    """A motion as a vector v (n,) of the unknowns."""
    terms = in_units(v, free, here.column_norms, scales=scales)
    name = f"{motion.name}{terms}" if motion.name.endswith(": ") else motion.name or terms
    change = float(np.linalg.norm(held.along(v)))
    return Direction(name, motion.kind, motion.joints, v, change, terms)


def _without_rounding(y: Array, lengths: Array, held: Linearization, tolerance: float) -> Array:
    """The vector y / lengths, of length 1, without entries whose part in J x counts as nothing."""
    x = y / lengths
    least = max(float(np.linalg.norm(held.along(x))), tolerance * float(np.linalg.norm(x)))
    for part in ROUNDING:
        w = np.where(abs(y) > part * abs(y).max(), x, 0.0)
        if np.linalg.norm(held.along(w)) <= least:
            return np.asarray(w / np.linalg.norm(w))
    return np.asarray(x / np.linalg.norm(x))
