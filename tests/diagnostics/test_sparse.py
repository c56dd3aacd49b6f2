"""Large sparse Jacobians take another way, to the same answers as far as it goes."""

import json
import subprocess
import sys
import tracemalloc

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array, random_array

from workbench import (
    Block,
    Constraint,
    Diagnosis,
    Problem,
    Values,
    diagnose,
    load_body,
    residuals,
)
from workbench.problem import Linearization, storage
from workbench.residuals import Residual


def sparse_problem(m: int, n: int, seed: int = 0) -> tuple[Problem, Values]:
    """m rows of about eight entries; x[7] is read by nobody, x[8] and x[9] by the same rows."""
    rng = np.random.default_rng(seed)
    A = random_array((m, n), density=8 / n, rng=rng, format="lil")
    A[:, 7] = 0
    A[:, 9] = A[:, [8]]
    A = csc_array(A)
    A.eliminate_zeros()
    matrix = cs.DM(cs.Sparsity(m, n, A.indptr.tolist(), A.indices.tolist()), A.data)
    x, y = Block("x", (n - n // 4,)), Block("y", (n // 4,))
    r = matrix @ cs.vertcat(x.symbol, y.symbol) - 1
    terms = (
        Residual("first", r[: m // 2], 0.1),
        Residual("second", r[m // 2 :], 0.2),
        residuals.gaussian(y.symbol, covariance=4.0, name="prior"),
    )
    values = {"x": rng.normal(size=x.shape), "y": np.zeros(y.shape)}
    return Problem(terms, ("x", "y"), blocks=(x, y)), values


def always_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on the Jacobian of a new problem is sparse, however small it is."""
    monkeypatch.setattr(storage, "DENSE_FROM", 0)
    monkeypatch.setattr(storage, "SPARSE_UP_TO", 2.0)


@pytest.fixture
def both(monkeypatch: pytest.MonkeyPatch) -> tuple[Diagnosis, Diagnosis]:
    """The same problem by dense and by sparse methods."""
    problem, values = sparse_problem(400, 60)
    dense = diagnose(problem, values, priors=("prior",))
    always_sparse(monkeypatch)
    return dense, diagnose(sparse_problem(400, 60)[0], values, priors=("prior",))


def test_the_numbers_are_those_of_the_dense_way(both: tuple[Diagnosis, Diagnosis]) -> None:
    dense, sparse = both
    assert (dense.here.estimated, sparse.here.estimated) == (False, True)
    assert dense.rank == sparse.rank == 58
    assert dense.scaled_rank == sparse.scaled_rank == 58
    assert dense.structural_rank == sparse.structural_rank == 59
    s = dense.singular_values
    np.testing.assert_allclose(sparse.singular_values[:58], s[:58], rtol=1e-10)
    np.testing.assert_allclose(sparse.singular_values[58:], 0, atol=1e-7 * s[0])
    np.testing.assert_allclose(
        sparse.scaled_singular_values[:58], dense.scaled_singular_values[:58], rtol=1e-10
    )
    assert [d.name for d in sparse.null_directions] == [d.name for d in dense.null_directions]
    np.testing.assert_allclose(sparse.identifiability.sigma, dense.identifiability.sigma)
    np.testing.assert_allclose(
        sparse.identifiability.prior_sigma, dense.identifiability.prior_sigma
    )
    assert sparse.identifiability.effective == pytest.approx(dense.identifiability.effective)
    assert sparse.identifiability.verdicts == dense.identifiability.verdicts
    assert [(t.nonzeros, pytest.approx(t.norm)) for t in sparse.terms] == [
        (t.nonzeros, t.norm) for t in dense.terms
    ]
    assert {(p.first, p.second) for p in sparse.parallel_columns if p.sine == 0} == {(8, 9)}
    assert sparse.derivatives.passed


def test_what_is_estimated_or_left_out_is_said(both: tuple[Diagnosis, Diagnosis]) -> None:
    _, sparse = both
    text = sparse.report()
    assert "singular values are estimated from J'J" in text
    assert "leverage, nearby points and contributions are left out" in text
    assert "no residual depends on x[7]" in text
    assert "1 pair of unknowns with parallel columns: x[8] and x[9]" in text
    data = json.loads(json.dumps(sparse.data(), allow_nan=False))
    assert data["estimated"] is True
    assert (data["ranks_nearby"], data["contributions"]) == ([], [])


def test_suggestions_are_carried_out_there_too(both: tuple[Diagnosis, Diagnosis]) -> None:
    _, sparse = both
    assert sparse.suggestions
    for suggestion in sparse.suggestions:
        after = diagnose(suggestion.problem, suggestion.values)
        assert (after.rank, after.shape[1]) == (suggestion.after.rank, suggestion.after.unknowns)
    assert any(suggestion.cured for suggestion in sparse.suggestions)


def test_duplicates_and_what_is_not_finite_are_found_without_a_dense_array(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    always_sparse(monkeypatch)
    x = Block("x", (6,))
    terms = [Residual(name, factor * x.symbol, 1.0) for name, factor in (("a", 1), ("b", -3))]
    problem = Problem((*terms, Residual("root", cs.sqrt(x.symbol), 1.0)), ("x",), blocks=(x,))
    assert diagnose(problem, {"x": np.ones(6)}).duplicates == (("a", "b"),)
    found = diagnose(problem, {"x": np.array([1.0, 0, 1, 1, 1, 1])})
    assert found.not_finite == ((13, 1),)
    assert "the Jacobian is not finite: root[1] by x[1]" in found.report()
    json.dumps(found.data(), allow_nan=False)


def test_many_null_directions_of_many_unknowns_stay_short(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Differences of neighbours, in five pieces of 100 each, too many for a linear program."""
    always_sparse(monkeypatch)
    x = Block("x", (500,))
    steps = x.symbol[1:] - x.symbol[:-1]
    within = [i for i in range(499) if (i + 1) % 100]
    problem = Problem((Residual("steps", steps[within], 0.1),), ("x",), blocks=(x,))
    found = diagnose(problem, {"x": np.zeros(500)})
    assert (found.rank, len(found.null_directions)) == (495, 5)
    pieces = sorted(np.flatnonzero(d.vector).tolist() for d in found.null_directions)
    assert pieces == [list(range(100 * k, 100 * k + 100)) for k in range(5)]


def test_rows_and_columns_are_those_of_the_matrix() -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(7, 4)) * (rng.random((7, 4)) < 0.5)
    for matrix in (A, csc_array(A)):
        here = Linearization(np.arange(7.0), matrix)
        np.testing.assert_array_equal(here.row(3), A[3])
        np.testing.assert_array_equal(here.column(2), A[:, 2])
        np.testing.assert_allclose(here.row_norms, np.linalg.norm(A, axis=1))
        np.testing.assert_allclose(here.column_norms, np.linalg.norm(A, axis=0))
        np.testing.assert_allclose(here.R.T @ here.R, A.T @ A, atol=1e-12)
        some = here.rows(np.array([1, 5]))
        np.testing.assert_array_equal(some.along(np.ones(4)), A[[1, 5]].sum(axis=1))
        np.testing.assert_array_equal(some.residual, [1, 5])
        np.testing.assert_array_equal(here.columns(np.array([3])).column(0), A[:, 3])


@pytest.mark.thorough
def test_fifty_thousand_rows_need_no_dense_array() -> None:
    problem, values = sparse_problem(50_000, 2_000)
    tracemalloc.start()
    found = diagnose(problem, values, priors=("prior",))
    found.findings  # noqa: B018  # all but the suggestions, which free fewer blocks
    assert found.here.estimated
    assert found.rank == 1998
    assert tracemalloc.get_traced_memory()[1] < 0.5 * 8 * 50_000 * 2_000
    tracemalloc.stop()
    assert "estimated from J'J" in found.report()
    json.dumps(found.data(), allow_nan=False)


@pytest.mark.thorough
def test_a_whole_mesh_is_diagnosed() -> None:
    body = load_body("full")
    observed = Block("observed", (body.n_vertices, 3), "m")
    points = body.points(*(block.symbol for block in body.blocks()))
    problem = Problem(
        (residuals.vertices(points, observed.symbol, sigma=0.002),), ("pose", "betas", "trans")
    )
    pose = np.random.default_rng(0).normal(scale=0.3, size=(24, 3))
    values = body.start() | {"pose": pose, "observed": np.zeros(observed.shape)}
    found = diagnose(problem, values)
    assert found.shape == (36_816, 85)
    found.assert_rank(85)
    found.assert_no_warnings()
    assert found.derivatives.passed


HUGE = """
import resource
import numpy as np
import workbench as wb
from scipy.sparse import csr_array

def peak():
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

whole, N, rng = wb.load_body("full"), 200_000, np.random.default_rng(0)
some = np.concatenate([np.arange(whole.n_vertices), rng.integers(0, whole.n_vertices, N)])[:N]
regressor = csr_array(np.pad(whole.J_regressor.toarray(), ((0, 0), (0, N - whole.n_vertices))))
body = wb.SkinnedBody(
    whole.template[some], whole.shapedirs[some], whole.posedirs[some], regressor,
    whole.weights[some], whole.parents, whole.faces, whole.joint_names,
)
points = body.points(*(block.symbol for block in body.blocks()))
problem = wb.Problem(
    (wb.residuals.vertices(points, np.zeros((N, 3)), sigma=0.002),), ("pose", "betas", "trans")
)
values = body.start() | {"pose": rng.normal(scale=0.3, size=(24, 3))}
before = peak()
found = wb.diagnose(problem, values)
found.findings
print(found.rank, found.structural_rank, peak() - before)
"""


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere peaks are told in other units")
def test_two_hundred_thousand_vertices_take_a_few_times_their_jacobian() -> None:
    """The Jacobian takes 0.41 GB; by the whole graph it would be 11 GB."""
    said = subprocess.run([sys.executable, "-c", HUGE], capture_output=True, text=True, check=True)
    rank, structural, taken = map(int, said.stdout.split())
    assert rank == structural == 85
    assert taken < 4e9


def test_sparse_constraints_hold_as_dense_ones_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """An equation and one of two inequalities hold, and decide what no residual notices."""
    found = []
    for sparse in (False, True):
        if sparse:
            always_sparse(monkeypatch)
        problem, values = sparse_problem(400, 60)
        x = problem.free.blocks[0].symbol
        values["x"][[8, 9]] = 0.5, 0.3
        limits = (
            Constraint("apart", x[8] - x[9], 0.2, 0.2),
            Constraint("squares", x[:5] ** 2 - cs.DM(values["x"][:5] ** 2), upper=[0, 1, 1, 1, 1]),
        )
        held = Problem(
            problem.residuals, ("x", "y"), blocks=problem.free.blocks, constraints=limits
        )
        assert held.stacked_constraints is not None
        assert held.stacked_constraints.sparse == sparse
        found.append(diagnose(held, values, priors=("prior",)))
    dense, thin = found
    assert dense.point.active.names == thin.point.active.names == ("apart", "squares[0]")
    np.testing.assert_array_equal(dense.point.active.rows, thin.point.active.rows)
    assert dense.rank == thin.rank == 59  # x[7] alone is not noticed
    assert [d.name for d in dense.null_directions] == [d.name for d in thin.null_directions]
    np.testing.assert_allclose(thin.identifiability.sigma, dense.identifiability.sigma)
