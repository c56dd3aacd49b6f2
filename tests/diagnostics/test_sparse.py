"""Large sparse Jacobians take another way, to the same answers as far as it goes."""

import json

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array, random_array

from tests.tiers import few
from workbench import Block, Constraint, Diagnosis, Problem, Values, diagnose, load_body, residuals
from workbench.arrays import Array
from workbench.diagnostics.null_space import LISTED
from workbench.errors import NotFinite, TooLarge
from workbench.problem import Linearization, storage
from workbench.residuals import Residual


def always_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on the Jacobian of a new problem is sparse, however small it is."""
    monkeypatch.setattr(storage, "DENSE_FROM", 0)
    monkeypatch.setattr(storage, "SPARSE_UP_TO", 2.0)


# Rows without any order.


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


def limited(*, active: bool) -> tuple[Problem, Values]:
    """The problem above; an equation and one of two inequalities may hold."""
    problem, values = sparse_problem(200, 40)
    if not active:
        return problem, values
    x = problem.free.blocks[0].symbol
    values["x"][[8, 9]] = 0.5, 0.3
    limits = (
        Constraint("apart", x[8] - x[9], 0.2, 0.2),
        Constraint("squares", x[:5] ** 2 - cs.DM(values["x"][:5] ** 2), upper=[0, 1, 1, 1, 1]),
    )
    blocks = problem.free.blocks
    return Problem(problem.residuals, ("x", "y"), blocks=blocks, constraints=limits), values


@pytest.mark.parametrize("active", [False, True], ids=["free", "constrained"])
def test_sparse_numbers_are_the_dense_ones(active: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    dense = diagnose(*limited(active=active), priors=("prior",))
    always_sparse(monkeypatch)
    sparse = diagnose(*limited(active=active), priors=("prior",))
    assert isinstance(dense, Diagnosis)
    assert isinstance(sparse, Diagnosis)
    assert (dense.here.estimated, sparse.here.estimated) == (False, True)
    # x[7] is not noticed, nor is a shift of x[8] against x[9], unless the equation holds it
    assert dense.rank == sparse.rank == (39 if active else 38)
    assert dense.point.active.names == sparse.point.active.names
    assert dense.point.active.names == (("apart", "squares[0]") if active else ())
    assert [d.name for d in sparse.null_directions] == [d.name for d in dense.null_directions]
    one, other = sparse.identifiability, dense.identifiability
    np.testing.assert_allclose(one.sigma, other.sigma)
    assert one.verdicts == other.verdicts
    if active:
        return
    assert dense.structural_rank == sparse.structural_rank == 39
    s = dense.singular_values
    np.testing.assert_allclose(sparse.singular_values[:38], s[:38], rtol=1e-10)
    np.testing.assert_allclose(sparse.singular_values[38:], 0, atol=1e-7 * s[0])
    np.testing.assert_allclose(one.prior_sigma, other.prior_sigma)
    assert one.effective == pytest.approx(other.effective)
    assert [t.nonzeros for t in sparse.terms] == [t.nonzeros for t in dense.terms]
    assert {(p.first, p.second) for p in sparse.parallel_columns if p.sine == 0} == {(8, 9)}
    assert sparse.derivatives.passed


def test_sparse_report_says_what_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    always_sparse(monkeypatch)
    sparse = diagnose(*limited(active=False), priors=("prior",))
    text = sparse.report()
    assert "estimated from J'J" in text
    assert "are left out" in text
    assert "no residual depends on x[7]" in text
    data = json.loads(json.dumps(sparse.data(), allow_nan=False))
    assert data["estimated"] is True
    assert sparse.suggestions
    for suggestion in sparse.suggestions:
        after = diagnose(suggestion.problem, suggestion.values)
        assert (after.rank, after.shape[1]) == (suggestion.after.rank, suggestion.after.unknowns)
    assert any(suggestion.cured for suggestion in sparse.suggestions)


def test_sparse_duplicates_and_infinities_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    always_sparse(monkeypatch)
    x = Block("x", (6,))
    terms = [Residual(name, factor * x.symbol, 1.0) for name, factor in (("a", 1), ("b", -3))]
    problem = Problem((*terms, Residual("root", cs.sqrt(x.symbol), 1.0)), ("x",), blocks=(x,))
    assert diagnose(problem, {"x": np.ones(6)}).duplicates == (("a", "b"),)
    found = diagnose(problem, {"x": np.array([1.0, 0, 1, 1, 1, 1])})
    assert found.not_finite == ((13, 1),)
    assert "the Jacobian is not finite: root[1] by x[1]" in found.report()
    json.dumps(found.data(), allow_nan=False)


def test_null_directions_of_many_unknowns_stay_short(monkeypatch: pytest.MonkeyPatch) -> None:
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


# Parts that share unknowns (an arrow), and rows that tie them together.

PARTS, OWN, SHARED, LINES = 30, 6, 5, 12  # parts, unknowns of each, shared ones, rows of each part
N = PARTS * OWN + SHARED


def jacobian(lost: int, ties: int) -> Array:
    """Rows of parts that read shared unknowns too, each part without `lost` of its directions,
    and below them full rows.
    """
    rng = np.random.default_rng(0)
    J = np.zeros((PARTS * LINES, N))
    for k in range(PARTS):
        rows, own = slice(k * LINES, (k + 1) * LINES), slice(k * OWN, (k + 1) * OWN)
        seen = rng.standard_normal((LINES, OWN - lost)) @ rng.standard_normal((OWN - lost, OWN))
        J[rows, own] = seen
        J[rows, -SHARED:] = rng.standard_normal((LINES, SHARED))
    return 0.5 * np.vstack([J, rng.standard_normal((ties, N))])


def constraints(kind: str) -> Array:
    """None; within single parts, and on single unknowns; and across parts as well."""
    A = np.zeros((4, N))
    A[0, :4], A[1, 6:9], A[2, 10], A[3, N - 1] = 1, 2, 1, 3
    across = np.random.default_rng(5).standard_normal((2, N))
    return {"free": A[:0], "within": A, "across": np.vstack([A, across])}[kind]


def diagnosed(J: Array, held: Array | None = None) -> Diagnosis:
    """Of J x - 1, where `held` times x is zero, at zero."""
    x = Block("x", (J.shape[1],), "m")
    seen = Residual("rows", cs.MX(cs.sparsify(cs.DM(J))) @ x.symbol - 1, 1.0)
    limits = []
    if held is not None and len(held):
        limits = [Constraint("held", cs.MX(cs.sparsify(cs.DM(held))) @ x.symbol, 0.0, 0.0)]
    found = diagnose(
        Problem([seen], ("x",), blocks=(x,), constraints=limits), {"x": np.zeros(J.shape[1])}
    )
    assert isinstance(found, Diagnosis)
    return found


def without_singular_values(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on nothing that is as large as n x n may be computed of a linearization."""

    def refused(_: Linearization) -> None:
        raise AssertionError("an array of n x n was computed")

    for name in ("spectrum", "singular_values", "unit_triangle", "R"):
        monkeypatch.setattr(Linearization, name, property(refused))


@pytest.mark.parametrize(
    ("lost", "ties", "kind"),
    few(
        [
            pytest.param(*case, id="-".join(map(str, case)))
            for case in (
                (0, 20, "across"),
                (0, 0, "free"),
                (1, 20, "free"),
                (1, 1, "within"),
            )
        ],
        2,
    ),
)
def test_eliminated_parts_give_what_singular_values_give(
    lost: int, ties: int, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    J, A = jacobian(lost, ties), constraints(kind)
    dense = diagnosed(J, A)
    unit = J / np.linalg.norm(J, axis=0)
    weak_count, condition, rank = dense.weak_count, dense.condition, dense.rank
    weakest, sigma = dense.weakest[0].singular_value, dense.identifiability.sigma
    verdicts, correlations = dense.identifiability.verdicts, dense.identifiability.correlations
    if kind == "free":
        assert dense.rank == min(N, PARTS * (OWN - lost) + SHARED + ties)
    always_sparse(monkeypatch)
    without_singular_values(monkeypatch)
    sparse = diagnosed(J, A)
    assert (sparse.weak_count, sparse.rank) == (weak_count, rank)
    assert sparse.condition == pytest.approx(condition, rel=1e-5)
    np.testing.assert_allclose(sparse.identifiability.sigma, sigma, rtol=1e-6, atol=1e-7)
    assert sparse.identifiability.verdicts == verdicts
    assert [c[:2] for c in sparse.identifiability.correlations] == [c[:2] for c in correlations]
    vectors = np.array([d.vector for d in sparse.null_directions]).reshape(-1, N).T
    lengths = np.linalg.norm(J, axis=0)[:, None]
    assert abs(unit @ (vectors * lengths)).max(initial=0) < 1e-9 * lengths.max()
    assert abs(A @ vectors).max(initial=0) < 1e-9
    changes = [direction.change for direction in sparse.weak_directions]
    assert len(changes) == min(sparse.weak_count, LISTED)
    assert changes == sorted(changes)
    assert not changes or changes[0] == pytest.approx(weakest, rel=1e-4)
    assert "without singular values" in sparse.report()


def test_more_unknowns_than_arrays_hold_need_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    always_sparse(monkeypatch)
    monkeypatch.setattr(storage, "WIDE", 100)
    without_singular_values(monkeypatch)
    found = diagnosed(jacobian(0, 20))
    assert found.rank == N
    assert f"numerical rank {N} of {N}" in found.report()
    full = np.random.default_rng(0).standard_normal((250, 200))  # no parts
    with pytest.raises(TooLarge, match="singular values of a sparse Jacobian of 250 x 200"):
        diagnosed(full)
    full[3, 5] = np.nan
    assert "not finite" in str(diagnosed(full))


def test_sparse_values_that_are_not_finite_have_no_rank(monkeypatch: pytest.MonkeyPatch) -> None:
    always_sparse(monkeypatch)
    J = jacobian(0, 20)
    J[7, 3] = np.inf
    found = diagnosed(J)
    assert "RANK" not in found.report()
    with pytest.raises(NotFinite, match="not_finite"):
        found.rank  # noqa: B018


@pytest.mark.thorough
def test_a_whole_mesh_is_diagnosed() -> None:
    body = load_body("full")
    observed = Block("observed", (body.n_vertices, 3), "m")
    points = body.points(*(block.symbol for block in body.blocks()))
    seen = residuals.vertices(points, observed.symbol, sigma=0.002)
    problem = Problem((seen,), ("pose", "betas", "trans"))
    pose = np.random.default_rng(0).normal(scale=0.3, size=(24, 3))
    found = diagnose(problem, body.start() | {"pose": pose, "observed": np.zeros(observed.shape)})
    assert found.shape == (36_816, 85)
    found.assert_rank(85)
    found.assert_no_warnings()
    assert found.derivatives.passed
