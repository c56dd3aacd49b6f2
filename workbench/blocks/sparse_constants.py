"""Sparse matrices of SciPy's as constants of CasADi's."""

import casadi as cs
from scipy.sparse import coo_array, csc_array, csr_array


def sparse_constant(matrix: csc_array | csr_array | coo_array) -> cs.DM:
    """The matrix (m, n) with the same stored entries, also those that are zero.

    `cs.DM(matrix)` needs five times as long, and in CasADi 3.7 it takes SciPy's sparse matrices
    but not its sparse arrays.
    """
    columns = csc_array(matrix).sorted_indices()  # a copy, which is CasADi's order
    columns.sum_duplicates()
    sparsity = cs.Sparsity(*columns.shape, columns.indptr.tolist(), columns.indices.tolist())
    return cs.DM(sparsity, columns.data.tolist())
