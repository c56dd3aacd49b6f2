"""Directions that change no residual, or hardly change any, each with a name."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Index
from workbench.blocks import Layout
from workbench.blocks.directions import dominant, signed
from workbench.diagnostics.gauges import Gauge, gauges
from workbench.diagnostics.named_subspaces import NamedSubspace, in_sizes, named_subspaces
from workbench.diagnostics.nearby_points import nearby_null_spaces
from workbench.diagnostics.point import Point
from workbench.diagnostics.polishing import polished, stepped
from workbench.diagnostics.rest_gauges import rest_gauges
from workbench.diagnostics.sparse_bases import FRESH, beyond, null_basis, sparsest
from workbench.diagnostics.sparse_jacobian import SparseJacobian
from workbench.diagnostics.turned_joints import named_by_joints
from workbench.diagnostics.undoing import SAME, Unseen, silent_places, unit_vectors
from workbench.problem import Linearization
from workbench.problem.storage import by_nonzeros
from workbench.threads import limited_threads

NEARLY = 0.05  # of its length: what a gauge may have outside of the weak directions
WEAK = 0.99  # sigmas per yardstick; a prior as wide as the yardstick has 1
ZERO = 1e-6  # entries of a direction that are only rounding
LISTED = 12  # weak directions that are looked for where there are no singular values


@dataclass(frozen=True, eq=False)
class Direction:
    """A unit vector (n,) of free numbers, and how much the whitened residual changes along it.

    Attributes:
        name: what the direction is called in reports.
        kind: of gauges `translation`, `rotation`, `scale`, `offset`, `mixing`, `projective` or
            `gauge`, and `trade-off` where single numbers undo each other; of others `entry`,
            `twist`, `joint`, `shift`, `block` or `mixed`.
        joints: the joints that it turns, as far as they are known.
        vector: (n,) the direction.
        change: |J d|, in sigmas per unit of the direction.
    """

    name: str
    kind: str
    joints: tuple[str, ...]
    vector: Array = field(repr=False)
    change: float


def null_directions(
    point: Point, pattern: csc_array, declared: Sequence[Gauge] = ()
) -> tuple[Direction, ...]:
    """Directions that change no residual and that no constraint forbids, with names.

    `pattern` (m, n) is where the Jacobian can be nonzero. Gauges come first. Directions are looked
    for, and named, with every block in its yardstick, so that units change no name.
    """
    if point.constrained.rank == point.here.shape[1]:
        return ()
    units = point.block_units
    constrained = point.in_block_units
    null = polished(point.null_in(constrained, units), constrained.stacked, constrained.tolerance)
    x = point.problem.split(point.values)[0] / units
    some = len(silent_places(null)) < len(null.T)
    nearby = nearby_null_spaces(point, pattern, units) if some else ()
    unseen = Unseen(x, null, nearby=nearby)
    motions = _motions(point, pattern, unseen, units, units, declared)
    found = directions(
        constrained.stacked, null, point.problem.free, motions, constrained.tolerance
    )
    held = point.constrained
    return tuple(_in_own_units(d, units, held.stacked, held.tolerance) for d in found)


def _in_own_units(
    direction: Direction, units: Array, here: Linearization, tolerance: float
) -> Direction:
    """A direction that was measured in units, as a vector of length 1 of the unknowns.

    What rounding then leaves of long columns goes by a Newton step of the unknowns that move.
    """
    if (units == 1).all():
        return direction
    v = direction.vector * units
    v, moved = v / np.linalg.norm(v), np.flatnonzero(v)
    if np.linalg.norm(here.along(v)) > tolerance and isinstance(here.jacobian, np.ndarray):
        v[moved] = stepped(v[moved], here.R[:, moved], tolerance)
        v = v / np.linalg.norm(v)
    return replace(direction, vector=v, change=float(np.linalg.norm(here.along(v))))


def weak_directions(point: Point, pattern: csc_array) -> tuple[Direction, ...]:
    """Directions along which a yardstick changes the residuals by less than a sigma, weakest first.

    The vectors have length 1 once every unknown is measured by its own yardstick. Where the rank
    was found by elimination there are LISTED at the most, each named by its largest entries.
    """
    if point.by_elimination is not None:
        return _weakest(point, point.by_elimination)
    nothing = point.constrained.rank == point.here.shape[1] and not count_weak(point)
    if point.here.estimated or nothing:
        return ()
    here, sizes = point.measured.stacked, point.yardsticks.sizes
    values, vectors = here.spectrum.s, here.spectrum.Vt.T
    first, rank = int(np.sum(values > WEAK)), here.spectrum.rank
    null, weak = vectors[:, rank:], vectors[:, first:rank]
    units = point.block_units
    hardly = np.linalg.qr(vectors[:, first:] * (sizes / units)[:, None])[0]
    unseen = Unseen(point.problem.split(point.values)[0] / units, hardly, NEARLY)
    motions = _motions(point, pattern, unseen, units, sizes)
    found = directions(here, weak, point.problem.free, motions, WEAK, null)
    return tuple(replace(d, vector=d.vector * sizes) for d in sorted(found, key=lambda d: d.change))


def count_weak(point: Point) -> int:
    """How many directions change the residuals by less than a sigma per yardstick."""
    if point.by_elimination is not None:
        with limited_threads():
            return point.by_elimination.count_below(WEAK)
    noticed = point.constrained.reduced.spectrum.rank
    return int(np.sum(point.measured.reduced.spectrum.s[:noticed] < WEAK))


def _weakest(point: Point, jacobian: SparseJacobian) -> tuple[Direction, ...]:
    """The directions of the smallest singular values below WEAK, found without the others."""
    if not count_weak(point):
        return ()
    with limited_threads():
        s, vectors = jacobian.weakest(LISTED)
    free, sizes = point.problem.free, point.yardsticks.sizes
    found = (_mixed(v, jacobian.here, free) for v in vectors[:, s < WEAK].T)
    return tuple(replace(d, vector=d.vector * sizes) for d in found)


def _motions(
    point: Point,
    pattern: csc_array,
    unseen: Unseen,
    units: Array,
    sizes: Array,
    declared: Sequence[Gauge] = (),
) -> Iterator[NamedSubspace]:
    """The motions by which directions are named, in `sizes`: gauges come first.

    What is `unseen` is given in `units`, which are the same for all of a block.
    """
    problem, values = point.problem, point.values
    yield from (in_sizes(motion, sizes) for motion in rest_gauges(problem, values))
    for motion in gauges(problem, values, unseen, pattern, declared, units):
        yield in_sizes(motion, sizes / units)
    yield from named_subspaces(problem.free, problem.trees, pattern)


def directions(
    here: Linearization,
    null: Array,
    free: Layout,
    dictionary: Iterable[NamedSubspace],
    tolerance: float,
    named: Array | None = None,
) -> tuple[Direction, ...]:
    """A basis of the directions that J shortens to `tolerance` times their length.

    `null` (n, d) is an orthonormal basis of them, except for those that were `named` already (n, k)
    and are at right angles to it. Motions of the dictionary come first. Directions
    that none of these covers are made as sparse as possible (least sum of absolute values), and
    named by their largest entries.
    """
    total = null.shape[1]
    if not total:
        return ()
    J = here.jacobian
    R = here.R if isinstance(J, np.ndarray) else by_nonzeros(J)
    gram: Any = R.T @ R  # an array, or sparse as R is
    silent = here.column_norms <= tolerance  # entries that are null directions
    if named is not None:
        silent[:] = False
    known = unit_vectors(np.flatnonzero(silent), free.size)  # orthonormal, of what was found
    known = known if named is None else named
    searched: set[bytes] = set()
    found: list[Direction] = []
    for motion in dictionary:
        if len(found) == total:
            break
        entries, basis = motion.entries, motion.basis
        if motion.kind == "entry" and named is None:
            if silent[entries].all():
                v = np.zeros(free.size)
                v[entries] = 1.0
                found.append(_direction(motion, v, here, free, tolerance, several=False))
            continue
        if basis is None:
            entries = entries[~silent[entries]]
            if not entries.size or entries.tobytes() in searched:
                continue
            searched.add(entries.tobytes())
        if _all_seen(_as_array(gram[entries][:, entries]), basis, tolerance):
            continue
        moved = R[:, entries] if basis is None else R[:, entries] @ basis
        if basis is not None and np.linalg.norm(_as_array(moved)) > tolerance:
            entries, basis = _without_rounding(entries, basis, null)
            moved = R[:, entries] @ basis
        local = null_basis(_as_array(moved), tolerance)
        if basis is not None:  # along the axes, where it may be
            local = basis @ sparsest(local, np.zeros((len(local), 0)))
        if not local.shape[1]:
            continue
        vectors = np.zeros((free.size, local.shape[1]))
        vectors[entries] = local
        fresh, new = beyond(known, vectors)
        if new.shape[1] > 1 and motion.kind != "shift":
            new = _inside(sparsest(new, known), null, here)
        several = new.shape[1] > 1
        found += [_direction(motion, v, here, free, tolerance, several=several) for v in new.T]
        known = np.column_stack([known, fresh])
    found = found[:total]
    if len(found) < total and here.uneven:  # whose small entries a linear program would lose
        rest = null[:, np.linalg.norm(null - known @ (known.T @ null), axis=0) > FRESH]
        found += [_mixed(v, here, free) for v in rest[:, : total - len(found)].T]
    elif len(found) < total:
        rest = beyond(known, null)[0] if named is None else null @ _apart(null.T @ known)
        rest = rest[:, : total - len(found)]
        found += [_mixed(v, here, free) for v in _inside(sparsest(rest, known), null, here).T]
    return tuple(found)


def _without_rounding(entries: Index, basis: Array, null: Array) -> tuple[Index, Array]:
    """A single motion as it is in the null space (n, d), if it misses that by rounding alone."""
    if basis.shape[1] > 1:
        return entries, basis
    inside = null @ (null[entries].T @ basis)
    outside = inside.copy()
    outside[entries] -= basis
    if np.linalg.norm(outside) > SAME:
        return entries, basis
    return np.arange(len(null)), inside / np.linalg.norm(inside)


def _apart(A: Array) -> Array:
    """An orthonormal basis of what is at right angles to the columns of A (d, k)."""
    U, s, _ = np.linalg.svd(A, full_matrices=True)
    return np.asarray(U[:, int(np.sum(s > FRESH)) :])


def _all_seen(gram: Array, basis: Array | None, tolerance: float) -> bool:
    """Whether every direction of a subspace surely changes the residuals, by its part of J'J."""
    G = gram if basis is None else basis.T @ gram @ basis
    return bool(np.linalg.eigvalsh(G)[0] > tolerance**2 + 1e-12 * np.trace(gram))


def _as_array(matrix: Array | csc_array) -> Array:
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def _inside(vectors: Array, null: Array, here: Linearization) -> Array:
    """The vectors projected onto the null space, which a linear program leaves a little."""
    exact = np.where(vectors == 0, 0.0, null @ (null.T @ vectors))
    lengths = (np.linalg.norm(here.along(v), axis=0) for v in (exact, vectors))
    worse = np.greater(*lengths)
    return np.where(worse, vectors, exact)


def _direction(
    motion: NamedSubspace,
    v: Array,
    here: Linearization,
    free: Layout,
    limit: float,
    *,
    several: bool,
) -> Direction:
    v = signed(v)
    if motion.kind == "shift" and not abs(v[motion.entries[:3]]).max() > ZERO:
        return _mixed(v, here, free)
    name, joints = named_by_joints(motion, v, here, free, limit)
    says_all = name == motion.name and motion.kind not in ("block", "joint")
    if not says_all or (several and motion.kind == "twist"):
        name = f"{name}: {dominant(v, free)}"
    if motion.kind == "shift":
        name = f"{name}, along {along_axes(v, motion)}"
    return Direction(name, motion.kind, joints, v, float(np.linalg.norm(here.along(v))))


def _mixed(v: Array, here: Linearization, free: Layout) -> Direction:
    v = signed(v)
    return Direction(dominant(v, free), "mixed", (), v, float(np.linalg.norm(here.along(v))))


def along_axes(v: Array, motion: NamedSubspace) -> str:
    """`x`, or `0.60 x + 0.80 z`, of a shift's first block."""
    first = v[motion.entries[:3]]
    first = first / (float(np.linalg.norm(first)) or 1.0)
    terms = [f"{c:.2f} {a}" for c, a in zip(first, "xyz", strict=True) if abs(c) > 1e-6]
    return terms[0].split()[1] if len(terms) == 1 else " + ".join(terms).replace("+ -", "- ")
