"""Parts that long rows tie together: rank, null space, variances and condition as by dense SVD."""

import numpy as np
import pytest
from scipy.sparse import csc_array

from workbench.arrays import Array
from workbench.diagnostics.active_set import ConstrainedJacobian
from workbench.diagnostics.elimination import Elimination
from workbench.diagnostics.parts import Parts
from workbench.diagnostics.tied_elimination import TiedElimination
from workbench.problem import Linearization
from workbench.problem.lanczos import largest_eigenvalue

PARTS, OWN, SHARED, LINES = 60, 6, 5, 12  # parts, unknowns of each, shared ones, rows of each part


def jacobian(lost: int, tie: Array) -> Array:
    """Rows of parts that read shared unknowns too, each part without `lost` of its directions,
    and rows below them that tie the parts together.
    """
    rng = np.random.default_rng(0)
    n = PARTS * OWN + SHARED
    J = np.zeros((PARTS * LINES, n))
    for k in range(PARTS):
        rows, own = slice(k * LINES, (k + 1) * LINES), slice(k * OWN, (k + 1) * OWN)
        seen = rng.standard_normal((LINES, OWN - lost)) @ rng.standard_normal((OWN - lost, OWN))
        J[rows, own] = seen
        J[rows, -SHARED:] = rng.standard_normal((LINES, SHARED))
    return np.vstack([J, tie @ rng.standard_normal((tie.shape[1], n))])


def parts_of(J: Array) -> Parts:
    found = Parts.of(Linearization(np.zeros(len(J)), csc_array(J)))
    assert found is not None
    assert found.count == PARTS
    return found


@pytest.mark.parametrize("lost", [0, 1])
@pytest.mark.parametrize("ties", [1, 30, 80])
def test_rank_null_space_and_variances_are_those_of_all_rows(lost: int, ties: int) -> None:
    J = jacobian(lost, np.eye(ties))
    parts = parts_of(J)
    assert parts.ties.shape[0] == ties
    found = TiedElimination.of(parts)
    assert isinstance(found, TiedElimination)
    unit = J / np.linalg.norm(J, axis=0)
    s, Vt = np.linalg.svd(unit)[1:]
    rank = int(np.sum(s > 1e-10))
    assert found.rank == rank == min(J.shape[1], PARTS * (OWN - lost) + SHARED + ties)
    N = found.null_vectors.toarray()
    assert N.shape == (J.shape[1], J.shape[1] - rank)
    assert np.linalg.matrix_rank(N) == N.shape[1]
    np.testing.assert_allclose(unit @ N, 0, atol=1e-10)
    expected = np.sum((Vt[:rank].T / s[:rank]) ** 2, axis=1)
    expected[np.sum(Vt[rank:] ** 2, axis=0) > 1e-9] = np.inf
    np.testing.assert_allclose(found.variances, expected, rtol=1e-7)
    B = np.random.default_rng(1).standard_normal((J.shape[1], 3))
    if rank == J.shape[1]:
        np.testing.assert_allclose(
            found.covariance_times(B), np.linalg.solve(unit.T @ unit, B), rtol=1e-6, atol=1e-9
        )


def test_without_ties_it_is_the_elimination_of_the_parts() -> None:
    assert isinstance(TiedElimination.of(parts_of(jacobian(0, np.zeros((0, 0))))), Elimination)


def test_ties_that_see_much_more_than_the_parts_are_left_to_the_dense_way() -> None:
    J = jacobian(0, np.eye(20))
    weak = J[: PARTS * LINES]
    weak[:, 0] *= 1e-9  # the ties alone tell what this unknown is
    weak[:, 1] = weak[:, 0]
    assert TiedElimination.of(parts_of(J)) is None


def test_a_diagnosis_uses_it() -> None:
    J = jacobian(0, np.eye(30))
    here = Linearization(np.zeros(len(J)), csc_array(J))
    A = np.zeros((2, J.shape[1]))
    A[0, :4], A[1, 6:9] = 1.0, 2.0
    by_parts = ConstrainedJacobian(here, A)
    assert isinstance(by_parts.eliminated, TiedElimination)
    dense = ConstrainedJacobian(Linearization(here.residual, J), A)
    assert dense.eliminated is None
    assert by_parts.rank == dense.rank == J.shape[1]
    assert by_parts.condition == pytest.approx(dense.condition, rel=1e-5)


def test_the_largest_eigenvalue_is_found_from_products() -> None:
    rng = np.random.default_rng(3)
    for n in (1, 2, 3, 40):
        S = rng.standard_normal((n, n))
        S = S + S.T
        found = largest_eigenvalue(S.__matmul__, n, 1e-8)
        assert found == pytest.approx(abs(np.linalg.eigvalsh(S)).max(), rel=1e-6)
    assert np.isnan(largest_eigenvalue(lambda v: v * np.nan, 5, 1e-8))
