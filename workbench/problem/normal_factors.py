"""Cholesky's factor of normal equations that are no array: by their band or by their nonzeros."""

from scipy.sparse import csc_array, diags_array

from workbench.arrays import Array
from workbench.problem.banded import BandedFactor, BandedMatrix
from workbench.problem.sparse_cholesky import SparseFactor, factorized


def factor_of(
    normal: csc_array | BandedMatrix, raised: Array
) -> BandedFactor | SparseFactor | None:
    """The factor of A + diag(raised), raised (n,).

    None where the matrix is not positive definite or too few digits are left.
    """
    if isinstance(normal, BandedMatrix):
        return normal.factorized(raised)
    return factorized(csc_array(normal + diags_array(raised)) if raised.any() else normal)
