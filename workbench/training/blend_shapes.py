"""Which joints the pose blend shapes of a vertex follow.

Where every vertex may depend on every joint, a twist of all poses for which blend shapes
compensate costs nearly nothing, and a knee moves a hand, as Osman, Bolkart and Black found of
SMPL (STAR, 2020). A vertex that depends on few joints does not allow that.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Index, Mask

CARRIED_FROM = 0.02  # the least weight with which a joint counts as moving a vertex


def local_features(weights: Array, parents: Sequence[int], reach: int) -> Mask:
    """Which of the pose features (N, 9 (K - 1)) a vertex may depend on.

    They are those of the joints at most `reach` bones away from a joint that moves the vertex.
    """
    near = np.eye(len(parents), dtype=bool)
    for k, parent in enumerate(parents[1:], start=1):
        near[k, parent] = near[parent, k] = True
    followed = weights >= CARRIED_FROM
    for _ in range(reach):
        followed = followed @ near
    return np.repeat(followed[:, 1:], 9, axis=1)


@dataclass(frozen=True, eq=False)
class MaskedCholesky:
    """Cholesky factors of one matrix, of which each vertex has some rows and columns only.

    Attributes:
        groups: the vertices that share their rows, these rows, and the factor of these rows and
            columns.
    """

    groups: tuple[tuple[Index, Index, Array], ...]

    @staticmethod
    def of(gram: Array, own: Mask) -> "MaskedCholesky":
        """The factors of a matrix (n, n), given which rows belong to each vertex, (N, n)."""
        patterns, group = np.unique(own, axis=0, return_inverse=True)
        groups = []
        for g, pattern in enumerate(patterns):
            if not pattern.any():
                continue
            rows = np.flatnonzero(pattern)
            L = scipy.linalg.cholesky(gram[np.ix_(rows, rows)], lower=True)
            groups.append((np.flatnonzero(group.ravel() == g), rows, L))
        return MaskedCholesky(tuple(groups))

    def solved(self, right: Array) -> Array:
        """The solutions for right sides (N, 3, n), zero in the rows that are not the vertex's."""
        solutions = np.zeros_like(right)
        for vertices, rows, L in self.groups:
            flat = right[vertices][:, :, rows].reshape(-1, len(rows)).T
            solved = scipy.linalg.cho_solve((L, True), flat).T
            solutions[np.ix_(vertices, np.arange(3), rows)] = solved.reshape(len(vertices), 3, -1)
        return solutions
