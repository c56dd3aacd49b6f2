"""The damped step by conjugate gradients, for large sparse problems that are well conditioned."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import bsr_array, csc_array, csr_array

from workbench.arrays import Array, Mask
from workbench.errors import BadArgument
from workbench.problem.steps import Step
from workbench.problem.storage import Symmetric, crowded, dense, unblocked

if TYPE_CHECKING:
    from workbench.problem.linearization import Linearization

SMALLEST = 1e-12  # of a block's trace: a smaller eigenvalue of it is only rounding


@dataclass(frozen=True)
class ConjugateGradients:
    """A step by preconditioned conjugate gradients on the normal equations; a `LinearAlgebra`.

    The preconditioner inverts the blocks of `block` consecutive unknowns on the diagonal of
    J'J + damping D^2, such as the three coordinates of one vertex (block Jacobi; Saad, Iterative
    methods for sparse linear systems, 2003, section 10.2). Unknowns that share residuals with more
    than an eighth of all, such as the pose of a body to which these vertices are tied, are a border
    that is one more block; so are those at the beginning that are left over when the others are
    divided into blocks. A border of b unknowns takes b x b numbers, and makes every product slower.

    The iterations begin at zero, so that each result is the best step in the space it was looked
    for in: its length grows from iteration to iteration, and the cost of the linear model falls
    (Steihaug, The conjugate gradient method and trust regions, 1983). It is never uphill, even if
    it is not exact. The gain ratio compares it with what the model predicts for this very step. So
    inexact steps slow convergence, but mislead no trust region. With a relative residual eta,
    Gauss-Newton's convergence is linear with about that rate (Dembo, Eisenstat and Steihaug,
    Inexact Newton methods, 1982), which is better than what contacts that switch permit.

    It suits unknowns that share residuals with few others, beside a border of at most some hundred.

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

    def __call__(self, here: "Linearization", damping: float, D: Array) -> Step:
        """The step (n,) that nearly minimises |J p + r|^2 + damping |D p|^2."""
        return Step(self.solved(here.normal, damping * D**2, -here.gradient), "conjugate gradients")

    def solved(self, normal: Symmetric, raised: Array, right: Array) -> Array:
        """The x (n,) with (A + diag(raised)) x = right, nearly, for a semidefinite A (n, n)."""
        stored = unblocked(normal)
        A = csc_array(stored)
        last = _in_border(A, self.block)
        order = np.concatenate([np.flatnonzero(last), np.flatnonzero(~last)])
        product, inverse = _bordered(A, last, raised, self.block)
        x = np.empty(len(right))
        x[order] = self._iterated(product, inverse, right[order])
        return x

    def _iterated(self, product: "_Linear", inverse: "_Linear", right: Array) -> Array:
        """The x (n,) whose `product` is nearly `right`; `inverse` preconditions."""
        x, residual = np.zeros_like(right), right.copy()
        preconditioned = inverse(residual)
        direction, square = preconditioned, float(residual @ preconditioned)
        enough = self.tolerance**2 * square
        for _ in range(self.products):
            if not square > enough:
                break
            curved = product(direction)
            curvature = float(direction @ curved)
            if not curvature > 0:
                break
            length = square / curvature
            x += length * direction
            residual -= length * curved
            preconditioned = inverse(residual)
            square, before = float(residual @ preconditioned), square
            direction = preconditioned + (square / before) * direction
        return x


_Linear = Callable[[Array], Array]


def _in_border(A: csc_array, size: int) -> Mask:
    """Which unknowns (n,) are in the border; the others can be divided into blocks of `size`."""
    found = crowded(A)
    others = np.flatnonzero(~found)
    found[others[: len(others) % size]] = True
    return found


def _bordered(A: csc_array, border: Mask, raised: Array, size: int) -> tuple[_Linear, _Linear]:
    """Products with A + diag(raised), and with its preconditioner, with the border first."""
    b, own, rest = int(border.sum()), raised[border], raised[~border]
    inner = csc_array(A if not b else csc_array(A[:, ~border])[~border])
    S = bsr_array(csr_array(inner.T), blocksize=(size, size))  # .T is S, by rows
    inverse = _inverse_of_blocks(S, rest, size)
    columns = csc_array(A[:, border])
    between, corner = dense(csc_array(columns[~border])), dense(csc_array(columns[border]))
    corner = corner + np.diag(own)
    inverse_of_corner = np.linalg.inv(corner + np.diag(_slight(np.trace(corner), b)))

    def product(x: Array) -> Array:
        outer, others = x[:b], x[b:]
        if not b:
            return np.asarray(S @ others + rest * others)
        first = corner @ outer + others @ between
        return np.concatenate([first, between @ outer + S @ others + rest * others])

    def preconditioned(x: Array) -> Array:
        return np.concatenate([inverse_of_corner @ x[:b], inverse @ x[b:]])

    return product, preconditioned


def _slight(trace: Array, size: int) -> Array:
    """What is added to a diagonal (size,), so that a block that is zero has an inverse too."""
    return np.full(size, np.where(trace > 0, SMALLEST * trace, 1.0))


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
