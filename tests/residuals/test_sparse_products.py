"""Products of a sparse matrix with the rows of an array, compiled and by SciPy."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from workbench.residuals import sparse_products
from workbench.residuals.sparse_products import write_product


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("count", [1, 8, 21])
def test_a_product_is_written_where_it_belongs(
    monkeypatch: pytest.MonkeyPatch, compiled: bool, count: int
) -> None:
    """The rows of the target may stand apart, and rows of the matrix may be empty."""
    if not compiled:
        monkeypatch.setattr(sparse_products, "compiled", lambda: None)
    rng = np.random.default_rng(count)
    dense = rng.standard_normal((40, 60)) * (rng.uniform(size=(40, 60)) < 0.1)
    dense[3] = 0.0
    rows, into = rng.standard_normal((count, 60)), np.full((count, 50), 7.0)
    write_product(csr_array(dense), rows, into[:, 5:45])
    np.testing.assert_allclose(into[:, 5:45], rows @ dense.T, rtol=0, atol=1e-13)
    assert (into[:, :5] == 7).all()
    assert (into[:, 45:] == 7).all()


def test_other_arrays_are_multiplied_too() -> None:
    """Columns that stand apart in memory, and a target whose columns do."""
    rng = np.random.default_rng(0)
    dense, rows = rng.standard_normal((5, 6)), rng.standard_normal((6, 4)).T
    into = np.zeros((5, 4)).T
    write_product(csr_array(dense), rows, into)
    np.testing.assert_allclose(into, rows @ dense.T, rtol=0, atol=1e-13)


@pytest.mark.parametrize("wrong", ["too few rows", "a narrow target", "other columns", "read only"])
def test_arrays_that_do_not_fit_are_refused(wrong: str) -> None:
    """As SciPy and NumPy do; compiled code would write beside them."""
    W, rows, into = csr_array(np.eye(5, 6)), np.ones((4, 6)), np.zeros((4, 5))
    into.flags.writeable = wrong != "read only"
    given = {
        "too few rows": (W, rows, into[:3]),
        "a narrow target": (W, rows, into[:, :4]),
        "other columns": (W, np.ones((4, 7)), into),
        "read only": (W, rows, into),
    }[wrong]
    with pytest.raises(ValueError, match=r"broadcast|mismatch|dimension|read-only"):
        write_product(*given)
