"""The nearest point under bounds and linear limits: part by part as at once."""

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize
from scipy.sparse import csc_array, random_array

from workbench.problem import storage
from workbench.problem.least_distance import Limits, at_once, by_parts, nearest


def limits(seed: int, n: int = 30, k: int = 12, equations: bool = True) -> tuple:
    """A pull, and limits that a known point meets: equations, one side, two sides, and bounds."""
    rng = np.random.default_rng(seed)
    A = random_array((k, n), density=0.08, rng=rng, data_sampler=rng.standard_normal).toarray()
    A[np.arange(k), rng.permutation(n)[:k]] += 1.0  # no row is empty
    A /= np.linalg.norm(A, axis=1)[:, None]
    inside = rng.standard_normal(n)
    room = rng.uniform(0.1, 1.0, (2, k))
    kind = np.arange(k) % 3
    down = A @ inside - np.where(kind == 0, 0.0 if equations else room[0], room[0])
    up = A @ inside + np.where(kind == 0, 0.0 if equations else room[1], room[1])
    up[kind == 1] = np.inf
    left, right = np.full(n, -np.inf), np.full(n, np.inf)
    left[::4], right[1::5] = inside[::4] - 0.2, inside[1::5] + 0.3
    return 3 * rng.standard_normal(n), Limits(left, right, A, down, up)


@pytest.mark.parametrize("seed", range(12))
def test_part_by_part_is_at_once(seed: int) -> None:
    pull, given = limits(seed)
    expected = at_once(pull, given)
    found = by_parts(pull, given._replace(A=csc_array(given.A)))
    # both solve least-squares problems of condition below a hundred or so in double precision
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_answer_of_a_quadratic_program(seed: int) -> None:
    pull, given = limits(seed, n=12, k=5)
    ended = minimize(
        lambda d: 0.5 * np.sum((d - pull) ** 2),
        np.zeros(12),
        jac=lambda d: d - pull,
        hess=lambda d: np.eye(12),
        method="trust-constr",
        options={"gtol": 1e-12, "xtol": 1e-14, "maxiter": 5000},
        constraints=[
            LinearConstraint(given.A, given.down, given.up),
            LinearConstraint(np.eye(12), given.left, given.right),
        ],
    )
    np.testing.assert_allclose(at_once(pull, given), ended.x, atol=1e-4)
    np.testing.assert_allclose(
        by_parts(pull, given._replace(A=csc_array(given.A))), ended.x, atol=1e-4
    )


def test_unknowns_that_no_limit_stops_keep_their_pull() -> None:
    """100,000 unknowns, of which three are read: an array n x n would take 80 GB."""
    n = 100_000
    pull = np.random.default_rng(0).standard_normal(n)
    A = csc_array(([0.6, 0.8, 1.0], ([0, 0, 1], [10, 20, 30])), shape=(2, n))
    left = np.full(n, -np.inf)
    left[40] = pull[40] + 1.0
    found = nearest(pull, Limits(left, np.full(n, np.inf), A, np.zeros(2), np.array([0.0, np.inf])))
    expected = pull.copy()
    expected[[10, 20]] -= (0.6 * pull[10] + 0.8 * pull[20]) * np.array([0.6, 0.8])
    expected[30], expected[40] = max(pull[30], 0.0), pull[40] + 1.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15 * 10)


def test_a_stored_zero_ties_nothing_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Structure may have entries that are zero here: two rows that share one are still apart."""
    A = csc_array((np.array([1.0, 0.0, 1.0]), ([0, 0, 1], [0, 1, 1])), shape=(2, 2))
    assert A.nnz == 3
    monkeypatch.setattr(storage, "DENSE_FROM", 0)
    free = np.full(2, np.inf)
    limit = np.array([1.0, 2.0])
    found = nearest(np.zeros(2), Limits(-free, free, A, limit, limit))
    np.testing.assert_array_equal(found, limit)


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize(
    ("rows", "down", "up"),
    [
        ([[1.0, 1.0], [2.0, 2.0]], [1.0, -9.0], [9.0, 1.0]),  # x + y >= 1 and <= 1/2
        ([[0.0, 0.0], [1.0, 0.0]], [1.0, 0.0], [2.0, 0.0]),  # 0 >= 1
        ([[1.0, 0.0]], [5.0], [6.0]),  # beyond the bound of 4
    ],
)
def test_what_cannot_be_met_is_infinite(
    monkeypatch: pytest.MonkeyPatch, large: bool, rows, down, up
) -> None:
    if large:
        monkeypatch.setattr(storage, "DENSE_FROM", 0)
    bound = np.full(2, 4.0)
    A = csc_array(np.array(rows)) if large else np.array(rows)
    found = nearest(np.zeros(2), Limits(-bound, bound, A, np.array(down), np.array(up)))
    assert np.isinf(found).all()


@pytest.mark.parametrize("seed", range(4))
def test_rows_may_have_any_length(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    pull, given = limits(seed)
    lengths = np.random.default_rng(seed).uniform(1e-3, 1e3, len(given.down))
    long = given._replace(
        A=given.A * lengths[:, None], down=given.down * lengths, up=given.up * lengths
    )
    expected = at_once(pull, given)
    np.testing.assert_allclose(nearest(pull, long), expected, rtol=0, atol=1e-11)
    monkeypatch.setattr(storage, "DENSE_FROM", 0)
    long = long._replace(A=csc_array(long.A))
    np.testing.assert_allclose(nearest(pull, long), expected, rtol=0, atol=1e-11)
