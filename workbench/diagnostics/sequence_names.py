"""Names of a sequence's null directions, gathered over the frames that have the same ones."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csc_array, hstack

from workbench.arrays import Array, Index
from workbench.blocks import Layout
from workbench.blocks.layout import in_units
from workbench.diagnostics.bases import beyond, null_basis
from workbench.diagnostics.gauges import Gauge, KnownMotions, NullSpace, gauges
from workbench.diagnostics.joint_motions import JointNullMotion, joint_motions
from workbench.diagnostics.null_space import of_joints
from workbench.diagnostics.words import counted, gathered

if TYPE_CHECKING:
    from workbench.diagnostics.sequences import SingleFrames

OUTSIDE = 1e-5  # part of a direction outside of a motion's entries, up to rounding
MOST_NUMBERS = 10_000_000  # in the null vectors of several frames, up to which gauges are sought
TAKES_PART = 1e-6  # of a direction's length: less is rounding
Key = tuple[str, str, tuple[str, ...]]  # kind, name and joints of directions


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
    shared = [j for j, ts in enumerate(reached) if ts[0] < 0]
    tied = [j for j, ts in enumerate(reached) if ts[0] >= 0 and len(ts) > 1]
    local: dict[int, list[int]] = {}
    for j, ts in enumerate(reached):
        if ts[0] >= 0 and len(ts) == 1:
            local.setdefault(int(ts[0]), []).append(j)
    motions = list(joint_motions(frames.layout, frames.trees))
    over_several = [*over_all, *_of_shared(csc_array(vectors[:, shared]), frames)]
    counts: Counter[Key] = Counter()
    moved: dict[Key, list[int]] = {}
    for key, direction in _names(_by_frames(vectors[:, tied], frames), frames.layout, motions):
        counts[key] += 1
        in_frames = np.flatnonzero(np.linalg.norm(direction, axis=1) > TAKES_PART)
        moved[key] = sorted({*moved.get(key, ()), *in_frames.tolist()})
    over_several += _gathered(counts, moved, tied=True)
    counts, moved = Counter(), {}
    for t, columns in sorted(local.items()):
        in_frame = frame_of == t
        V = np.zeros((1, frames.layout.size, len(columns)))
        V[0, place[in_frame]] = vectors[:, columns].toarray()[in_frame]
        for key, _ in _names(V, frames.layout, motions):
            counts[key] += 1
            moved[key] = sorted({*moved.get(key, ()), t})
    return (*over_several, *_gathered(counts, moved, tied=False))


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
    reached = _frames_reached(vectors, frame_of)
    over_several = np.array([len(ts) > 1 or ts[0] < 0 for ts in reached], dtype=bool)
    count = int(over_several.sum())
    if not 0 < count <= vectors.shape[0] or count * vectors.shape[0] > MOST_NUMBERS:
        return [], vectors
    basis = np.linalg.qr(vectors[:, np.flatnonzero(over_several)].toarray())[0]
    space = NullSpace(frames.problem.split(frames.values)[0], np.ones(len(basis)), basis)
    motions = gauges(
        frames.problem, frames.values, KnownMotions(space), frames.problem.pattern, declared
    )
    directions, spanned = [], np.zeros((len(basis), 0))
    for motion in motions:
        v = basis @ motion.coefficients[:, None]
        v = np.where(abs(v) > TAKES_PART * abs(v).max(), v, 0.0) / np.linalg.norm(v)
        new, _ = beyond(spanned, v)
        if not new.shape[1]:
            continue
        spanned = np.column_stack([spanned, new])
        ts = np.unique(frame_of[np.flatnonzero(v)])
        frames_moved = tuple(int(t) for t in ts if t >= 0)
        directions.append(NullDirections(motion.name, (), frames_moved, 1, tied=True))
        if len(directions) == count:
            break
    if not directions:
        return [], vectors
    rest = basis @ np.linalg.svd(basis.T @ spanned)[0][:, spanned.shape[1] :]
    local = csc_array(vectors[:, np.flatnonzero(~over_several)])
    return directions, csc_array(hstack([local, _by_frame(rest, frame_of)]))


def _by_frame(rest: Array, frame_of: Index) -> csc_array:
    """Vectors (n, d) combined so that as few as can be move what frames share."""
    if not rest.shape[1]:
        return csc_array(rest)
    Vt = np.linalg.svd(rest[frame_of < 0], full_matrices=True)[2]
    combined = rest @ Vt.T
    combined[abs(combined) < TAKES_PART] = 0.0
    return csc_array(combined)


def _names(
    V: Array, layout: Layout, motions: Sequence[JointNullMotion]
) -> Iterator[tuple[Key, Array]]:
    """Directions (T, n) that span V (T, n, d), by the motions of joints, which come first.

    A motion is one of them if some combination (d,) of the vectors moves its entries alone, in all
    frames.
    """
    T, n, d = V.shape
    if not d:
        return
    basis = np.linalg.qr(V.reshape(T * n, d))[0]
    known = KnownMotions(NullSpace(np.zeros(T * n), np.ones(T * n), basis, OUTSIDE))
    starts = n * np.arange(T)[:, None]
    in_all_frames = [
        replace(motion, entries=(motion.entries + starts).ravel()) for motion in motions
    ]
    for motion in of_joints(in_all_frames, layout, known, apart=False):
        key = motion.kind, motion.name.removesuffix(": "), motion.joints
        yield key, (basis @ motion.coefficients).reshape(T, n)
    rest = (basis @ null_basis(known.coefficients.T, 0.5)).reshape(T, n, -1)
    if rest.shape[-1]:
        large = np.linalg.norm(rest, axis=(0, 2)) > TAKES_PART
        blocks = [name for name, part in layout.slices.items() if large[part].any()]
        key = "mixed", f"combinations of {' and '.join(blocks)}", ()
        yield from ((key, direction) for direction in np.moveaxis(rest, -1, 0))


def _gathered(
    counts: Mapping[Key, int], moved: Mapping[Key, Sequence[int]], *, tied: bool
) -> list[NullDirections]:
    """Null directions; single entries of the same frames become one, and lead."""
    entries: dict[tuple[int, ...], list[Key]] = {}
    for key in counts:
        if key[0] == "entry":
            entries.setdefault(tuple(moved[key]), []).append(key)
    first = [
        NullDirections(
            ", ".join(gathered([name for _, name, _ in keys])),
            tuple(dict.fromkeys(joint for *_, joints in keys for joint in joints)),
            in_frames,
            sum(counts[key] for key in keys),
            tied,
        )
        for in_frames, keys in entries.items()
    ]
    others = [key for key in counts if key[0] != "entry"]
    return first + [NullDirections(k[1], k[2], tuple(moved[k]), counts[k], tied) for k in others]


def _of_shared(vectors: csc_array, frames: "SingleFrames") -> list[NullDirections]:
    """Null directions of shared unknowns, and what compensates them in the frames."""
    if not vectors.shape[1]:
        return []
    frame_of, place = frames.places
    S = vectors.toarray()[frame_of < 0][np.argsort(place[frame_of < 0])]
    V = _by_frames(vectors, frames)
    motions = list(joint_motions(frames.shared, ()))
    directions = []
    for (kind, name, _), direction in _names(S[None], frames.shared, motions):
        undoing = V @ np.linalg.lstsq(S, direction[0])[0]  # how the frames move, (T, n)
        in_frames = np.flatnonzero(np.linalg.norm(undoing, axis=1) > TAKES_PART)
        large = np.linalg.norm(undoing, axis=0) > TAKES_PART
        blocks = [block for block, part in frames.layout.slices.items() if large[part].any()]
        title = in_units(direction[0], frames.shared) if kind == "mixed" else name
        if in_frames.size:
            where = f"{in_frames.size} of {frames.count} frames"
            title = f"{title}, undone by {' and '.join(blocks)} in {where}"
        ts = tuple(in_frames.tolist())
        directions.append(NullDirections(title, (), ts, 1, tied=True, shared=True))
    return directions


def _by_frames(vectors: csc_array, frames: "SingleFrames") -> Array:
    """(T, n, d): vectors by frames and the places in a frame's layout."""
    frame_of, place = frames.places
    own = np.flatnonzero(frame_of >= 0)
    V = np.zeros((frames.count, frames.layout.size, vectors.shape[1]))
    V[frame_of[own], place[own]] = vectors.toarray()[own]
    return V
