"""Which motions the other unknowns can undo, so that no residual changes: a linear question."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout

SAME = 1e-6  # of its length: a motion that misses the null space by less lies in it


@dataclass(frozen=True, eq=False)
class Unseen:
    """The motions that no residual notices, or that residuals hardly notice.

    Attributes:
        basis: (n, d) an orthonormal basis of them.
        same: how much of its length a motion may have outside of them and still count as one.
    """

    basis: Array = field(repr=False)
    same: float = SAME

    @property
    def exact(self) -> bool:
        """Whether motions miss the space by rounding alone."""
        return self.same <= SAME

    @property
    def count(self) -> int:
        """d, the dimension."""
        return len(self.basis.T)

    def outside(self, vectors: Array) -> Array:
        """What of vectors (n, ...) lies outside."""
        return np.asarray(vectors - self.basis @ (self.basis.T @ vectors))

    def within(self, v: Array) -> Array | None:
        """The motion (n,), moved into the space; None if it is none that counts as unseen."""
        out = self.outside(v)
        if np.linalg.norm(out) > self.same * np.linalg.norm(v):
            return None
        return v if self.exact else v - out


def undoing(moves: Array, others: Index, unseen: Unseen) -> tuple[Array, Callable[[Array], Array]]:
    """Which combinations of moves (n, g) these other unknowns undo, and the whole motions.

    The first is a basis (g, q) of coefficients, the second makes the motion (n,) of coefficients
    (g,): the smallest one that is as the moves want it everywhere but in the others.
    """
    rest = np.ones(len(moves), dtype=bool)
    rest[others] = False
    lengths = np.linalg.norm(moves, axis=0)
    lengths[lengths == 0] = 1.0
    U, s, Vt = np.linalg.svd(unseen.basis[rest], full_matrices=False)
    strong = s > unseen.same
    U, back = U[:, strong], Vt[strong].T / s[strong]
    wanted = moves[rest] / lengths
    found = _nothing(wanted - U @ (U.T @ wanted), unseen.same) / lengths[:, None]
    found = np.linalg.qr(found)[0] if found.shape[1] else found

    def whole(a: Array) -> Array:
        v = unseen.basis @ (back @ (U.T @ (moves[rest] @ a)))
        if unseen.exact:  # so that rounding moves nothing that should stay
            v[rest] = np.where(moves[rest] @ a == 0, 0.0, v[rest])
        return np.asarray(v)

    return found, whole


def undone(moves: Array, others: Index, unseen: Unseen) -> Iterator[tuple[Array, Array]]:
    """The motions (n,) that `undoing` finds, each with its coefficients (g,)."""
    coefficients, whole = undoing(moves, others, unseen)
    for a in coefficients.T:
        v = whole(a)
        if v.any():  # and not a turn of points about the line on which they all lie
            yield v, a


def undone_alike(move: Array, others: Array, unseen: Unseen) -> Array | None:
    """The move (n,) together with some combination of others (n, c); None if none undoes it."""
    back = unseen.outside(others)
    U, s, Vt = np.linalg.svd(back, full_matrices=False)
    strong = s > unseen.same
    seen = unseen.outside(move)
    return unseen.within(move - others @ (Vt[strong].T / s[strong]) @ (U[:, strong].T @ seen))


def _nothing(A: Array, same: float) -> Array:
    """An orthonormal basis of what A (m, g) takes to nothing."""
    _, s, Vt = np.linalg.svd(A, full_matrices=len(A) < len(A.T))
    small = np.ones(len(Vt), dtype=bool)
    small[: len(s)] = s <= same
    return np.asarray(Vt[small].T)


def places_of(free: Layout, block: Block) -> Index:
    """The places of a block's entries among the free numbers."""
    at = free.slices[block.name]
    return np.arange(at.start, at.stop)


def unit_vectors(places: Index, n: int) -> Array:
    """A unit vector for each of these places, (n, q)."""
    found = np.zeros((n, len(places)))
    found[places, np.arange(len(places))] = 1.0
    return found
