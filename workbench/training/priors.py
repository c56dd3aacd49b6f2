"""Priors that scans need and meshes do not: E_pose on poses, and E_T on the edges of templates.

Scans show where a surface is, and hardly how it slides within itself. A prior that holds every
vertex for itself lets templates slide: a vertex that moved along the surface costs the same
whether or not its neighbours came along. A prior on edges makes displacements smooth. A smooth
field is determined by its normal component on surfaces of many directions, such as the front, the
back and the sides of an arm, so that most of the tangential component follows from it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from scipy.sparse import csr_array, diags_array

from workbench.arrays import Array, Index
from workbench.errors import BadArgument
from workbench.geometry.rotation import inverse_left_jacobian
from workbench.geometry.solids import mesh_edges
from workbench.residuals.numbers import whitening

PLACE_SIGMA = 0.1  # m, sigma of a template's place: edges do not see it


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

    def negative_gradient(self, poses: Array) -> Array:
        """Minus the gradient of the cost by turns of the joints, (J, K, 3)."""
        cotangents = -self._away(poses) @ self.whitening.T @ self.whitening
        return self._to_turns(poses, cotangents)

    def hessian_product(self, poses: Array, turns: Array) -> Array:
        """The Gauss-Newton Hessian times turns (J, K, 3) rad."""
        moved = (inverse_left_jacobian(poses) @ turns[..., None])[:, 1:, :, 0]
        cotangents = moved.reshape(len(poses), -1) @ self.whitening.T @ self.whitening
        return self._to_turns(poses, cotangents)

    def blocks(self, poses: Array) -> Array:
        """That Hessian, one block for each pose, (J, 3 K, 3 K)."""
        jacobians = inverse_left_jacobian(poses)[:, 1:]
        J, m = jacobians.shape[:2]
        precision = (self.whitening.T @ self.whitening).reshape(m, 3, m, 3)
        hessians = np.zeros((J, m + 1, 3, m + 1, 3))
        hessians[:, 1:, :, 1:] = np.einsum(
            "jkab,kalc,jlcd->jkbld", jacobians, precision, jacobians, optimize=True
        )
        return hessians.reshape(J, 3 * m + 3, 3 * m + 3)

    def _away(self, poses: Array) -> Array:
        return np.asarray(poses[:, 1:].reshape(len(poses), -1) - self.mean)

    def _to_turns(self, poses: Array, cotangents: Array) -> Array:
        on_turns = np.zeros_like(poses)
        jacobians = inverse_left_jacobian(poses)[:, 1:]
        columns = cotangents.reshape(len(poses), -1, 3, 1)
        on_turns[:, 1:] = (jacobians.swapaxes(-1, -2) @ columns)[..., 0]
        return on_turns


@dataclass(frozen=True, eq=False)
class TemplatePrior:
    """A Gaussian on the displacements (N, 3) m of a template from the first one.

    Their covariance is K^-1 for each coordinate, plus S S' for shape directions S whose betas are
    standard normal. The betas are eliminated: the precision of the sum is K - K S (1 + S'K S)^-1
    S'K (Woodbury's formula), so that templates are the only unknowns.

    Attributes:
        stiffness: (N, N) K in 1/m^2, symmetric and positive definite.
        directions: (N, 3, B) S in metres per unit of betas; B may be 0.
    """

    stiffness: csr_array
    directions: Array

    def precision_product(self, displacements: Array) -> Array:
        """The precision times displacements (S, N, 3) m, the gradient of their cost, in 1/m."""
        n = len(displacements)
        flat = displacements.transpose(1, 0, 2).reshape(len(self.directions), -1)
        stiff = (self.stiffness @ flat).reshape(-1, n, 3).transpose(1, 0, 2)
        along = np.tensordot(stiff, self.directions, axes=((1, 2), (0, 1)))  # S'K d, (S, B)
        back = scipy.linalg.cho_solve((self._inner, True), along.T)
        return np.asarray(stiff - np.moveaxis(self._stiff_directions @ back, 2, 0))

    @cached_property
    def _stiff_directions(self) -> Array:
        """K S, (N, 3, B)."""
        flat = self.directions.reshape(len(self.directions), -1)
        return np.asarray(self.stiffness @ flat).reshape(self.directions.shape)

    @cached_property
    def _inner(self) -> Array:
        """The lower Cholesky factor of 1 + S'K S."""
        B = self.directions.shape[2]
        gram = np.tensordot(self.directions, self._stiff_directions, axes=((0, 1), (0, 1)))
        return scipy.linalg.cholesky(np.eye(B) + gram, lower=True)

    @property
    def scale(self) -> float:
        """The mean of K's diagonal, in 1/m^2: what a vertex alone feels."""
        return float(self.stiffness.diagonal().mean())

    def covariance(self) -> Array:
        """The covariance (3 N, 3 N) m^2 of a template's coordinates, for small meshes."""
        of_one = np.kron(np.linalg.inv(self.stiffness.toarray()), np.eye(3))
        flat = self.directions.reshape(len(of_one), -1)
        return np.asarray(of_one + flat @ flat.T)


def smooth_prior(faces: Index, directions: Array, sigma: float) -> TemplatePrior:
    """The prior by edges: T_s - T - S betas has differences of `sigma` m along every edge.

    `faces` (F, 3) are the triangles and `directions` (N, 3, B) the shape directions in metres per
    unit of betas. The place of a template, which no edge sees, has a sigma of 0.1 m. Raises
    BadArgument for a length that is not above zero.
    """
    if not 0 < sigma < np.inf:
        raise BadArgument(f"the sigma of a template's edges is above 0 m, not {sigma:g}")
    N, pairs = len(directions), mesh_edges(faces)
    E = len(pairs)
    ends = (np.tile(np.arange(E), 2), pairs.T.ravel())
    A = csr_array((np.repeat([1.0, -1.0], E), ends), shape=(E, N))
    stiff = A.T @ A / sigma**2 + diags_array(np.full(N, PLACE_SIGMA**-2 / N))
    return TemplatePrior(csr_array(stiff), directions)
