"""Names for what a sequence does not see, gathered over the frames that share them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Mask
from workbench.blocks import Layout
from workbench.diagnostics.named_subspaces import NamedSubspace, named_subspaces
from workbench.diagnostics.null_space import FRESH, dominant
from workbench.diagnostics.single_frames import SingleFrames
from workbench.diagnostics.structure import counted, gathered

OUTSIDE = 1e-10  # squared part of a direction outside of a motion's entries, up to rounding
TAKES_PART = 1e-6  # of a direction's length: less is rounding


@dataclass(frozen=True)
class NullDirections:
    """Directions of one name that no residual notices.

    Where they are `tied`, each of them moves several frames at once. Else each moves one frame, and
    there are as many in each of the `frames` as `count` says in all. `shared` ones move unknowns
    that all frames share, and those of the `frames` in what they are undone by.
    """

    name: str
    joints: tuple[str, ...]
    frames: tuple[int, ...]
    count: int
    tied: bool = False
    shared: bool = False

    def said(self, total: int) -> str:
        """`a turn of pose[left_wrist] alone, in 200 of 200 frames`."""
        if self.shared:
            return self.name
        where = f"{len(self.frames)} of {total} frames"
        if self.tied:
            return f"{self.name}: {counted(self.count, 'direction')} over {where} together"
        each = self.count / max(1, len(self.frames))
        more = "" if each <= 1 else f" ({each:.3g} directions in each)"
        return f"{self.name}, in {where}{more}"


def named(vectors: csc_array, frames: SingleFrames) -> tuple[NullDirections, ...]:
    """Names of the null vectors (n, d) of a sequence."""
    frame_of, place = frames.places
    local: dict[int, list[int]] = {}
    tied, shared = [], []
    for j, (first, last) in enumerate(zip(vectors.indptr[:-1], vectors.indptr[1:], strict=True)):
        reached = np.unique(frame_of[vectors.indices[first:last]])
        if reached[0] < 0:
            shared.append(j)
        elif len(reached) > 1:
            tied.append(j)
        else:
            local.setdefault(int(reached[0]), []).append(j)
    dictionary = Dictionary.of(frames.layout, named_subspaces(frames.layout, frames.trees))
    found: list[NullDirections] = _of_shared(csc_array(vectors[:, shared]), frames)
    if tied:
        found += _tied(csc_array(vectors[:, tied]), frames, dictionary)
    groups: dict[tuple[str, tuple[str, ...], str], dict[int, int]] = {}
    for t, columns in sorted(local.items()):
        here = frame_of == t
        V = np.zeros((frames.layout.size, len(columns)))
        V[place[here]] = vectors[:, columns].toarray()[here]
        for name, joints, kind, count, _ in dictionary.names(V[None]):
            groups.setdefault((name, joints, kind), {})[t] = count
    return (*found, *_gathered(groups))


@dataclass(frozen=True, eq=False)
class Dictionary:
    """Motions of one frame, and which unknowns each of them moves, (M, n)."""

    layout: Layout
    subspaces: Sequence[NamedSubspace]
    moves: Mask

    @staticmethod
    def of(layout: Layout, found: Iterable[NamedSubspace]) -> "Dictionary":
        """The dictionary of those subspaces whose entries may each move by itself."""
        kept = [motion for motion in found if motion.basis is None]
        moves = np.zeros((len(kept), layout.size), dtype=bool)
        for row, motion in zip(moves, kept, strict=True):
            row[motion.entries] = True
        return Dictionary(layout, kept, moves)

    def names(self, V: Array) -> list[tuple[str, tuple[str, ...], str, int, Array]]:
        """Name, joints, kind and count of directions in the span of V (T, n, d); which these are.

        A motion is one of them if some combination (d,) of the vectors moves its entries alone, in
        all frames; the smallest motions come first.
        """
        T, n, d = V.shape
        Q = np.linalg.qr(V.reshape(T * n, d))[0].reshape(T, n, d)
        gram = np.einsum("tei,tej->eij", Q, Q)  # of each entry; they add up to the unit matrix
        parts = self.moves.astype(float) @ np.einsum("eii->e", gram)
        found, known = [], np.zeros((d, 0))
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
            found.append((motion.name, motion.joints, motion.kind, fresh.shape[1], Q @ fresh))
            known = np.column_stack([known, fresh])
            moved = np.linalg.norm(Q @ fresh, axis=0) ** 2 > OUTSIDE
            inside += np.sum(others @ moved.astype(float) == 0, axis=1)
        left = d - known.shape[1]
        if left:
            rest = Q @ np.linalg.svd(known, full_matrices=True)[0][:, known.shape[1] :]
            large = np.linalg.norm(rest, axis=(0, 2)) > TAKES_PART
            blocks = [b for b, at in self.layout.slices.items() if large[at].any()]
            name = f"combinations of {' and '.join(blocks)}"
            found.append((name, (), "mixed", left, rest))
        return found


def _gathered(
    groups: dict[tuple[str, tuple[str, ...], str], dict[int, int]],
) -> list[NullDirections]:
    """Groups of one name; single entries of the same frames in one."""
    entries: dict[tuple[int, ...], list[tuple[str, tuple[str, ...]]]] = {}
    found = []
    for (name, joints, kind), counts in groups.items():
        some = tuple(sorted(counts))
        if kind == "entry":
            entries.setdefault(some, []).append((name, joints))
        else:
            found.append(NullDirections(name, joints, some, sum(counts.values())))
    first = []
    for some, several in entries.items():
        joints = tuple(dict.fromkeys(joint for _, of in several for joint in of))
        name = ", ".join(gathered([name for name, _ in several]))
        first.append(NullDirections(name, joints, some, len(several) * len(some)))
    return [*first, *found]


def _tied(vectors: csc_array, frames: SingleFrames, dictionary: Dictionary) -> list[NullDirections]:
    groups: dict[tuple[int, ...], list[NullDirections]] = {}
    found = []
    for name, joints, kind, count, moved in dictionary.names(_by_frames(vectors, frames)):
        some = tuple(np.flatnonzero(np.linalg.norm(moved, axis=(1, 2)) > TAKES_PART).tolist())
        one = NullDirections(name, joints, some, count, tied=True)
        if kind == "entry":
            groups.setdefault(some, []).append(one)
        else:
            found.append(one)
    entries = []
    for some, several in groups.items():
        joints = tuple(dict.fromkeys(joint for one in several for joint in one.joints))
        name = ", ".join(gathered([one.name for one in several]))
        entries.append(
            NullDirections(name, joints, some, sum(one.count for one in several), tied=True)
        )
    return [*entries, *found]


def _of_shared(vectors: csc_array, frames: SingleFrames) -> list[NullDirections]:
    """Null directions of shared unknowns, and what compensates them in the frames."""
    if not vectors.shape[1]:
        return []
    frame_of, place = frames.places
    S = np.zeros((frames.shared.size, vectors.shape[1]))
    S[place[frame_of < 0]] = vectors.toarray()[frame_of < 0]
    dictionary = Dictionary.of(frames.shared, named_subspaces(frames.shared, ()))
    V = _by_frames(vectors, frames)
    found = []
    for name, joints, kind, count, moved in dictionary.names(S[None]):
        combined = np.linalg.lstsq(S, moved[0])[0]
        of_frames = V @ combined
        there = np.linalg.norm(of_frames, axis=(1, 2)) > TAKES_PART
        size = np.linalg.norm(of_frames, axis=(0, 2))
        blocks = [b for b, at in frames.layout.slices.items() if (size[at] > TAKES_PART).any()]
        if kind in ("mixed", "block"):
            name = "; ".join(dominant(v, frames.shared) for v in moved[0].T)
        if there.any():
            where = f"{int(there.sum())} of {frames.count} frames"
            name = f"{name}, undone by {' and '.join(blocks)} in {where}"
        some = tuple(np.flatnonzero(there).tolist())
        found.append(NullDirections(name, joints, some, count, tied=True, shared=True))
    return found


def _by_frames(vectors: csc_array, frames: SingleFrames) -> Array:
    """(T, n, d): vectors by frames and the places in a frame's layout."""
    frame_of, place = frames.places
    own = np.flatnonzero(frame_of >= 0)
    V = np.zeros((frames.count, frames.layout.size, vectors.shape[1]))
    V[frame_of[own], place[own]] = vectors.toarray()[own]
    return V
