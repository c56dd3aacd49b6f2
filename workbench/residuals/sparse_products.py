"""Products of a sparse matrix with the rows of an array, by compiled code or by SciPy.

The derivative of contacts is W dV/dx, with few entries in a row of W. The derivative of vertices
is at hand transposed, (n, 3 N). SciPy copies it to multiply it, which takes most of the time.
"""

import ctypes
from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.compiling import library_or_none, source_beside

NAME = "sparse-products"
FAST = ("-O3",)  # with it, compilers turn the loops over lanes into vector instructions
LANES = 8  # as in sparse_products.c
TRIED = 20, 30, 11  # rows and columns of a matrix, and rows of an array, that a library is tried on

Product = Callable[[csr_array, Array, Array], None]


def write_product(W: csr_array, rows: Array, into: Array) -> None:
    """Write (W rows')' to into (n, m), for W (m, w) and rows (n, w)."""
    way = compiled()
    plain = rows.flags.c_contiguous and rows.dtype == into.dtype == W.dtype == np.float64
    fits = into.shape == (len(rows), W.shape[0]) and W.shape[1] == rows.shape[1]
    room = into.flags.writeable and into.strides[1] == 8 and into.strides[0] % 8 == 0
    if way is not None and plain and fits and room:
        way(W, rows, into)
    else:
        into[...] = (W @ rows.T).T


@cache
def compiled() -> Product | None:
    """The compiled product, loaded once per process; None where there is no compiler."""
    source = source_beside(__package__, "sparse_products.c")
    library = library_or_none(NAME, source, _agrees, "sparse products are computed by SciPy", FAST)
    return None if library is None else _by(library)


def _by(library: ctypes.CDLL) -> Product:
    """The product by a library, for arrays of float64 whose rows are in one piece."""

    def write(W: csr_array, rows: Array, into: Array) -> None:
        starts, columns = (np.ascontiguousarray(a, np.intp) for a in (W.indptr, W.indices))
        entries = np.ascontiguousarray(W.data)
        room = np.zeros((rows.shape[1], LANES))
        sizes = len(rows), rows.shape[1], rows.ctypes.data, W.shape[0]
        arrays = (a.ctypes.data for a in (starts, columns, entries, into))
        words = *sizes, *arrays, into.strides[0] // 8, room.ctypes.data
        library.rows_times(*map(ctypes.c_ssize_t, words))

    return write


def _agrees(library: ctypes.CDLL) -> bool:
    """Whether the library says what SciPy says, about a random matrix with an empty row."""
    rng, (m, w, n) = np.random.default_rng(0), TRIED
    dense = rng.standard_normal((m, w)) * (rng.uniform(size=(m, w)) < 0.3)
    dense[1] = 0.0
    rows, wider = rng.standard_normal((n, w)), np.zeros((n, m + 1))
    _by(library)(csr_array(dense), rows, wider[:, 1:])
    right = np.allclose(wider[:, 1:], rows @ dense.T, rtol=0, atol=1e-12)
    return bool(right and not wider[:, 0].any())
