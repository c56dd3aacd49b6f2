"""The directions that no residual notices, or hardly notices, each with a name."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csc_array

from workbench.arrays import Array
from workbench.blocks import Layout
from workbench.diagnostics.named_subspaces import MANY, NamedSubspace, named_subspaces
from workbench.diagnostics.point import Point
from workbench.diagnostics.turned_joints import named_by_joints
from workbench.problem import Linearization

WEAK = 0.99  # sigmas per yardstick; a prior as wide as the yardstick has 1
FRESH = 1e-6  # sine of the angle to what is known, above which a direction is another one
CLEARLY_FRESH = 0.1
ALIKE = 1e-6  # entries of a direction that differ by less are of one size


@dataclass(frozen=True, eq=False)
class Direction:
    """A unit vector (n,) of free numbers, and how much the whitened residual changes along it.

    Attributes:
        name: what the direction is called in reports.
        kind: `entry`, `twist`, `joint`, `shift`, `block` or `mixed`.
        joints: the joints that it turns, as far as they are known.
        vector: (n,) the direction.
        change: |J d|, in sigmas per unit of the direction.
    """

    name: str
    kind: str
    joints: tuple[str, ...]
    vector: Array = field(repr=False)
    change: float


def null_directions(point: Point, pattern: csc_array) -> tuple[Direction, ...]:
    """Directions that change no residual and that no constraint forbids, with names.

    `pattern` (m, n) is where the Jacobian can be nonzero.
    """
    if point.constrained.rank == point.here.shape[1]:
        return ()
    here = point.constrained.stacked
    named = _dictionary(point, pattern)
    return directions(here, point.problem.free, named, here.spectrum.tolerance)


def weak_directions(point: Point, pattern: csc_array) -> tuple[Direction, ...]:
    """What changes the residuals by less than one sigma for a whole yardstick; weakest first.

    The vectors have length 1 once every unknown is measured by its own yardstick.
    """
    nothing = point.constrained.rank == point.here.shape[1] and not count_weak(point)
    if point.here.estimated or nothing:
        return ()
    here, sizes = point.measured.stacked, point.yardsticks.sizes
    found = directions(here, point.problem.free, _dictionary(point, pattern), WEAK)
    noticed = (d for d in found if d.change > here.spectrum.tolerance)
    return tuple(
        replace(d, vector=d.vector * sizes) for d in sorted(noticed, key=lambda d: d.change)
    )


def count_weak(point: Point) -> int:
    """How many directions change the residuals by less than a sigma per yardstick."""
    noticed = point.constrained.reduced.spectrum.rank
    return int(np.sum(point.measured.reduced.spectrum.s[:noticed] < WEAK))


def _dictionary(point: Point, pattern: csc_array) -> Iterator[NamedSubspace]:
    return named_subspaces(point.problem.free, point.problem.trees, pattern)


def null_basis(A: Array, tolerance: float) -> Array:
    """(n, d) orthonormal: what A (m, n) maps below `tolerance` times the length."""
    n = A.shape[1]
    if not n:
        return np.zeros((0, 0))
    R = scipy.linalg.qr(A, mode="r")[0][:n] if len(A) > n else A
    _, s, Vt = np.linalg.svd(R, full_matrices=True)
    return np.asarray(Vt[int(np.sum(s > tolerance)) :].T)


def directions(
    here: Linearization, free: Layout, dictionary: Iterable[NamedSubspace], tolerance: float
) -> tuple[Direction, ...]:
    """A basis of what J maps below `tolerance` times the length: named motions first.

    What no motion of the dictionary covers is made as sparse as it can be (least sum of absolute
    values), and named by its largest entries.
    """
    s, Vt = here.spectrum.s, here.spectrum.Vt
    null = Vt[int(np.sum(s > tolerance)) :].T
    total = null.shape[1]
    if not total:
        return ()
    gram = here.R.T @ here.R
    silent = np.linalg.norm(here.R, axis=0) <= tolerance  # entries: null directions by themselves
    known = np.eye(free.size)[:, silent]  # orthonormal basis of what was found
    searched: set[bytes] = set()
    found: list[Direction] = []
    for motion in dictionary:
        if len(found) == total:
            break
        entries, basis = motion.entries, motion.basis
        if motion.kind == "entry":
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
        if _all_seen(gram[np.ix_(entries, entries)], basis, tolerance):
            continue
        moved = here.R[:, entries]
        if basis is None:
            local = null_basis(moved, tolerance)
        else:  # along the axes, where it may be
            local = null_basis(moved @ basis, tolerance)
            local = basis @ sparsest(local, np.zeros((len(local), 0)))
        if not local.shape[1]:
            continue
        vectors = np.zeros((free.size, local.shape[1]))
        vectors[entries] = local
        fresh, new = _beyond(known, vectors)
        if new.shape[1] > 1 and motion.kind != "shift":
            new = _inside(sparsest(new, known), null, here.R)
        several = new.shape[1] > 1
        found += [_direction(motion, v, here, free, tolerance, several=several) for v in new.T]
        known = np.column_stack([known, fresh])
    found = found[:total]
    if len(found) < total and here.uneven:  # whose small entries a linear program would lose
        rest = null[:, np.linalg.norm(null - known @ (known.T @ null), axis=0) > FRESH]
        found += [_mixed(v, here, free) for v in rest[:, : total - len(found)].T]
    elif len(found) < total:
        rest, _ = _beyond(known, null)
        rest = rest[:, : total - len(found)]
        found += [_mixed(v, here, free) for v in _inside(sparsest(rest, known), null, here.R).T]
    return tuple(found)


def _all_seen(gram: Array, basis: Array | None, tolerance: float) -> bool:
    """Whether all of a subspace surely changes the residuals, by its part of J'J."""
    G = gram if basis is None else basis.T @ gram @ basis
    return bool(np.linalg.eigvalsh(G)[0] > tolerance**2 + 1e-12 * np.trace(gram))


def _beyond(known: Array, vectors: Array) -> tuple[Array, Array]:
    """An orthonormal basis of what `vectors` span beyond `known`, and the combinations of
    `vectors` (so within their support) that lead furthest there.
    """
    rest = vectors - known @ (known.T @ vectors)
    rest -= known @ (known.T @ rest)
    U, s, Vt = np.linalg.svd(rest, full_matrices=False)
    if s.size == vectors.shape[1] and (s > CLEARLY_FRESH).all():
        return U, vectors
    return U[:, s > FRESH], np.asarray(vectors @ Vt[s > FRESH].T)


def sparsest(basis: Array, known: Array) -> Array:
    """Vectors (n, d) of length 1 that span the same together with `known`, of few entries each.

    Each is the one of least sum |v_i| among those whose entry at a pivot is 1: a linear program
    over the basis and over what is known already. Of more than 400 entries, the vectors that are
    1 at one pivot and 0 at the others.
    """
    n, d = basis.shape
    if not d:
        return basis
    pivots = scipy.linalg.qr(basis.T, mode="r", pivoting=True)[1][:d]
    if n > MANY:
        return _echelon(basis, pivots)
    space = np.column_stack([basis, known])
    space = space / np.linalg.norm(space, axis=0)
    k = space.shape[1]
    chosen: list[Array] = []
    done = known
    for pivot in pivots:
        # v = space c = plus - minus; least sum of both; v[pivot] = 1
        cost = np.concatenate([np.zeros(k), np.ones(2 * n)])
        equal = np.hstack([space, -np.eye(n), np.eye(n)])
        at_pivot = np.concatenate([space[pivot], np.zeros(2 * n)])
        answer = linprog(
            cost,
            A_eq=np.vstack([equal, at_pivot]),
            b_eq=np.append(np.zeros(n), 1.0),
            bounds=[(None, None)] * k + [(0, None)] * (2 * n),
            method="highs",
        )
        v = np.zeros(n) if answer.x is None else space @ answer.x[:k]
        fresh = _beyond(done, v[:, None] / (float(np.linalg.norm(v)) or 1.0))[0]
        if fresh.shape[1]:
            chosen.append(_polished(v, space))
            done = np.column_stack([done, fresh])
    left = _beyond(done, basis)[0][:, : d - len(chosen)]
    return np.column_stack([*(v[:, None] for v in chosen), left])


def _echelon(basis: Array, pivots: NDArray[np.signedinteger]) -> Array:
    """A basis of the same space, each vector 1 at its own pivot and 0 at the others'."""
    vectors = np.linalg.solve(basis[pivots].T, basis.T).T
    vectors[abs(vectors) < 1e-7 * abs(vectors).max(axis=0)] = 0
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0))


def _inside(vectors: Array, null: Array, R: Array) -> Array:
    """Back into the null space, which a linear program meets only nearly; zeros stay zero."""
    exact = np.where(vectors == 0, 0.0, null @ (null.T @ vectors))
    worse = np.linalg.norm(R @ exact, axis=0) > np.linalg.norm(R @ vectors, axis=0)
    return np.where(worse, vectors, exact)


def _polished(v: Array, space: Array) -> Array:
    """v of length 1, its tiny entries set to zero exactly where the space allows it."""
    keep = abs(v) > 1e-7 * abs(v).max()
    if keep.all():
        return np.asarray(v / np.linalg.norm(v))
    allowed = null_basis(space[~keep], 1e-9 * float(np.linalg.norm(space, 2)))
    exact = space @ (allowed @ (allowed.T @ np.linalg.lstsq(space, v)[0]))
    exact = np.where(keep, exact, 0.0)
    if np.linalg.norm(exact - v) > 1e-5 * np.linalg.norm(v):
        exact = v
    return np.asarray(exact / np.linalg.norm(exact))


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
    name, joints = named_by_joints(motion, v, here.R, free, limit)
    told = name == motion.name and motion.kind not in ("block", "joint")
    if not told or (several and motion.kind == "twist"):
        name = f"{name}: {dominant(v, free)}"
    if motion.kind == "shift":
        name = f"{name}, along {along_axes(v, motion)}"
    return Direction(name, motion.kind, joints, v, float(np.linalg.norm(here.along(v))))


def _mixed(v: Array, here: Linearization, free: Layout) -> Direction:
    v = signed(v)
    return Direction(dominant(v, free), "mixed", (), v, float(np.linalg.norm(here.along(v))))


def signed(v: Array) -> Array:
    """The vector scaled to length 1, the first of its largest entries positive."""
    v = v / np.linalg.norm(v)
    return np.asarray(v * np.sign(v[np.argmax(abs(v) > (1 - ALIKE) * abs(v).max())]))


def along_axes(v: Array, motion: NamedSubspace) -> str:
    """`x`, or `0.60 x + 0.80 z`, of a shift's first block."""
    first = v[motion.entries[:3]]
    first = first / (float(np.linalg.norm(first)) or 1.0)
    terms = [f"{c:.2f} {a}" for c, a in zip(first, "xyz", strict=True) if abs(c) > 1e-6]
    return terms[0].split()[1] if len(terms) == 1 else " + ".join(terms).replace("+ -", "- ")


def dominant(v: Array, free: Layout, most: int = 4) -> str:
    """The largest entries of a direction: `0.71 betas[3] - 0.70 trans[z] + ...`."""
    size = np.round(abs(v) / abs(v).max() / ALIKE)  # so that rounding does not shuffle equals
    order = [int(i) for i in np.argsort(-size, kind="stable") if size[i] * ALIKE > 0.05]
    terms = [f"{'-' if v[i] < 0 else '+'} {abs(v[i]):.2f} {free.label(i)}" for i in order[:most]]
    return " ".join(terms).removeprefix("+ ") + (" + ..." if len(order) > most else "")
