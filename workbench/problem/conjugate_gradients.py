"""The damped step by conjugate gradients, for large sparse problems that are well conditioned."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csc_array

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.problem.nonzeros import columns_of_nonzeros, sums
from workbench.problem.steps import LinearModel, Step
from workbench.problem.storage import Matrix, by_nonzeros

SMALLEST = 1e-12  # of a block's trace: a smaller eigenvalue of it is only rounding


@dataclass(frozen=True)
class ConjugateGradients:
    """A step by preconditioned conjugate gradients on the normal equations; a `LinearAlgebra`.

    The preconditioner inverts the blocks of `block` consecutive unknowns on the diagonal of
    J'J + damping D^2, such as the three coordinates of one vertex (block Jacobi; Saad, Iterative
    methods for sparse linear systems, 2003, section 10.1). J'J is never formed: each iteration is
    one product with J and one with J'.

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
        n, size = len(here.gradient), self.block
        if n % size:
            raise BadArgument(
                f"{n} unknowns cannot be divided into blocks of {size}; choose another block size"
            )
        J = by_columns_of(here.jacobian)
        Jt = J.T  # by rows, in the same memory
        raised = damping * D**2
        inverse = _inverse_of_blocks(J, raised, size)
        p, residual = np.zeros(n), -here.gradient
        preconditioned = inverse @ residual
        direction, square = preconditioned, float(residual @ preconditioned)
        enough = self.tolerance**2 * square
        for _ in range(self.products):
            if not square > enough:
                break
            product = Jt @ (J @ direction) + raised * direction
            bent = float(direction @ product)
            if not bent > 0:
                break
            length = square / bent
            p += length * direction
            residual -= length * product
            preconditioned = inverse @ residual
            square, before = float(residual @ preconditioned), square
            direction = preconditioned + (square / before) * direction
        return Step(p, "conjugate gradients")


def by_columns_of(jacobian: Matrix) -> csc_array:
    """The nonzeros of J, column by column."""
    return csc_array(jacobian) if isinstance(jacobian, np.ndarray) else by_nonzeros(jacobian)


def _inverse_of_blocks(J: csc_array, raised: Array, size: int) -> bsr_array:
    """The inverse of the blocks (size, size) on the diagonal of J'J + diag(raised)."""
    n = J.shape[1]
    blocks = _blocks(J, size)
    places = np.arange(size)
    blocks[:, places, places] += raised.reshape(-1, size)
    trace = np.einsum("bii->b", blocks)
    blocks[:, places, places] += np.where(trace > 0, SMALLEST * trace, 1.0)[:, None]
    where = np.arange(n // size)
    return bsr_array((np.linalg.inv(blocks), where, np.arange(n // size + 1)), shape=(n, n))


def _blocks(J: csc_array, size: int) -> Array:
    """The blocks (n / size, size, size) on the diagonal of J'J, as sums over J's rows."""
    m, n = J.shape
    columns = columns_of_nonzeros(J)
    places = (columns // size) * m + J.indices  # a number for each row of each block of columns
    order = np.argsort(places, kind="stable")
    sorted_places = places[order]
    first = np.concatenate([[True], sorted_places[1:] != sorted_places[:-1]])
    rows = np.zeros((int(first.sum()), size))
    rows[np.cumsum(first) - 1, columns[order] % size] = J.data[order]
    of_block = sorted_places[first] // m
    found = np.empty((n // size, size, size))
    for i in range(size):
        for j in range(i + 1):
            found[:, i, j] = found[:, j, i] = sums(of_block, rows[:, i] * rows[:, j], n // size)
    return found
