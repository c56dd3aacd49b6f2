"""Which motions the other unknowns can undo, so that no residual changes: a linear question."""

from collections.abc import Callable, Iterator

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout

SAME = 1e-6  # of its length: a motion that misses the null space by less lies in it


def undone(moves: Array, others: Array, null: Array) -> Iterator[tuple[Array, Array]]:
    """Combinations of moves (n, g) that lie in the null space together with others (n, c).

    For each: the whole motion (n,), and its coefficients (g,). There are as many as are
    independent.
    """
    coefficients, undo = undoing(moves, others, null)
    for a in coefficients.T:
        yield moves @ a + others @ undo(a), a


def undoing(moves: Array, others: Array, null: Array) -> tuple[Array, Callable[[Array], Array]]:
    """Of moves (n, g) and others (n, c): which combinations of moves the others undo, and how.

    The first is a basis (g, q) of coefficients, the second makes the others' coefficients of them.
    """
    lengths = np.linalg.norm(moves, axis=0)
    lengths[lengths == 0] = 1.0
    seen = outside(moves / lengths, null)
    back = outside(others, null)
    U, s, Vt = np.linalg.svd(back, full_matrices=False)
    strong = s > SAME
    U = U[:, strong]
    _, left, Wt = np.linalg.svd(seen - U @ (U.T @ seen), full_matrices=True)
    small = np.ones(len(Wt), dtype=bool)
    small[: len(left)] = left <= SAME
    found = Wt[small].T / lengths[:, None]
    found = np.linalg.qr(found)[0] if found.shape[1] else found

    def undo(a: Array) -> Array:
        return np.asarray(-(Vt[strong].T / s[strong]) @ (U.T @ (outside(moves @ a, null))))

    return found, undo


def outside(vectors: Array, null: Array) -> Array:
    """What of vectors (n, ...) lies outside the null space, of orthonormal basis null (n, d)."""
    return np.asarray(vectors - null @ (null.T @ vectors))


def unit_vectors(places: Index, n: int) -> Array:
    """A unit vector for each of these places, (n, q)."""
    found = np.zeros((n, len(places)))
    found[places, np.arange(len(places))] = 1.0
    return found


def places_of(free: Layout, block: Block) -> Index:
    """The places of a block's entries among the free numbers."""
    at = free.slices[block.name]
    return np.arange(at.start, at.stop)
