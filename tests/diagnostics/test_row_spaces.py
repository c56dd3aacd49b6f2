"""What rows span and what they leave free: two bases that together are a basis of everything."""

import numpy as np
import pytest
import scipy.linalg

from workbench.diagnostics.row_spaces import held, row_space, tangent_space

ROWS = {
    "a bound and rows of rank one": [
        [0.0, 0, 2, 0],
        [1, 1, 0, 0],
        [1, 1, 5, 0],
        [2, 2, 1, 0],
    ],
    "bounds alone": [[0.0, 3, 0], [0, -1, 0], [1e-9, 0, 0]],
    "a row that is held but for rounding": [[1.0, 0, 0], [1, 1e-18, 0]],
    "a row that is held but for little": [[1.0, 0, 0], [1e6, 1e-6, 0]],
    "rows of very different units": [[1e6, 1e6, 0, 0], [0, 1e-6, 1e-6, 0]],
    "a row of zeros": [[0.0, 0, 0], [1, 1, 0]],
    "no rows": np.zeros((0, 4)),
    "no unknowns": np.zeros((0, 0)),
    "all unknowns": np.random.default_rng(0).normal(size=(5, 3)),
}
RANKS = dict(zip(ROWS, (2, 2, 1, 2, 2, 1, 0, 0, 3), strict=True))


@pytest.mark.parametrize("name", ROWS)
def test_the_two_bases_are_orthonormal_and_together_complete(name: str) -> None:
    rows = np.array(ROWS[name], dtype=float)
    n = rows.shape[1]
    span, free = row_space(rows), tangent_space(rows)
    assert span.shape == (RANKS[name], n)
    assert free.shape == (n, n - RANKS[name])
    whole = np.vstack([span, free.T])
    np.testing.assert_allclose(whole @ whole.T, np.eye(n), atol=1e-14)
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    np.testing.assert_allclose(rows @ free / np.where(lengths > 0, lengths, 1.0), 0, atol=1e-14)


def test_the_span_is_that_of_scipy() -> None:
    rows = np.random.default_rng(1).normal(size=(4, 9)) * (np.arange(9) < 6)
    other = scipy.linalg.null_space(rows)
    free = tangent_space(rows)
    np.testing.assert_allclose(free @ free.T, other @ other.T, atol=1e-14)


def test_bounds_and_unread_unknowns_are_exact() -> None:
    rows = np.array([[0.0, 0, 7, 0, 0], [1, 2, 3, 0, 0]])
    np.testing.assert_array_equal(row_space(rows)[0], [0, 0, 1, 0, 0])
    free = tangent_space(rows)
    np.testing.assert_array_equal(free[2], 0)
    np.testing.assert_array_equal(free[:, :2], np.eye(5)[:, 3:])


def test_what_is_held_is_taken_from_the_other_rows() -> None:
    still, others = held(np.array([[0.0, 5, 0], [3, 4, 0], [0, 0, 0]]))
    assert still.tolist() == [False, True, False]
    np.testing.assert_allclose(others, [[0.6, 0, 0]])
