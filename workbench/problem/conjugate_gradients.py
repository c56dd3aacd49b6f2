"""The damped step by conjugate gradients, for large sparse problems that are well conditioned."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csr_array

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.problem.steps import LinearModel, Step
from workbench.problem.storage import Symmetric, unblocked

SMALLEST = 1e-12  # of a block's trace: a smaller eigenvalue of it is only rounding


@dataclass(frozen=True)
class ConjugateGradients:
    """A step by preconditioned conjugate gradients on the normal equations; a `LinearAlgebra`.

    The preconditioner inverts the blocks of `block` consecutive unknowns on the diagonal of
    J'J + damping D^2, such as the three coordinates of one vertex (block Jacobi; Saad, Iterative
    methods for sparse linear systems, 2003, section 10.2).

    The iterations begin at zero, so that each result is the best step in the space it was looked
    for in: its length grows from iteration to iteration, and the cost of the linear model falls
    (Steihaug, The conjugate gradient method and trust regions, 1983). It is never uphill, even if
    it is not exact. The gain ratio compares it with what the model predicts for this very step. So
    inexact steps slow convergence, but mislead no trust region. With a relative residual eta,
    Gauss-Newton's convergence is linear with about that rate (Dembo, Eisenstat and Steihaug,
    Inexact Newton methods, 1982), which is better than what contacts that switch permit.

    It suits unknowns that share residuals with few others, and no border of unknowns that share
    residuals with all, such as a pose; for these, `steps.cholesky` is exact and about as fast.

    Raises BadArgument for a block or a number of products below one, and for a tolerance that is
    not between 0 and 1.

    Attributes:
        block: how many consecutive unknowns make up a block.
        tolerance: the length of the normal equations' residual relative to the gradient, in the
            norm of the preconditioner, at which the iterations end.
        products: the largest number of iterations.
    """

    block: int = 3
    tolerance: float = 1e-3
    products: int = 500

    def __post_init__(self) -> None:
        if self.block < 1 or self.products < 1 or not 0 < self.tolerance < 1:
            raise BadArgument(
                "conjugate gradients take a block and a number of products from 1 on, and a "
                f"tolerance between 0 and 1, not {self.block}, {self.products} and "
                f"{self.tolerance:g}"
            )

    def __call__(self, here: LinearModel, damping: float, D: Array) -> Step:
        """The step (n,) that nearly minimises |J p + r|^2 + damping |D p|^2.

        Raises BadArgument if the unknowns cannot be divided into blocks of this size.
        """
        return Step(self.solved(here.normal, damping * D**2, -here.gradient), "conjugate gradients")

    def solved(self, normal: Symmetric, raised: Array, right: Array) -> Array:
        """The x (n,) with (A + diag(raised)) x = right, nearly, for a semidefinite A (n, n).

        Raises BadArgument if the unknowns cannot be divided into blocks of this size.
        """
        n, size = len(right), self.block
        if n % size:
            raise BadArgument(
                f"{n} unknowns cannot be divided into blocks of {size}; choose another block size"
            )
        stored = unblocked(normal)
        A = bsr_array(csr_array(stored.T), blocksize=(size, size))  # .T is A, by rows
        inverse = _inverse_of_blocks(A, raised, size)
        x, residual = np.zeros(n), right.copy()
        preconditioned = inverse @ residual
        direction, square = preconditioned, float(residual @ preconditioned)
        enough = self.tolerance**2 * square
        for _ in range(self.products):
            if not square > enough:
                break
            product = A @ direction + raised * direction
            bent = float(direction @ product)
            if not bent > 0:
                break
            length = square / bent
            x += length * direction
            residual -= length * product
            preconditioned = inverse @ residual
            square, before = float(residual @ preconditioned), square
            direction = preconditioned + (square / before) * direction
        return x


def _inverse_of_blocks(A: bsr_array, raised: Array, size: int) -> bsr_array:
    """The inverse of the blocks (size, size) on the diagonal of A + diag(raised)."""
    n = A.shape[0] // size
    rows = np.repeat(np.arange(n), np.diff(A.indptr))
    here = rows == A.indices
    blocks = np.zeros((n, size, size))
    blocks[rows[here]] = A.data[here]
    places = np.arange(size)
    blocks[:, places, places] += raised.reshape(-1, size)
    trace = np.einsum("bii->b", blocks)
    blocks[:, places, places] += np.where(trace > 0, SMALLEST * trace, 1.0)[:, None]
    inverse = np.linalg.inv(blocks)
    return bsr_array((inverse, np.arange(n), np.arange(n + 1)), shape=A.shape)
