"""Large sparse Jacobians take another way, to the same answers as far as it goes."""

import casadi as cs
import numpy as np
import pytest
import scipy.linalg
from scipy.sparse import csc_array, identity, random_array

from workbench import Block, Constraint, Diagnosis, Problem, Values, diagnose, load_body, residuals
from workbench.arrays import Array
from workbench.diagnostics import null_space, sparse_jacobian
from workbench.diagnostics.active_set import ConstrainedJacobian
from workbench.diagnostics.null_space import MOST_WEAK
from workbench.errors import TooLarge
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
    assert dense.active.names == sparse.active.names
    assert dense.active.names == (("apart", "squares[0]") if active else ())
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


# One factorization against the singular values of the whole matrix.

PARTS, OWN, SHARED, LINES = 30, 6, 5, 12  # parts, unknowns of each, shared ones, rows of each part
N = PARTS * OWN + SHARED


def arrow(lost: int = 0, ties: int = 0) -> Array:
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


def pose_graph(poses: int) -> tuple[Problem, Values]:
    """Places and headings in a plane, of which neighbours and some others see each other."""
    rng = np.random.default_rng(0)
    place, heading = Block("place", (poses, 2), "m"), Block("heading", (poses,), "rad")
    i = np.append(np.arange(poses - 1), rng.integers(0, poses // 2, poses // 2)).tolist()
    j = np.append(np.arange(1, poses), rng.integers(poses // 2, poses, poses // 2)).tolist()
    x, turn = place.symbol, heading.symbol
    away, c, s = x[:, j] - x[:, i], cs.cos(turn[i]).T, cs.sin(turn[i]).T
    seen = cs.vertcat(c * away[0, :] + s * away[1, :], c * away[1, :] - s * away[0, :])
    terms = Residual("seen", cs.vec(seen), 0.1, "m"), Residual("turned", turn[j] - turn[i], 0.05)
    values = {"place": 10 * rng.normal(size=(poses, 2)), "heading": rng.normal(size=poses)}
    return Problem(terms, ("place", "heading"), blocks=(place, heading)), values


def graded() -> Array:
    """Twenty blocks of 14 x 10 whose singular values reach from 1 to 1e-9 without a gap."""
    rng = np.random.default_rng(1)
    left, right = (
        [np.linalg.qr(rng.standard_normal((k, 10)))[0] for _ in range(20)] for k in (14, 10)
    )
    s = rng.permutation(np.logspace(0, -9, 200)).reshape(20, 10)
    blocks = [U * some @ V for U, some, V in zip(left, s, right, strict=True)]
    return np.asarray(scipy.linalg.block_diag(*blocks))


def pieces(ties: int) -> Array:
    """Differences of neighbours in 200 pieces of three, and a few full rows."""
    steps = np.diff(np.eye(3), axis=0)
    full = np.random.default_rng(2).standard_normal((ties, 600))
    return np.vstack([scipy.linalg.block_diag(*[steps] * 200), full])


def held(across: int) -> Array:
    """Constraints within single parts, on single unknowns, and across parts as well."""
    A = np.zeros((4, N))
    A[0, :4], A[1, 6:9], A[2, 10], A[3, N - 1] = 1, 2, 1, 3
    return np.vstack([A, np.random.default_rng(5).standard_normal((across, N))])


def made(name: str) -> tuple[Array, Array]:
    """A Jacobian and the rows of its constraints."""
    none = np.zeros((0, N))
    if name == "pose graph":
        problem, values = pose_graph(80)
        return problem.linearize(values).dense, none
    sparse = random_array((100, 500), density=0.02, rng=np.random.default_rng(3)).toarray()
    units = 10.0 ** np.random.default_rng(4).uniform(-6, 6, N)
    every = {
        "arrow": (arrow(), none),
        "arrow without some directions": (arrow(1), none),
        "full rows": (arrow(1, 20), none),
        "constraints": (arrow(), held(2)),
        "constraints and full rows": (arrow(1, 20), held(2)),
        "any units": (arrow(1, 20) * units, none),
        "no gap": (graded(), none),
        "200 null directions": (pieces(0), none),
        "195 null directions": (pieces(5), none),
        "few rows": (sparse, none),
    }
    return every[name]


@pytest.mark.parametrize(
    ("name", "apart"),
    [
        ("arrow without some directions", False),
        ("pose graph", False),
        ("full rows", True),
        ("constraints", False),
        ("constraints and full rows", True),
        ("any units", False),
        ("no gap", False),
        ("200 null directions", False),
        ("195 null directions", True),
    ],
)
def test_factorization_gives_what_singular_values_give(
    name: str, apart: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if apart:  # full rows of this size are kept apart
        monkeypatch.setattr(sparse_jacobian, "LONG_ROW", 100)
    J, A = made(name)
    n = J.shape[1]
    here = Linearization(np.zeros(len(J)), csc_array(J))
    constrained = ConstrainedJacobian(here, A if len(A) else np.zeros((0, n)))
    found = constrained.sparse
    assert found is not None
    S = found.factored.S.toarray()
    _, s, Vt = np.linalg.svd(S, full_matrices=True)
    rank = int(np.sum(s > found.factored.tolerance))
    assert (found.rank, constrained.rank) == (rank, rank)
    null = found.factored.null
    assert null.shape == (n, n - rank)
    np.testing.assert_allclose(null.T @ null, np.eye(n - rank), atol=1e-12)
    assert np.linalg.norm(S @ null, axis=0).max(initial=0.0) < 1e-13
    pseudo = (Vt[:rank].T / s[:rank] ** 2) @ Vt[:rank]
    P = found.factored.covariance_times(np.eye(n))
    assert np.linalg.norm(P - pseudo) < 1e-6 * np.linalg.norm(pseudo)
    # along what may move, in the unknowns' own units
    Z = constrained.tangent
    own = np.linalg.svd(J @ Z, compute_uv=False)
    seen = own[: rank - constrained.count][::-1]
    if name != "any units":  # in which the smallest are rounding errors of the largest
        np.testing.assert_allclose(found.weakest(3)[0], seen[:3], rtol=1e-6)
        limits = [limit for limit in (0.01, 0.1, 0.5, 1.5) if abs(seen / limit - 1).min() > 1e-3]
        assert [found.count_below(x) for x in limits] == [int(np.sum(seen < x)) for x in limits]
    half = np.linalg.norm(found.lengths[:, None] * Z, axis=1)
    assert np.isinf(found.variances[half > 0]).sum() == np.sum(np.sum(null**2, axis=1) > 1e-9)


def diagnosed(J: Array, A: Array | None = None) -> Diagnosis:
    """Of J x - 1, where A x is zero, at zero."""
    x = Block("x", (J.shape[1],), "m")
    seen = Residual("rows", cs.MX(cs.sparsify(cs.DM(J))) @ x.symbol - 1, 1.0)
    limits = []
    if A is not None and len(A):
        limits = [Constraint("held", cs.MX(cs.sparsify(cs.DM(A))) @ x.symbol, 0.0, 0.0)]
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
    "name", ["constraints", pytest.param("full rows", marks=pytest.mark.thorough)]
)
def test_diagnosis_by_factorization_is_the_dense_one(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    J, A = made(name)
    dense = diagnosed(J, A)
    weak_count, condition, rank = dense.weak_count, dense.condition, dense.rank
    weakest, sigma = dense.weakest[0].change, dense.identifiability.sigma
    verdicts = dense.identifiability.verdicts
    always_sparse(monkeypatch)
    without_singular_values(monkeypatch)
    sparse = diagnosed(J, A)
    assert (sparse.weak_count, sparse.rank) == (weak_count, rank)
    assert sparse.condition == pytest.approx(condition, rel=1e-5)
    np.testing.assert_allclose(sparse.identifiability.sigma, sigma, rtol=1e-6, atol=1e-7)
    assert sparse.identifiability.verdicts == verdicts
    vectors = np.array([d.vector for d in sparse.null_directions]).reshape(-1, N).T
    assert vectors.shape == (N, N - rank)
    assert abs(J @ vectors).max(initial=0) < 1e-9 * np.linalg.norm(J, axis=0).max()
    assert abs(A @ vectors).max(initial=0) < 1e-9
    changes = [direction.change for direction in sparse.weak_directions]
    assert len(changes) == min(sparse.weak_count, MOST_WEAK)
    assert changes == sorted(changes)
    assert not changes or changes[0] == pytest.approx(weakest, rel=1e-4)


def test_size_of_a_factor_is_known_before_it_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    J = random_array((400, 300), density=0.01, rng=np.random.default_rng(0))
    K = csc_array(J.T @ J + identity(300))
    pattern = cs.Sparsity(300, 300, K.indptr.tolist(), K.indices.tolist())
    assert sparse_jacobian.factor_size(K) == pattern.ldl()[0].nnz() + 300  # and its diagonal
    always_sparse(monkeypatch)
    monkeypatch.setattr(sparse_jacobian, "MOST_NONZEROS", 100)
    with pytest.raises(TooLarge, match=r"185 unknowns would .* 100 entries: free fewer blocks"):
        diagnosed(arrow())


def test_too_many_weak_directions_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    always_sparse(monkeypatch)
    monkeypatch.setattr(sparse_jacobian, "MOST_WEAK_NUMBERS", 10_000)
    with pytest.raises(TooLarge, match=r"200 of 600 directions .*: fix some of the unknowns"):
        diagnosed(pieces(0))


@pytest.mark.parametrize("name", ["few rows", "200 null directions"])
def test_null_directions_too_many_for_names_are_said_by_entries(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    always_sparse(monkeypatch)
    monkeypatch.setattr(null_space, "MOST_NAMED", 100)
    J, _ = made(name)
    found = diagnosed(J)
    vectors = np.column_stack([d.vector for d in found.null_directions])
    assert np.linalg.matrix_rank(vectors) == J.shape[1] - found.rank == vectors.shape[1]
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=0), 1.0, rtol=1e-12)
    assert abs(J @ vectors).max() < 1e-12
    if name == "few rows":
        unread = np.flatnonzero(~J.any(axis=0))
        said = [d.name for d in found.null_directions if d.kind == "entry"]
        assert {f"x[{i}]" for i in unread} <= set(said)
    else:
        terms = {d.terms for d in found.null_directions}
        assert "+1 m of x[1] with +1 m of x[0], +1 m of x[2]" in terms


@pytest.mark.thorough
def test_a_pose_graph_of_6000_unknowns_is_diagnosed() -> None:
    found = diagnose(*pose_graph(2000))
    assert isinstance(found, Diagnosis)
    assert found.shape == (8997, 6000)
    assert [d.kind for d in found.null_directions] == ["translation", "translation", "rotation"]
    assert max(d.change for d in found.null_directions) < 1e-10
    assert np.isinf(found.identifiability.sigma).all()


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
