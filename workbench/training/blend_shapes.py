"""Pose blend shapes: which joints a vertex follows, and ridge regression of un-posed errors.

Where every vertex may depend on every joint, a twist of all poses for which blend shapes
compensate costs nearly nothing, and a knee moves a hand, as Osman, Bolkart and Black found of
SMPL (STAR, 2020). A vertex that depends on few joints does not allow that.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Index, Mask
from workbench.geometry.mirror import Mirror

CARRIED_FROM = 0.02  # the least weight with which a joint counts as moving a vertex


def local_features(weights: Array, parents: Sequence[int], reach: int) -> Mask:
    """Which of the pose features (N, 9 (K - 1)) a vertex may depend on.

    They are those of the joints at most `reach` bones away from a joint that moves the vertex.
    """
    near = np.eye(len(parents), dtype=bool)
    for k, parent in enumerate(parents[1:], start=1):
        near[k, parent] = near[parent, k] = True
    found = weights >= CARRIED_FROM
    for _ in range(reach):
        found = found @ near
    return np.repeat(found[:, 1:], 9, axis=1)


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
        found = []
        for g, pattern in enumerate(patterns):
            if not pattern.any():
                continue
            rows = np.flatnonzero(pattern)
            L = scipy.linalg.cholesky(gram[np.ix_(rows, rows)], lower=True)
            found.append((np.flatnonzero(group.ravel() == g), rows, L))
        return MaskedCholesky(tuple(found))

    def solved(self, right: Array) -> Array:
        """The solutions for right sides (N, 3, n), zero in the rows that are not the vertex's."""
        found = np.zeros_like(right)
        for vertices, rows, L in self.groups:
            flat = right[vertices][:, :, rows].reshape(-1, len(rows)).T
            solved = scipy.linalg.cho_solve((L, True), flat).T
            found[np.ix_(vertices, np.arange(3), rows)] = solved.reshape(len(vertices), 3, -1)
        return found


Pair = tuple[Array, Array]  # of n poses: features (n, F), and un-posed errors (n, N, 3) m


@dataclass(frozen=True, eq=False)
class RidgeSums:
    """Sums over poses of features f and un-posed errors, which is all that least squares needs.

    Attributes:
        features: (F, F) the sum of f f^T.
        products: (N, 3, F) the sum of error f^T.
        energy: the sum of squared errors, in m^2.
        n_poses: the number of poses.
    """

    features: Array
    products: Array
    energy: float
    n_poses: int

    @staticmethod
    def of(pairs: Iterable[Pair]) -> "RidgeSums":
        """The sums over pairs, each of some poses."""
        each = (
            RidgeSums(f.T @ f, np.tensordot(e, f, (0, 0)), float(np.vdot(e, e)), len(f))
            for f, e in pairs
        )
        return reduce(add, each)

    def __add__(self, other: "RidgeSums") -> "RidgeSums":
        return RidgeSums(
            self.features + other.features,
            self.products + other.products,
            self.energy + other.energy,
            self.n_poses + other.n_poses,
        )

    def error(self, posedirs: Array) -> float:
        """The share of the energy that posedirs (N, 3, F) do not explain."""
        explained = 2 * self.products - posedirs @ self.features
        return float(1 - np.vdot(posedirs, explained) / self.energy)

    def with_reflections(self, mirror: Mirror | None) -> "RidgeSums":
        """The sums as if every pose had a mirror image too; unchanged without a mirror."""
        if mirror is None:
            return self
        turned = self.features[np.ix_(mirror.features, mirror.features)]
        turned *= np.outer(mirror.feature_signs, mirror.feature_signs)
        products = self.products + mirror.posedirs(self.products)
        return RidgeSums(self.features + turned, products, 2 * self.energy, 2 * self.n_poses)


def solve_ridge(sums: RidgeSums, support: Mask, ridge: float) -> Array:
    """Posedirs (N, 3, F) m by least squares on the features that each vertex has (N, F).

    The other posedirs are zero. `ridge` is per pose.
    """
    gram = sums.features + ridge * sums.n_poses * np.eye(len(sums.features))
    return MaskedCholesky.of(gram, support).solved(sums.products)


def ridge_learned(
    learned: RidgeSums, held_out: RidgeSums, support: Mask, ridges: Sequence[float]
) -> tuple[Array, float]:
    """Posedirs (N, 3, F) m from all sums, and the ridge that explains the held-out ones best."""
    ridge = min(ridges, key=lambda r: held_out.error(solve_ridge(learned, support, r)))
    return solve_ridge(learned + held_out, support, ridge), ridge


@dataclass(frozen=True)
class RidgeChoice:
    """The values of a hyperparameter that were tried, and their errors.

    Attributes:
        tried: the values.
        errors: the root mean square distance of vertices, in mm, on the subjects held out.
    """

    tried: tuple[float, ...]
    errors: tuple[float, ...]

    @property
    def chosen(self) -> float:
        """The value with the smallest error."""
        return self.tried[int(np.argmin(self.errors))]
