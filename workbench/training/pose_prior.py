"""E_pose: a Gaussian on the poses of all registrations, as scans need one and meshes do not.

Steps turn joints: a pose phi becomes log(exp(u) exp(phi)); see
`geometry.rotation.inverse_left_jacobian`.
"""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.geometry.rotation import inverse_left_jacobian
from workbench.residuals.numbers import whitening


@dataclass(frozen=True, eq=False)
class PosePrior:
    """A Gaussian on the rotation vectors of all joints but the root.

    Attributes:
        mean: (3 (K - 1),) rad.
        whitening: (3 (K - 1), 3 (K - 1)) W in 1/rad, with W'W the inverse of the covariance.
    """

    mean: Array
    whitening: Array

    @staticmethod
    def of(mean: Array, covariance: Array) -> "PosePrior":
        """The prior of a mean (K - 1, 3) rad and a variance () or covariance (n, n) in rad^2."""
        if covariance.ndim == 0:
            covariance = covariance * np.eye(mean.size)
        return PosePrior(mean.ravel(), whitening(covariance, "pose prior"))

    def costs(self, poses: Array) -> Array:
        """|W (phi - mean)|^2 / 2 of each of poses (J, K, 3) rad: (J,)."""
        return np.asarray(0.5 * np.sum((self._away(poses) @ self.whitening.T) ** 2, axis=1))

    def slope(self, poses: Array) -> Array:
        """Minus the gradient of the cost by turns of the joints, (J, K, 3)."""
        pull = -self._away(poses) @ self.whitening.T @ self.whitening
        return self._back(poses, pull)

    def curved(self, poses: Array, turns: Array) -> Array:
        """The Hessian of Gauss and Newton times turns (J, K, 3) rad."""
        moved = (inverse_left_jacobian(poses) @ turns[..., None])[:, 1:, :, 0]
        pull = moved.reshape(len(poses), -1) @ self.whitening.T @ self.whitening
        return self._back(poses, pull)

    def blocks(self, poses: Array) -> Array:
        """That Hessian, one block for each pose, (J, 3 K, 3 K)."""
        slopes = inverse_left_jacobian(poses)[:, 1:]
        J, m = slopes.shape[:2]
        precision = (self.whitening.T @ self.whitening).reshape(m, 3, m, 3)
        found = np.zeros((J, m + 1, 3, m + 1, 3))
        found[:, 1:, :, 1:] = np.einsum(
            "jkab,kalc,jlcd->jkbld", slopes, precision, slopes, optimize=True
        )
        return found.reshape(J, 3 * m + 3, 3 * m + 3)

    def _away(self, poses: Array) -> Array:
        return np.asarray(poses[:, 1:].reshape(len(poses), -1) - self.mean)

    def _back(self, poses: Array, pull: Array) -> Array:
        found = np.zeros_like(poses)
        slopes = inverse_left_jacobian(poses)[:, 1:]
        each = pull.reshape(len(poses), -1, 3, 1)
        found[:, 1:] = (slopes.swapaxes(-1, -2) @ each)[..., 0]
        return found
