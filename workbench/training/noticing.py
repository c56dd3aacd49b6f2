"""Which joints' turns the blend shapes of a vertex follow: those near the joints that carry it.

Where every vertex may follow every joint, a twist of all poses that blend shapes make up for
costs nearly nothing; a knee then moves a hand, as STAR (Osman, Bolkart and Black 2020) found of
SMPL. A vertex that follows few joints leaves poses no such freedom.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]
CARRIED_FROM = 0.02  # a joint carries a vertex from this weight on


def noticed(weights: Array, parents: Sequence[int], reach: int) -> Mask:
    """The pose features (N, 9 (K - 1)) of joints at most `reach` bones from one that carries."""
    near = np.eye(len(parents), dtype=bool)
    for k, parent in enumerate(parents[1:], start=1):
        near[k, parent] = near[parent, k] = True
    found = weights >= CARRIED_FROM
    for _ in range(reach):
        found = found @ near
    return np.repeat(found[:, 1:], 9, axis=1)


@dataclass(frozen=True, eq=False)
class ByPattern:
    """One system of equations, of which each vertex has some rows and columns only."""

    groups: tuple[tuple[Index, Index, Array], ...]  # vertices, rows, Cholesky factor

    @staticmethod
    def of(gram: Array, own: Mask) -> "ByPattern":
        """The matrix (n, n), and whose rows are whose, (N, n)."""
        patterns, group = np.unique(own, axis=0, return_inverse=True)
        found = []
        for g, pattern in enumerate(patterns):
            if not pattern.any():
                continue
            rows = np.flatnonzero(pattern)
            L = scipy.linalg.cholesky(gram[np.ix_(rows, rows)], lower=True)
            found.append((np.flatnonzero(group.ravel() == g), rows, L))
        return ByPattern(tuple(found))

    def solved(self, right: Array) -> Array:
        """Right sides (N, 3, n): what is not a vertex's own becomes zero."""
        found = np.zeros_like(right)
        for vertices, rows, L in self.groups:
            flat = right[vertices][:, :, rows].reshape(-1, len(rows)).T
            solved = scipy.linalg.cho_solve((L, True), flat).T
            found[np.ix_(vertices, np.arange(3), rows)] = solved.reshape(len(vertices), 3, -1)
        return found
