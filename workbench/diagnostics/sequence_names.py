"""Names of a sequence's null directions, gathered over the frames that have the same ones."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csc_array, hstack

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Layout
from workbench.blocks.layout import in_units
from workbench.diagnostics.bases import FRESH, beyond
from workbench.diagnostics.gauges import Found, Gauge, NullSpace, gauges
from workbench.diagnostics.joint_motions import JointNullMotion, joint_motions
from workbench.diagnostics.words import counted, gathered

if TYPE_CHECKING:
    from workbench.diagnostics.sequences import SingleFrames

OUTSIDE = 1e-10  # squared part of a direction outside of a motion's entries, up to rounding
LARGE = 10_000_000  # numbers in the null vectors of several frames, up to which gauges are sought
TAKES_PART = 1e-6  # of a direction's length: less is rounding


@dataclass(frozen=True)
class NullDirections:
    """Directions of one name that change no residual.

    Attributes:
        name: what the directions are called in reports.
        joints: the joints that they turn.
        frames: the frames that they move.
        count: how many there are in all frames together.
        tied: whether each of them moves several frames at once; otherwise each moves one frame.
        shared: whether they move unknowns that all frames share; `frames` are then those whose own
            unknowns undo this.
    """

    name: str
    joints: tuple[str, ...]
    frames: tuple[int, ...]
    count: int
    tied: bool = False
    shared: bool = False

    def described(self, total: int) -> str:
        """`a turn of pose[left_wrist] alone, in 200 of 200 frames`."""
        if self.shared:
            return self.name
        where = f"{len(self.frames)} of {total} frames"
        if self.tied:
            return f"{self.name}: {counted(self.count, 'direction')} over {where} together"
        each = self.count / max(1, len(self.frames))
        more = "" if each <= 1 else f" ({each:.3g} directions in each)"
        return f"{self.name}, in {where}{more}"


def named(
    vectors: csc_array, frames: "SingleFrames", declared: Sequence[Gauge] = ()
) -> tuple[NullDirections, ...]:
    """Names of the null vectors (n, d) of a sequence: gauges of all frames first."""
    frame_of, place = frames.places
    over_all, vectors = _over_all_frames(vectors, frames, declared)
    reached = _frames_reached(vectors, frame_of)
    shared = [j for j, some in enumerate(reached) if some[0] < 0]
    tied = [j for j, some in enumerate(reached) if some[0] >= 0 and len(some) > 1]
    local: dict[int, list[int]] = {}
    for j, some in enumerate(reached):
        if some[0] >= 0 and len(some) == 1:
            local.setdefault(int(some[0]), []).append(j)
    dictionary = Dictionary.of(frames.layout, joint_motions(frames.layout, frames.trees))
    several = [*over_all, *_of_shared(csc_array(vectors[:, shared]), frames)]
    if tied:
        several += _gathered(_tied(csc_array(vectors[:, tied]), frames, dictionary))
    groups: dict[tuple[str, str, tuple[str, ...]], dict[int, int]] = {}
    for t, columns in sorted(local.items()):
        here = frame_of == t
        V = np.zeros((frames.layout.size, len(columns)))
        V[place[here]] = vectors[:, columns].toarray()[here]
        for motion, moved in dictionary.names(V[None]):
            key = motion.kind, motion.name, motion.joints
            groups.setdefault(key, {})[t] = moved.shape[-1]
    single = [
        (kind, NullDirections(name, joints, tuple(counts), sum(counts.values())))
        for (kind, name, joints), counts in groups.items()
    ]
    return (*several, *_gathered(single))


def _frames_reached(vectors: csc_array, frame_of: Index) -> list[Index]:
    """The frames that each of the vectors (n, d) moves, rising; -1 is what all frames share."""
    return [np.unique(frame_of[vectors.indices[i:j]]) for i, j in pairwise(vectors.indptr)]


def _over_all_frames(
    vectors: csc_array, frames: "SingleFrames", declared: Sequence[Gauge]
) -> tuple[list[NullDirections], csc_array]:
    """Gauges that move several frames at once, and the null vectors without them.

    They are looked for among the vectors that move several frames, or what frames share.
    """
    frame_of, _ = frames.places
    several = [len(some) > 1 or some[0] < 0 for some in _frames_reached(vectors, frame_of)]
    over = np.flatnonzero(several)
    if not 0 < over.size <= vectors.shape[0] or over.size * vectors.shape[0] > LARGE:
        return [], vectors
    basis = np.linalg.qr(vectors[:, over].toarray())[0]
    problem, values = frames.problem, frames.values
    found, known = [], np.zeros((len(basis), 0))
    space = NullSpace(problem.split(values)[0], np.ones(len(basis)), basis)
    for motion in gauges(problem, values, Found(space), problem.pattern, declared):
        v = basis @ motion.coefficients[:, None]
        v = np.where(abs(v) > TAKES_PART * abs(v).max(), v, 0.0) / np.linalg.norm(v)
        fresh, _ = beyond(known, v)
        if not fresh.shape[1]:
            continue
        known = np.column_stack([known, fresh])
        some = np.unique(frame_of[np.flatnonzero(v)])
        frames_moved = tuple(int(t) for t in some if t >= 0)
        found.append(NullDirections(motion.name, (), frames_moved, 1, tied=True))
        if len(found) == over.size:
            break
    if not found:
        return [], vectors
    rest = basis @ np.linalg.svd(basis.T @ known)[0][:, known.shape[1] :]
    own = csc_array(vectors[:, np.flatnonzero(~np.array(several))])
    return found, csc_array(hstack([own, _by_frame(rest, frame_of)]))


def _by_frame(rest: Array, frame_of: Index) -> csc_array:
    """Vectors (n, d) combined so that as few as can be move what frames share."""
    if not rest.shape[1]:
        return csc_array(rest)
    Vt = np.linalg.svd(rest[frame_of < 0], full_matrices=True)[2]
    combined = rest @ Vt.T
    combined[abs(combined) < TAKES_PART] = 0.0
    return csc_array(combined)


@dataclass(frozen=True, eq=False)
class Dictionary:
    """The motions of one frame by which its null directions are named.

    Attributes:
        layout: the unknowns of the frame.
        subspaces: the motions, smallest first.
        moves: (M, n) which unknowns each motion moves.
    """

    layout: Layout
    subspaces: Sequence[JointNullMotion]
    moves: Mask

    @staticmethod
    def of(layout: Layout, found: Iterable[JointNullMotion]) -> "Dictionary":
        """The dictionary of these subspaces."""
        kept = list(found)
        moves = np.zeros((len(kept), layout.size), dtype=bool)
        for row, motion in zip(moves, kept, strict=True):
            row[motion.entries] = True
        return Dictionary(layout, kept, moves)

    def names(self, V: Array) -> list[tuple[JointNullMotion, Array]]:
        """The motions in the span of V (T, n, d), and for each the directions (T, n, k) of it.

        A motion is one of them if some combination (d,) of the vectors moves its entries alone, in
        all frames; the smallest motions come first.
        """
        T, n, d = V.shape
        Q = np.linalg.qr(V.reshape(T * n, d))[0].reshape(T, n, d)
        gram = np.einsum("tei,tej->eij", Q, Q)  # of each entry; they add up to the unit matrix
        parts = self.moves.astype(float) @ np.einsum("eii->e", gram)
        found: list[tuple[JointNullMotion, Array]] = []
        known = np.zeros((d, 0))
        others = (~self.moves).astype(float)
        inside = np.zeros(len(self.subspaces))  # how many of those that are known a motion has
        for k, motion in enumerate(self.subspaces):
            if known.shape[1] == d:
                break
            if parts[k] < inside[k] + 1 - OUTSIDE:
                continue
            outside = np.eye(d) - gram[motion.entries].sum(axis=0)
            w, basis = np.linalg.eigh(outside)
            combined = basis[:, w < OUTSIDE]
            beyond = combined - known @ (known.T @ combined)
            U, s, _ = np.linalg.svd(beyond, full_matrices=False)
            fresh = U[:, s > FRESH]
            if not fresh.shape[1]:
                continue
            found.append((motion, Q @ fresh))
            known = np.column_stack([known, fresh])
            moved = np.linalg.norm(Q @ fresh, axis=0) ** 2 > OUTSIDE
            inside += np.sum(others @ moved.astype(float) == 0, axis=1)
        if known.shape[1] < d:
            rest = Q @ np.linalg.svd(known, full_matrices=True)[0][:, known.shape[1] :]
            large = np.linalg.norm(rest, axis=(0, 2)) > TAKES_PART
            blocks = [b for b, at in self.layout.slices.items() if large[at].any()]
            name = f"combinations of {' and '.join(blocks)}"
            found.append((JointNullMotion("mixed", name, (), np.flatnonzero(large)), rest))
        return found


def _gathered(found: Iterable[tuple[str, NullDirections]]) -> list[NullDirections]:
    """Null directions with their kinds; single entries of the same frames become one, and lead."""
    entries: dict[tuple[int, ...], list[NullDirections]] = {}
    others = []
    for kind, one in found:
        if kind == "entry":
            entries.setdefault(one.frames, []).append(one)
        else:
            others.append(one)
    first = [
        replace(
            several[0],
            name=", ".join(gathered([one.name for one in several])),
            joints=tuple(dict.fromkeys(joint for one in several for joint in one.joints)),
            count=sum(one.count for one in several),
        )
        for several in entries.values()
    ]
    return [*first, *others]


def _tied(
    vectors: csc_array, frames: "SingleFrames", dictionary: Dictionary
) -> Iterator[tuple[str, NullDirections]]:
    """Null directions that move several frames at once, with their kinds."""
    for motion, moved in dictionary.names(_by_frames(vectors, frames)):
        some = tuple(np.flatnonzero(np.linalg.norm(moved, axis=(1, 2)) > TAKES_PART).tolist())
        count = moved.shape[-1]
        yield motion.kind, NullDirections(motion.name, motion.joints, some, count, tied=True)


def _of_shared(vectors: csc_array, frames: "SingleFrames") -> list[NullDirections]:
    """Null directions of shared unknowns, and what compensates them in the frames."""
    if not vectors.shape[1]:
        return []
    frame_of, place = frames.places
    S = vectors.toarray()[frame_of < 0][np.argsort(place[frame_of < 0])]
    dictionary = Dictionary.of(frames.shared, joint_motions(frames.shared, ()))
    V = _by_frames(vectors, frames)
    found = []
    for motion, moved in dictionary.names(S[None]):
        combined = np.linalg.lstsq(S, moved[0])[0]
        of_frames = V @ combined
        there = np.linalg.norm(of_frames, axis=(1, 2)) > TAKES_PART
        size = np.linalg.norm(of_frames, axis=(0, 2))
        blocks = [b for b, at in frames.layout.slices.items() if (size[at] > TAKES_PART).any()]
        name = motion.name
        if motion.kind in ("mixed", "block"):
            name = "; ".join(in_units(v, frames.shared) for v in moved[0].T)
        if there.any():
            where = f"{int(there.sum())} of {frames.count} frames"
            name = f"{name}, undone by {' and '.join(blocks)} in {where}"
        some = tuple(np.flatnonzero(there).tolist())
        count = moved.shape[-1]
        found.append(NullDirections(name, motion.joints, some, count, tied=True, shared=True))
    return found


def _by_frames(vectors: csc_array, frames: "SingleFrames") -> Array:
    """(T, n, d): vectors by frames and the places in a frame's layout."""
    frame_of, place = frames.places
    own = np.flatnonzero(frame_of >= 0)
    V = np.zeros((frames.count, frames.layout.size, vectors.shape[1]))
    V[frame_of[own], place[own]] = vectors.toarray()[own]
    return V
