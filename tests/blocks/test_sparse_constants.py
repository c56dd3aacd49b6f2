"""SciPy's sparse arrays as CasADi's matrices, in every version of both."""

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import coo_array, csc_array

from workbench.blocks.sparse_constants import sparse_constant

pytestmark = pytest.mark.browser


@pytest.mark.parametrize("kind", [csc_array, coo_array])
def test_sparse_constant_is_the_same_matrix(kind) -> None:
    given = kind(([1.0, 2.0, 0.0, 4.0], ([2, 0, 1, 0], [0, 1, 1, 0])), shape=(3, 4))
    found = sparse_constant(given)
    np.testing.assert_array_equal(np.asarray(cs.densify(found)), given.toarray())
    assert found.nnz() == 4  # a stored zero is an entry


def test_sparse_constant_sorts_and_sums_entries_in_a_copy() -> None:
    given = csc_array(([1.0, 2.0, 3.0], [2, 0, 2], [0, 3]), shape=(3, 1))
    np.testing.assert_array_equal(np.asarray(sparse_constant(given)).ravel(), [2, 0, 4])
    assert given.indices.tolist() == [2, 0, 2]
