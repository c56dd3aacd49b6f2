"""Which motions the other unknowns can undo, so that no residual changes: a linear question.

A motion is a field: how the unknowns move, wherever they are. At one point almost any motion may
happen to be undone. A gauge is undone everywhere, in the same combination, so that the question is
asked at the point itself and at a few points nearby.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout

SAME = 1e-6  # of its length: a motion that misses the null space by less lies in it
CLOSE = 1e-4  # between coefficients of motions, from spaces that are known up to SAME
NEW = 1e-6  # of its length: what a motion has outside of those found before, to be a new one

Field = Callable[[Array], Array]  # from unknowns (n,) to how they move, (n, g)


@dataclass(frozen=True, eq=False)
class Unseen:
    """The motions that no residual notices, or that residuals hardly notice.

    Attributes:
        x: (n,) the point.
        basis: (n, d) an orthonormal basis of them.
        same: how much of its length a motion may have outside of them and still count as one.
        nearby: other points (n,), each with its own basis (n, d'). Without them, motions are judged
            at the point alone.
    """

    x: Array = field(repr=False)
    basis: Array = field(repr=False)
    same: float = SAME
    nearby: tuple[tuple[Array, Array], ...] = field(default=(), repr=False)

    @property
    def exact(self) -> bool:
        """Whether motions miss the space by rounding alone."""
        return self.same <= SAME

    @property
    def count(self) -> int:
        """d, the dimension."""
        return len(self.basis.T)

    @property
    def everywhere(self) -> tuple[tuple[Array, Array], ...]:
        """The point and those nearby, each with its basis."""
        return ((self.x, self.basis), *self.nearby)

    def missed(self, moves: Field, lengths: Array) -> Array:
        """What of moves (n, g), in units of `lengths` (g,), residuals notice, at all points."""
        found = [(moves(x) / lengths, basis) for x, basis in self.everywhere]
        return np.vstack([v - basis @ (basis.T @ v) for v, basis in found])

    def fixed(self, places: Index) -> int:
        """How many ways of moving these unknowns others cannot undo; 0 if they may move anyhow.

        The fewer there are, the less it says of a motion that others undo it.
        """
        s = np.linalg.svd(self.basis[places], compute_uv=False)
        return len(places) - int(np.sum(s > self.same))

    def undone_in_one_way(self, places: Index) -> bool:
        """Whether a motion of these unknowns leaves the others no choice."""
        return len(places) - self.fixed(places) == self.count


class Found:
    """The motions that were found so far, as an orthonormal basis (n, k); not their names."""

    def __init__(self, unseen: Unseen) -> None:
        self.basis = unit_vectors(silent_places(unseen.basis), len(unseen.basis))
        self._unseen = unseen

    def all(self) -> bool:
        """Whether nothing is left to be found."""
        return self._unseen.exact and len(self.basis.T) >= self._unseen.count

    def does(self, move: Array, places: Index) -> bool:
        """Whether some combination of them moves the unknowns at these places as `move` (q,) does.

        Then another motion that does the same differs from it only in what others do.
        """
        U, s, _ = np.linalg.svd(self.basis[places], full_matrices=False)
        U = U[:, s > self._unseen.same]
        outside = move - U @ (U.T @ move)
        return self._unseen.exact and bool(np.linalg.norm(outside) <= CLOSE * np.linalg.norm(move))

    def left(self, places: Index) -> bool:
        """Whether these unknowns may move in ways in which nothing found so far moves them."""
        ways = len(places) - self._unseen.fixed(places)
        return ways > int(np.sum(np.linalg.svd(self.basis[places], compute_uv=False) > NEW))

    def adds(self, v: Array) -> bool:
        """Whether a motion (n,) is a new one, which then counts as found."""
        if not self._unseen.exact:
            return True
        length = np.linalg.norm(v)
        new = v - self.basis @ (self.basis.T @ v)
        new -= self.basis @ (self.basis.T @ new)
        if not length or np.linalg.norm(new) <= NEW * length:
            return False
        self.basis = np.column_stack([self.basis, new / np.linalg.norm(new)])
        return True


def undoing(field: Field, others: Index, unseen: Unseen) -> tuple[Array, Callable[[Array], Array]]:
    """Which combinations of moves (n, g) these other unknowns undo, and the whole motions.

    The first is a basis (g, q) of coefficients, the same at all points; the second makes the motion
    (n,) of coefficients (g,): the smallest one that is as the moves want it everywhere but in the
    others.
    """
    moves = field(unseen.x)
    rest = np.ones(len(moves), dtype=bool)
    rest[others] = False
    lengths = np.linalg.norm(moves, axis=0)
    lengths[lengths == 0] = 1.0
    missed = []
    for x, basis in unseen.everywhere:
        U, s, _ = np.linalg.svd(basis[rest], full_matrices=False)
        U = U[:, s > unseen.same]
        wanted = field(x)[rest] / lengths
        missed.append(wanted - U @ (U.T @ wanted))
    found = nothing(np.vstack(missed), unseen.same) / lengths[:, None]
    found = np.linalg.qr(found)[0] if found.shape[1] else found

    def whole(a: Array) -> Array:
        wanted, space = moves @ a, unseen.basis
        still = rest & (wanted == 0)
        if unseen.exact and still.any():  # so that rounding moves nothing that should stay
            space = space @ nothing(space[still], unseen.same)
        U, s, Vt = np.linalg.svd(space[rest], full_matrices=False)
        strong = s > unseen.same
        v = space @ (Vt[strong].T / s[strong] @ (U[:, strong].T @ wanted[rest]))
        return np.where(still, 0.0, v) if unseen.exact else v

    return found, whole


def at_the_point(unseen: Unseen) -> Unseen:
    """The same at the point alone."""
    return Unseen(unseen.x, unseen.basis, unseen.same)


def undone(field: Field, others: Index, unseen: Unseen) -> Iterator[tuple[Array, Array]]:
    """The motions (n,) that `undoing` finds, each with its coefficients (g,)."""
    coefficients, whole = undoing(field, others, unseen)
    for a in coefficients.T:
        v = whole(a)
        if v.any():  # and not a turn of points about the line on which they all lie
            yield v, a


def undone_by_few(
    field: Field, choices: Sequence[Index], unseen: Unseen
) -> Iterator[tuple[Array, Array]]:
    """The motions (n,) of one field (n, 1) that the fewest of these groups of unknowns undo.

    Where one group suffices, each that does gives a motion; otherwise all take part.
    """
    together = np.concatenate([np.zeros(0, dtype=np.int64), *choices])
    every = [*undone(field, together, unseen)]
    if not every:
        return
    nobody = [*undone(field, together[:0], unseen)]
    single = [] if nobody else [one for some in choices for one in undone(field, some, unseen)]
    yield from nobody or single or every


def undone_maps(Q: Array, wanted: Array) -> Array:
    """Which of the wanted coefficients (g, w) lie in a space with the orthonormal basis Q: (w,)."""
    W = wanted / np.linalg.norm(wanted, axis=0)
    return np.asarray(np.linalg.norm(W - Q @ (Q.T @ W), axis=0) <= CLOSE)


def common(Q: Array, allowed: Array) -> Array:
    """An orthonormal basis of what two spaces with orthonormal bases (g, q) and (g, a) share."""
    U, s, _ = np.linalg.svd(allowed.T @ Q, full_matrices=False)
    return np.asarray(allowed @ U[:, s > 1 - CLOSE**2])


def with_fewer(field: Field, choices: Sequence[Index], a: Array, unseen: Unseen) -> Array:
    """The motion (n,) of the combination a (g,) of moves, undone by as few groups as may be.

    One group after the other is left out if the rest can undo the same combination, the last first.
    """
    left, nobody = list(choices), np.zeros(0, dtype=np.int64)
    along: Field = lambda x: field(x) @ a[:, None]  # noqa: E731
    for one in reversed(choices):
        fewer = [some for some in left if some is not one]
        if undoing(along, np.concatenate([nobody, *fewer]), unseen)[0].shape[1]:
            left = fewer
    found = [v for v, _ in undone(along, np.concatenate([nobody, *left]), unseen)]
    return found[0] if found else np.zeros(len(unseen.x))


def nothing(A: Array, same: float) -> Array:
    """An orthonormal basis of what A (m, g) takes to nothing, up to `same`."""
    _, s, Vt = np.linalg.svd(A, full_matrices=len(A) < len(A.T))
    small = np.ones(len(Vt), dtype=bool)
    small[: len(s)] = s <= same
    return np.asarray(Vt[small].T)


def silent_places(basis: Array) -> Index:
    """The places of unknowns that nothing reads, by an orthonormal basis (n, d) of what is unseen.

    Each may move by itself: its unit vector misses the space by rounding alone.
    """
    return np.flatnonzero(np.sum(basis**2, axis=1) >= 1 - SAME**2)


def places_of(free: Layout, block: Block) -> Index:
    """The places of a block's entries among the free numbers."""
    at = free.slices[block.name]
    return np.arange(at.start, at.stop)


def places(free: Layout, blocks: Sequence[Block]) -> Index:
    """The places of the entries of some blocks."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *(places_of(free, b) for b in blocks)])


def unit_vectors(places: Index, n: int) -> Array:
    """A unit vector for each of these places, (n, q)."""
    found = np.zeros((n, len(places)))
    found[places, np.arange(len(places))] = 1.0
    return found


def only(at: Index, n: int, moves: Callable[[Array], Array]) -> Field:
    """The field that moves the unknowns at these places, by `moves` from them (q,) to (q, g)."""

    def field(x: Array) -> Array:
        there = moves(x[at])
        found = np.zeros((n, there.shape[1]))
        found[at] = there
        return found

    return field
