"""Pose blend shapes by ridge regression of what linear blend skinning gets wrong at rest."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

from workbench.training.mirror import Mirror
from workbench.training.noticing import ByPattern, Mask

Array = NDArray[np.float64]
Pair = tuple[Array, Array]  # of n poses: features (n, F), and un-posed errors (n, N, 3) m


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over poses of features and un-posed errors: all that least squares needs."""

    features: Array  # (F, F): sum of f f^T
    products: Array  # (N, 3, F): sum of error f^T
    energy: float  # sum of squared errors, m^2
    n_poses: int

    @staticmethod
    def of(seen: Iterable[Pair]) -> "Sums":
        """The sums over pairs, some poses at a time."""
        each = (
            Sums(f.T @ f, np.tensordot(e, f, (0, 0)), float(np.vdot(e, e)), len(f)) for f, e in seen
        )
        return reduce(add, each)

    def __add__(self, other: "Sums") -> "Sums":
        return Sums(
            self.features + other.features,
            self.products + other.products,
            self.energy + other.energy,
            self.n_poses + other.n_poses,
        )

    def error(self, posedirs: Array) -> float:
        """The share of the energy that posedirs (N, 3, F) leave."""
        explained = 2 * self.products - posedirs @ self.features
        return float(1 - np.vdot(posedirs, explained) / self.energy)

    def with_reflections(self, mirror: Mirror | None) -> "Sums":
        """As if every pose had also been seen in a mirror; the same without one."""
        if mirror is None:
            return self
        turned = self.features[np.ix_(mirror.features, mirror.features)]
        turned *= np.outer(mirror.feature_signs, mirror.feature_signs)
        products = self.products + mirror.posedirs(self.products)
        return Sums(self.features + turned, products, 2 * self.energy, 2 * self.n_poses)


def solve_ridge(sums: Sums, support: Mask, ridge: float) -> Array:
    """Posedirs (N, 3, F) m: least squares on each vertex's own features (N, F), else zero."""
    gram = sums.features + ridge * sums.n_poses * np.eye(len(sums.features))
    return ByPattern.of(gram, support).solved(sums.products)


def ridge_learned(
    learned: Sums, held_back: Sums, support: Mask, ridges: Sequence[float]
) -> tuple[Array, float]:
    """Posedirs (N, 3, F) m of both, and the ridge: what leaves least of that held back."""
    ridge = min(ridges, key=lambda r: held_back.error(solve_ridge(learned, support, r)))
    return solve_ridge(learned + held_back, support, ridge), ridge
