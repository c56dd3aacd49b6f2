"""The unknowns of a sequence eliminated frame after frame, whatever the rank of each frame is.

Let [A B] (u; w) be all rows that read the unknowns u of a frame; they also read some of the
unknowns w that are left. With the pseudoinverse A^+, the best u for a given w is u = -A^+ B w, and
the rows (I - A A^+) B remain for w. A direction of u that A takes to zero is, with w = 0, a null
direction of the whole sequence. At the end the shared unknowns are left, with the square root of
their Schur complement. This is the square-root information filter (Bierman, Factorization Methods
for Discrete Sequential Estimation, 1977) with an SVD in place of a triangular factor, which finds
the null directions. All columns are scaled to length 1. Time and memory grow in proportion to the
number of frames while no row reaches over many of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy.linalg
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index, Mask
from workbench.diagnostics.sparse_jacobian import TAKES_PART, largest_singular_value
from workbench.problem import Linearization
from workbench.problem.banded import BlockMatrix
from workbench.problem.sparsity import rows_of_nonzeros
from workbench.residuals import Residual

ROUNDING = 1e-9  # in vectors of length 1: smaller entries are rounding errors


@dataclass(frozen=True, eq=False)
class FrameRows:
    """The unknowns and the rows of each frame, and their numbers in columns of length 1.

    `own[t]` are the places of the unknowns of frame t, `shared` those of the unknowns that all
    frames share. `triangles[t]` (k, n_t + b) is R of [J_t B_t] by QR, with k <= n_t + b.

    Attributes:
        matrix: the Jacobian with columns of length 1, or zero.
        lengths: (n,) the lengths of its columns before; 1 where a column is zero.
        frame_of_row: (m,) the frame of each row; -1 for rows that belong to no single frame.
        own: for each frame the places of its unknowns.
        shared: (b,) the places of the unknowns that all frames share.
    """

    matrix: BlockMatrix
    lengths: Array
    frame_of_row: Index
    own: tuple[Index, ...]
    shared: Index

    @staticmethod
    def of(here: Linearization, frame_of_row: Index) -> "FrameRows":
        """The rows of a linearization whose Jacobian is a BlockMatrix; see `frames_of_rows`."""
        assert isinstance(here.jacobian, BlockMatrix)
        lengths = np.where(here.column_norms > 0, here.column_norms, 1.0)
        order = here.jacobian.order
        own = tuple(np.split(order.inner, order.edges[1:-1]))
        matrix = here.jacobian.scaled(1 / lengths)
        return FrameRows(matrix, lengths, frame_of_row, own, order.border)

    @property
    def count(self) -> int:
        """T, the number of frames."""
        return len(self.own)

    @property
    def shape(self) -> tuple[int, int]:
        """The numbers of rows and columns, (m, n)."""
        return self.matrix.shape

    @cached_property
    def rest(self) -> csr_array:
        """The rows that belong to no single frame; all others are empty here."""
        data = csr_array(self.matrix.rest)
        rows = rows_of_nonzeros(data)
        keep = (self.frame_of_row[rows] < 0) & (data.data != 0)
        places = rows[keep], data.indices[keep]
        return csr_array((data.data[keep], places), shape=data.shape)

    @cached_property
    def triangles(self) -> tuple[Array, ...]:
        """[J_t B_t] of each frame, reduced by QR."""
        parts: list[list[Array]] = [[] for _ in range(self.count)]
        place = np.full(self.shape[1], -1)
        for block, places in zip(self.matrix.blocks, self.matrix.places, strict=True):
            for J, row_places, columns in zip(block, places.rows, places.columns, strict=True):
                t = int(self.frame_of_row[row_places[0]]) if len(row_places) else -1
                if t >= 0:
                    parts[t].append(self._placed(t, J, columns, place))
        single = csr_array(self.matrix.rest)
        counts = np.diff(single.indptr)
        of_frames = np.flatnonzero((self.frame_of_row >= 0) & (counts > 0))
        by_frame = of_frames[np.argsort(self.frame_of_row[of_frames], kind="stable")]
        starts = np.searchsorted(self.frame_of_row[by_frame], np.arange(self.count + 1))
        for t in range(self.count):
            rows = csr_array(single[by_frame[starts[t] : starts[t + 1]]])
            if rows.nnz:
                columns = np.concatenate([self.own[t], self.shared])
                place[columns] = np.arange(len(columns))
                parts[t].append(in_columns(rows, place, len(columns)))
        return tuple(
            triangle(np.vstack([np.zeros((0, len(own) + len(self.shared))), *of_frame]))
            for own, of_frame in zip(self.own, parts, strict=True)
        )

    @property
    def by_first_frame(self) -> list[csr_array]:
        """The rows between frames, by the first frame that they read; last those that read none."""
        frame_of = np.full(self.shape[1], self.count)
        for t, own in enumerate(self.own):
            frame_of[own] = t
        first = np.full(self.shape[0], self.count)
        np.minimum.at(first, rows_of_nonzeros(self.rest), frame_of[self.rest.indices])
        rows = np.flatnonzero(np.diff(self.rest.indptr))
        rows = rows[np.argsort(first[rows], kind="stable")]
        edges = np.searchsorted(first[rows], np.arange(self.count + 2))
        return [csr_array(self.rest[rows[start:stop]]) for start, stop in pairwise(edges)]

    def _placed(self, t: int, J: Array, columns: Index, place: Index) -> Array:
        """A block in the columns (own, shared) of its frame."""
        own = self.own[t]
        place[own] = np.arange(len(own))
        place[self.shared] = len(own) + np.arange(len(self.shared))
        return widened(J, place[columns], len(own) + len(self.shared))

    @cached_property
    def tolerance(self) -> float:
        """The size below which a singular value counts as zero: eps max(m, n) times the largest."""
        size = largest_singular_value(self.matrix)
        return float(np.finfo(float).eps * max(self.shape) * max(size, 1.0))


@dataclass(frozen=True, eq=False)
class EliminationStep:
    """u = answer @ w + half @ z + null @ y: z has the covariance I, and y may be anything.

    Attributes:
        u, w: the places of the eliminated unknowns, and of those left that these rows read.
        answer: (u, w) how u follows w.
        half: (u, r) a square root of the covariance of u given w.
        null: (u, d) orthonormal directions of u that no row sees.
    """

    u: Index
    w: Index
    answer: Array
    half: Array
    null: Array


@dataclass(frozen=True, eq=False)
class Elimination:
    """The steps of all frames, and at last that of the shared unknowns, in columns of length 1.

    Attributes:
        size: n, the number of unknowns.
        steps: one step for each frame, then one for the shared unknowns.
    """

    size: int
    steps: tuple[EliminationStep, ...]

    @staticmethod
    def of(rows: FrameRows) -> "Elimination":
        """The elimination of the rows of a sequence."""
        place = np.full(rows.shape[1], -1)
        parts = rows.by_first_frame
        steps: list[EliminationStep] = []
        w, left = rows.shared, np.zeros((0, len(rows.shared)))
        for t, u in enumerate(rows.own):
            rest = parts[t]
            others = np.union1d(np.union1d(w, rest.indices), rows.shared)
            old, w = w, np.setdiff1d(others, u)
            every = np.concatenate([u, w])
            place[every] = np.arange(len(every))
            A = np.vstack(
                [
                    widened(left, place[old], len(every)),
                    widened(rows.triangles[t], place[np.concatenate([u, rows.shared])], len(every)),
                    in_columns(rest, place, len(every)),
                ]
            )
            step, left = _eliminated(A, u, w, rows.tolerance)
            steps.append(step)
        place[w] = np.arange(len(w))
        A = np.vstack([left, in_columns(parts[rows.count], place, len(w))])
        last, _ = _eliminated(A, w, np.zeros(0, dtype=np.int64), rows.tolerance)
        return Elimination(rows.shape[1], (*steps, last))

    @property
    def rank(self) -> int:
        """How many directions are seen."""
        return self.size - sum(int(step.null.shape[1]) for step in self.steps)

    @cached_property
    def null_vectors(self) -> csc_array:
        """(n, n - rank): a basis of what no row sees, each vector of length 1.

        A vector reaches from the last frame that takes part in it back to the first one.
        """
        places, entries = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
        for k, step in enumerate(self.steps):
            for v in self._turned(k, step).T:
                unknowns, moves = self._extended(k, step.u, v)
                keep = abs(moves) > ROUNDING * np.linalg.norm(moves)
                places.append(unknowns[keep])
                entries.append(moves[keep] / np.linalg.norm(moves[keep]))
        starts = np.cumsum([len(moves) for moves in entries])
        shape = self.size, len(entries) - 1
        return csc_array((np.concatenate(entries), np.concatenate(places), starts), shape=shape)

    def _turned(self, k: int, step: EliminationStep) -> Array:
        """What the step does not see, in a basis of which as few as possible reach further back."""
        if not k or not step.null.shape[1]:
            return step.null
        back = []
        for before in self.steps[:k] if k == len(self.steps) - 1 else self.steps[k - 1 : k]:
            _, in_u, in_w = np.intersect1d(step.u, before.w, return_indices=True)
            back.append(triangle(before.answer[:, in_w] @ step.null[in_u]))
        Vt = np.linalg.svd(np.vstack(back), full_matrices=True)[2]
        return np.asarray(step.null @ Vt.T)

    def _extended(self, k: int, u: Index, v: Array) -> tuple[Index, Array]:
        """The vector v in the unknowns u of step k, with the answers of the steps before it."""
        whole = {int(i): float(x) for i, x in zip(u, v, strict=True)}
        for step in reversed(self.steps[:k]):
            w = np.array([whole.get(int(i), 0.0) for i in step.w])
            if not (abs(w) > ROUNDING).any():
                if k < len(self.steps) - 1:
                    break
                continue
            whole |= zip(step.u.tolist(), (step.answer @ w).tolist(), strict=True)
        return np.array(list(whole), dtype=np.int64), np.array(list(whole.values()))

    @cached_property
    def variances(self) -> Array:
        """The diagonal of the inverse of J'J (n,); infinite where null vectors take part."""
        variances = np.zeros(self.size)
        known, covariance = np.zeros(0, dtype=np.int64), np.zeros((0, 0))
        for step in reversed(self.steps):
            order = np.argsort(known)
            places = order[np.searchsorted(known[order], step.w)]
            of_w = covariance[np.ix_(places, places)]
            across = step.answer @ of_w
            own = step.half @ step.half.T + across @ step.answer.T
            known = np.concatenate([step.u, step.w])
            covariance = np.block([[own, across], [across.T, of_w]])
            variances[step.u] = np.diag(own)
        return np.where(self.takes_part, np.inf, variances)

    def deviations(self, lengths: Array) -> Array:
        """Standard deviations (n,) of the unknowns, whose columns had these lengths (n,)."""
        return np.asarray(np.sqrt(self.variances) / lengths)

    @cached_property
    def takes_part(self) -> Mask:
        """Which unknowns a null vector moves, (n,)."""
        V = self.null_vectors
        return np.asarray(np.bincount(V.indices, V.data**2, minlength=self.size) > TAKES_PART)


def _eliminated(A: Array, u: Index, w: Index, tolerance: float) -> tuple[EliminationStep, Array]:
    """Eliminate the first columns of A, those of the unknowns `u`; then come those of `w`.

    Returns the step, and the rows that are left for `w`.
    """
    k, n = len(u), len(u) + len(w)
    R = np.zeros((n, n))
    R[: min(A.shape)] = triangle(A)
    U, s, Vt = np.linalg.svd(R[:k, :k])
    seen = s > tolerance
    rank = int(seen.sum())
    half = Vt[:rank].T / s[:rank]
    answer = -half @ (U[:, :rank].T @ R[:k, k:])
    left = np.vstack([U[:, rank:].T @ R[:k, k:], R[k:, k:]])[: k - rank + max(len(A) - k, 0)]
    return EliminationStep(u, w, answer, half, np.array(Vt[rank:].T)), left


def frames_of_rows(residuals: Sequence[Residual]) -> Index:
    """The frame that each row of the stacked residual belongs to, (m,); -1 for none."""
    frames = [np.zeros(0, dtype=np.int64)]
    for residual in residuals:
        if residual.by_frame:
            frames += [np.full(of_frame.size, t) for t, of_frame in residual.by_frame]
        else:
            frames.append(np.full(residual.size, -1))
    return np.concatenate(frames)


def widened(A: Array, columns: Index, width: int) -> Array:
    """A in some of the columns of a matrix that is zero otherwise, (m, width)."""
    wide = np.zeros((len(A), width))
    wide[:, columns] = A
    return wide


def in_columns(rows: csr_array, place: Index, width: int) -> Array:
    """Sparse rows as an array (m, width), each column at its `place`."""
    dense = np.zeros((rows.shape[0], width))
    dense[rows_of_nonzeros(rows), place[rows.indices]] = rows.data
    return dense


def triangle(A: Array) -> Array:
    """R (min(m, n), n) of A (m, n) by QR: R'R = A'A."""
    m, n = A.shape
    if not m or not n:
        return A[: min(m, n)]
    return np.asarray(scipy.linalg.qr(A, mode="r", check_finite=False)[0][: min(m, n)], dtype=float)
