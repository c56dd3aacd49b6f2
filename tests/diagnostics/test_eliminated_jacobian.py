"""What is known without singular values is what the singular values say."""

from functools import cache

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array

from tests.diagnostics.test_sparse import always_sparse
from tests.diagnostics.test_tied_parts import jacobian
from workbench import Block, Diagnosis, Problem, Values, diagnose
from workbench.arrays import Array
from workbench.diagnostics.active_set import ConstrainedJacobian
from workbench.diagnostics.eliminated_jacobian import EliminatedJacobian
from workbench.diagnostics.identifiability import identifiability, prior_sigma
from workbench.diagnostics.null_space import LISTED
from workbench.errors import NotFinite, TooLarge
from workbench.problem import Linearization, storage
from workbench.problem.lanczos import largest_eigenpairs
from workbench.residuals import Residual

N = jacobian(0, np.eye(0)).shape[1]
SIZES = np.exp(np.random.default_rng(1).standard_normal(N))  # yardsticks
NOTHING = np.zeros(0, dtype=np.int64)


def rows_of(kind: str) -> Array:
    """Constraints: none; within single parts, and on single unknowns; and across parts as well."""
    A = np.zeros((4, N))
    A[0, :4], A[1, 6:9], A[2, 10], A[3, N - 1] = 1, 2, 1, 3
    across = np.random.default_rng(5).standard_normal((2, N))
    return {"none": A[:0], "in parts": A, "across": np.vstack([A, across])}[kind]


@cache
def both(lost: int, ties: int, kind: str) -> tuple[ConstrainedJacobian, ConstrainedJacobian]:
    """The same Jacobian under the same constraints, sparse and as an array."""
    J, A = jacobian(lost, np.eye(ties)), rows_of(kind)
    sparse = ConstrainedJacobian(Linearization(np.zeros(len(J)), csc_array(J)), A)
    return sparse, ConstrainedJacobian(Linearization(np.zeros(len(J)), J), A)


def eliminated(constrained: ConstrainedJacobian) -> EliminatedJacobian:
    found = constrained.by_elimination
    assert found is not None
    return found


EACH = pytest.mark.parametrize("kind", ["none", "in parts", "across"])
LOST = pytest.mark.parametrize("lost", [0, 1])
TIES = pytest.mark.parametrize("ties", [0, 1, 30])


@EACH
@LOST
@TIES
def test_weakest_condition_and_counts_are_those_of_all_singular_values(
    lost: int, ties: int, kind: str
) -> None:
    sparse, dense = both(lost, ties, kind)
    found = eliminated(sparse).scaled(SIZES)
    reduced = dense.measured(SIZES).reduced
    s = reduced.spectrum.s[: reduced.spectrum.rank]
    assert found.here.shape[1] - found.nullity == dense.rank
    values, vectors = found.weakest(5)
    np.testing.assert_allclose(values, s[::-1][:5], rtol=1e-5)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(5), atol=1e-8)
    np.testing.assert_allclose(found.rows @ vectors, 0, atol=1e-7)
    along = np.linalg.norm(found.here.along(vectors), axis=0)
    np.testing.assert_allclose(along, values, rtol=1e-4)
    assert found.condition == pytest.approx(s[0] / s[-1], rel=1e-5)
    for limit in (0.3 * s[-1], 1.01 * s[-1], 1.5, 3.0, 8.0, 2 * s[0]):
        assert found.count_below(limit) == np.sum(s < limit)


@EACH
@LOST
@TIES
def test_what_is_known_of_each_unknown_is_what_singular_values_say(
    lost: int, ties: int, kind: str
) -> None:
    every = []
    for constrained in both(lost, ties, kind):
        priors = np.arange(constrained.here.shape[0]) % 3 == 0
        far = np.full(N, np.inf)
        every.append(identifiability(constrained, priors, far, SIZES, NOTHING, NOTHING))
    found, expected = every
    assert found.data_share is None
    assert expected.data_share is not None
    np.testing.assert_allclose(found.sigma, expected.sigma, rtol=1e-6, atol=1e-7)
    assert found.effective == pytest.approx(expected.effective, abs=1e-8)
    assert found.better_from_data == expected.better_from_data
    assert found.verdicts == expected.verdicts
    pairs = [(a, b) for a, b, _ in expected.correlations]
    assert [(a, b) for a, b, _ in found.correlations] == pairs
    for (_, _, one), (_, _, other) in zip(found.correlations, expected.correlations, strict=True):
        assert one == pytest.approx(other, abs=1e-7)


def test_priors_that_share_no_row_have_sigmas_of_their_own() -> None:
    rows = np.zeros((6, 6))
    rows[0, 0], rows[1, 1], rows[2:4, 2:4], rows[4:, 2] = 2, 4, [[3, 1], [1, 2]], 1
    every = np.ones(6, dtype=bool)
    sparse, dense = (
        prior_sigma(Linearization(np.zeros(6), J), every) for J in (csc_array(rows), rows)
    )
    np.testing.assert_allclose(sparse, dense, rtol=1e-9)
    np.testing.assert_allclose(sparse[[0, 1, 4, 5]], [0.5, 0.25, np.inf, np.inf])


def test_eigenpairs_are_found_from_products() -> None:
    rng = np.random.default_rng(3)
    for n in (1, 2, 4, 40):
        half = rng.standard_normal((n, n))
        S = half @ half.T
        values, vectors = largest_eigenpairs(S.__matmul__, n, 3, 1e-10)
        expected = np.linalg.eigvalsh(S)[::-1][:3]
        np.testing.assert_allclose(values, expected, rtol=1e-8)
        np.testing.assert_allclose(S @ vectors, vectors * values, atol=1e-6 * values[0])
    none, _ = largest_eigenpairs(lambda v: v * np.nan, 5, 2, 1e-6)
    assert none.size == 0


# Whole diagnoses.


def problem(J: Array) -> tuple[Problem, Values]:
    """Residuals J x - 1 of one block, whose Jacobian is stored as `storage` decides."""
    x = Block("x", (J.shape[1],), "m")
    columns = cs.MX(cs.sparsify(cs.DM(J))) @ x.symbol - 1
    return Problem([Residual("rows", columns, 1.0)], ("x",), blocks=(x,)), {
        "x": np.zeros(J.shape[1])
    }


def diagnosed(J: Array) -> Diagnosis:
    found = diagnose(*problem(J), priors=())
    assert isinstance(found, Diagnosis)
    return found


def without_singular_values(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on nothing that is as large as n x n may be computed of a linearization."""

    def refused(_: Linearization) -> None:
        raise AssertionError("an array of n x n was computed")

    for name in ("spectrum", "singular_values", "unit_triangle", "R"):
        monkeypatch.setattr(Linearization, name, property(refused))


@pytest.mark.parametrize("lost", [0, 1])
def test_a_diagnosis_has_weak_directions_and_no_singular_values(
    lost: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    J = 0.5 * jacobian(lost, np.eye(30))
    dense = diagnosed(J)
    assert dense.by_elimination is None
    spectrum, count = dense.point.measured.reduced.spectrum, dense.weak_count
    weak = (spectrum.s > spectrum.tolerance) & (spectrum.s < 0.99)
    basis = spectrum.Vt[: len(weak)][weak].T
    weakest, condition, parallel = dense.weakest, dense.condition, dense.parallel_columns
    assert count > LISTED
    always_sparse(monkeypatch)
    without_singular_values(monkeypatch)
    sparse = diagnosed(J)
    assert sparse.by_elimination is not None
    assert sparse.weak_count == count
    assert len(sparse.weak_directions) == LISTED
    changes = [direction.change for direction in sparse.weak_directions]
    assert changes == sorted(changes)
    assert changes[0] == pytest.approx(weakest[0].singular_value, rel=1e-4)
    assert max(changes) < 0.99
    for direction in sparse.weak_directions:  # they lie in the span of all weak ones
        v = direction.vector / np.linalg.norm(direction.vector)
        assert np.linalg.norm(v - basis @ (basis.T @ v)) < 1e-4
    assert sparse.weakest[0].change == pytest.approx(weakest[0].change, rel=1e-4)
    assert sparse.condition == pytest.approx(condition, rel=1e-5)
    pairs = [(p.first, p.second) for p in parallel]
    assert [(p.first, p.second) for p in sparse.parallel_columns] == pairs
    text = sparse.report()
    assert "by eliminating its parts, without singular values" in text
    assert f"and {count - LISTED} more" in text
    assert f"{count} weak directions" in str(sparse)
    assert sparse.data()["singular_values"] == []
    assert sparse.data()["weak_count"] == count


def test_more_unknowns_than_arrays_could_hold_are_diagnosed_if_they_fall_into_parts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    always_sparse(monkeypatch)
    monkeypatch.setattr(storage, "WIDE", 100)
    without_singular_values(monkeypatch)
    found = diagnosed(jacobian(1, np.eye(30)))
    assert found.rank == 335
    assert "numerical rank 335 of 365" in found.report()
    full = np.random.default_rng(0).standard_normal((250, 200))  # no parts
    with pytest.raises(TooLarge, match="the singular values of a sparse Jacobian of 250 x 200"):
        diagnosed(full)
    full[3, 5] = np.nan
    assert "not finite" in str(diagnosed(full))


def test_values_that_are_not_finite_have_no_rank_there_either(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    always_sparse(monkeypatch)
    J = jacobian(0, np.eye(30))
    J[7, 3] = np.inf
    found = diagnosed(J)
    assert "RANK" not in found.report()
    with pytest.raises(NotFinite, match="see `not_finite` for where"):
        found.rank  # noqa: B018
