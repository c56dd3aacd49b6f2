"""The unknowns of a sequence eliminated frame after frame, whatever the rank of each frame is.

A sparse Jacobian that falls into `Parts` is eliminated part after part in the same way.

Let [A B] (u; w) be all rows that read the unknowns u of a frame; they also read some of the
unknowns w that are left. With the pseudoinverse A^+, the best u for a given w is u = -A^+ B w, and
the rows (I - A A^+) B remain for w. A direction of u that A does not see is, with w = 0, unseen by
the whole sequence. At the end the shared unknowns are left, with the square root of their Schur
complement. This is the square-root information filter (Bierman, Factorization Methods for Discrete
Sequential Estimation, 1977) with an SVD in place of a triangular factor, which finds the unseen
directions.

Time and memory grow in proportion to the number of frames while no row reaches over many of them.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index, Mask
from workbench.diagnostics.frame_rows import FrameRows, in_columns, triangle, widened
from workbench.problem.nonzeros import rows_of_nonzeros

NOTHING = 1e-9  # in vectors of length 1: smaller entries are rounding errors
TAKES_PART = 1e-9  # squared entries of null vectors from which on an unknown is not known at all


@dataclass(frozen=True, eq=False)
class EliminationStep:
    """u = answer @ w + half @ z + unseen @ y: z has the covariance I, and y may be anything.

    Attributes:
        u: the places of the eliminated unknowns among all unknowns.
        w: the places of the unknowns that are left and that these rows read.
        answer: (u, w) how u follows w.
        half: (u, r) a square root of the covariance of u given w.
        unseen: (u, d) orthonormal directions of u that no row sees.
    """

    u: Index
    w: Index
    answer: Array
    half: Array
    unseen: Array


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
        """The elimination of the rows of a sequence, or of a Jacobian that falls into parts."""
        place = np.full(rows.shape[1], -1)
        parts = _by_first_frame(rows)
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
        return self.size - sum(int(step.unseen.shape[1]) for step in self.steps)

    @cached_property
    def null_vectors(self) -> csc_array:
        """(n, n - rank): a basis of what no row sees, each vector of length 1.

        A vector reaches from the last frame that takes part in it back to the first one.
        """
        found: list[tuple[Index, Array]] = []
        for k, step in enumerate(self.steps):
            for v in self._turned(k, step).T:
                at, numbers = self._extended(k, step.u, v)
                keep = abs(numbers) > NOTHING * np.linalg.norm(numbers)
                found.append((at[keep], numbers[keep] / np.linalg.norm(numbers[keep])))
        data = np.concatenate([np.zeros(0), *(numbers for _, numbers in found)])
        at = np.concatenate([np.zeros(0, dtype=np.int64), *(at for at, _ in found)])
        starts = np.cumsum([0, *(len(numbers) for _, numbers in found)])
        return csc_array((data, at, starts), shape=(self.size, len(found)))

    def _turned(self, k: int, step: EliminationStep) -> Array:
        """What the step does not see, in a basis of which as few as possible reach further back."""
        if not k or not step.unseen.shape[1]:
            return step.unseen
        back = []
        for before in self.steps[:k] if k == len(self.steps) - 1 else self.steps[k - 1 : k]:
            _, here, there = np.intersect1d(step.u, before.w, return_indices=True)
            back.append(triangle(before.answer[:, there] @ step.unseen[here]))
        Vt = np.linalg.svd(np.vstack(back), full_matrices=True)[2]
        return np.asarray(step.unseen @ Vt.T)

    def _extended(self, k: int, u: Index, v: Array) -> tuple[Index, Array]:
        """The vector v in the unknowns u of step k, with the answers of the steps before it."""
        whole = {int(i): float(x) for i, x in zip(u, v, strict=True)}
        for step in reversed(self.steps[:k]):
            w = np.array([whole.get(int(i), 0.0) for i in step.w])
            if not (abs(w) > NOTHING).any():
                if k < len(self.steps) - 1:
                    break
                continue
            whole |= zip(step.u.tolist(), (step.answer @ w).tolist(), strict=True)
        return np.array(list(whole), dtype=np.int64), np.array(list(whole.values()))

    @cached_property
    def variances(self) -> Array:
        """The diagonal of the inverse of J'J (n,); infinite where null vectors take part."""
        return np.where(self.takes_part, np.inf, self.variances_seen)

    @cached_property
    def variances_seen(self) -> Array:
        """The same (n,) with what no row sees held at zero."""
        found = np.zeros(self.size)
        known, covariance = np.zeros(0, dtype=np.int64), np.zeros((0, 0))
        for step in reversed(self.steps):
            order = np.argsort(known)
            at = order[np.searchsorted(known[order], step.w)]
            of_w = covariance[np.ix_(at, at)]
            across = step.answer @ of_w
            own = step.half @ step.half.T + across @ step.answer.T
            known = np.concatenate([step.u, step.w])
            covariance = np.block([[own, across], [across.T, of_w]])
            found[step.u] = np.diag(own)
        return found

    def covariance_times(self, B: Array) -> Array:
        """The covariance times B (n, q), with what no row sees held at zero."""
        B, X, pulled = B.copy(), np.zeros_like(B), []
        for step in self.steps:
            pulled.append(step.half.T @ B[step.u])
            B[step.w] += step.answer.T @ B[step.u]
        for step, z in zip(reversed(self.steps), reversed(pulled), strict=True):
            X[step.u] = step.answer @ X[step.w] + step.half @ z
        return X

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
    found = triangle(A)
    R[: len(found)] = found
    U, s, Vt = np.linalg.svd(R[:k, :k])
    seen = s > tolerance
    rank = int(seen.sum())
    half = Vt[:rank].T / s[:rank]
    answer = -half @ (U[:, :rank].T @ R[:k, k:])
    left = np.vstack([U[:, rank:].T @ R[:k, k:], R[k:, k:]])
    return EliminationStep(u, w, answer, half, np.array(Vt[rank:].T)), left[
        : k - rank + max(len(A) - k, 0)
    ]


def _by_first_frame(rows: FrameRows) -> list[csr_array]:
    """The rows between frames, by the first frame that they read; last those that read none."""
    frame_of = np.full(rows.shape[1], rows.count)
    for t, own in enumerate(rows.own):
        frame_of[own] = t
    first = np.full(rows.shape[0], rows.count)
    np.minimum.at(first, rows_of_nonzeros(rows.rest), frame_of[rows.rest.indices])
    some = np.flatnonzero(np.diff(rows.rest.indptr))
    some = some[np.argsort(first[some], kind="stable")]
    edges = np.searchsorted(first[some], np.arange(rows.count + 2))
    return [csr_array(rows.rest[some[a:b]]) for a, b in pairwise(edges)]
