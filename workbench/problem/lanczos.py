"""The largest eigenvalues of a symmetric matrix of which only products with vectors are known."""

from collections.abc import Callable

import numpy as np
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from workbench.arrays import Array


def largest_eigenvalue(product: Callable[[Array], Array], n: int, accuracy: float) -> float:
    """The size of the eigenvalue of largest size, by Lanczos' method.

    `product` takes a vector (n,) to the matrix times it, and `accuracy` is the relative error. NaN
    where the method does not converge, or a product is not finite.
    """
    first = np.random.default_rng(0).standard_normal(n)
    if n <= 2:  # too small for the method
        matrix = np.array([product(unit) for unit in np.eye(n)])
        return float(np.linalg.norm(matrix, 2)) if np.isfinite(matrix).all() else np.nan
    if not np.isfinite(product(first)).all():
        return np.nan
    operator = LinearOperator((n, n), lambda v: product(v.ravel()), dtype=float)
    try:
        found = eigsh(operator, 1, v0=first, tol=accuracy, return_eigenvectors=False)
    except ArpackNoConvergence:
        return np.nan
    return float(abs(found[0]))


def largest_eigenpairs(
    product: Callable[[Array], Array], n: int, most: int, accuracy: float
) -> tuple[Array, Array]:
    """The `most` largest eigenvalues (q,), falling, of a matrix without negative ones.

    With them come their vectors (n, q), orthonormal. There are fewer where the method does not
    converge, and none where a product is not finite.
    """
    first = np.random.default_rng(0).standard_normal(n)
    if most < 1 or not np.isfinite(product(first)).all():
        return np.zeros(0), np.zeros((n, 0))
    if n <= max(2, most + 1):  # too small for the method
        matrix = np.column_stack([product(unit) for unit in np.eye(n)])
        values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    else:
        operator = LinearOperator((n, n), lambda v: product(v.ravel()), dtype=float)
        try:
            values, vectors = eigsh(operator, most, v0=first, tol=accuracy)
        except ArpackNoConvergence as error:
            values, vectors = error.eigenvalues, error.eigenvectors
    order = np.argsort(-values)[:most]
    return np.asarray(values[order]), np.asarray(vectors[:, order])
