"""Ridge regression of pose blend shapes from un-posed errors, by sums that need no pose again."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from workbench.arrays import Array, Mask
from workbench.geometry.mirror import Mirror
from workbench.training.blend_shapes import MaskedCholesky

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
