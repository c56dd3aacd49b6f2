"""Problems whose dense Jacobian does not fit: what is said, and what is solved all the same."""

import re
import subprocess
import sys
import tracemalloc

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array

import workbench as wb
from workbench.errors import TooLarge
from workbench.problem import storage
from workbench.problem.storage import check_fits, free_memory
from workbench.solvers import Solver, Status

SENTENCE = (
    r"a dense Jacobian of 18 x 10 takes 1\.44e-06 GB, and a step with it as much again; 1e-06 GB "
    r"of memory are free; free fewer blocks at a time, or divide the problem"
)


def chain(n: int) -> wb.Problem:
    """A sparse problem: every residual reads two neighbours at most."""
    x = cs.MX.sym("x", n)
    return wb.Problem(
        [wb.Residual("r", cs.vertcat(x[1:] - 0.5 * x[:-1] ** 2, x[:-1] - 1), 1.0)], ["x"]
    )


def bodies() -> tuple[wb.Problem, dict[str, np.ndarray]]:
    """Two bodies whose shape is one, seen by joints and by vertices, with priors."""
    body = wb.load_body("small")
    residuals, values = [], {"betas": np.linspace(-1, 1, body.n_betas)}
    betas = next(block for block in body.blocks() if block.name == "betas").symbol
    rng = np.random.default_rng(0)
    for k in range(2):
        pose, trans = wb.Block(f"pose{k}", (24, 3), "rad"), wb.Block(f"trans{k}", (3,), "m")
        joints = body.joint_points(pose.symbol, betas, trans.symbol)
        residuals.append(wb.residuals.landmarks(joints, np.zeros((24, 3)), sigma=0.1, name=f"j{k}"))
        residuals.append(
            wb.residuals.gaussian(pose.symbol, covariance=0.1, unit="rad", name=f"p{k}")
        )
        values |= {f"pose{k}": 0.3 * rng.standard_normal((24, 3)), f"trans{k}": np.ones(3)}
    skin = body.points(pose.symbol, betas, trans.symbol)
    target = np.zeros((body.n_vertices, 3))
    residuals.append(wb.residuals.vertices(skin, target, sigma=0.1))
    free = ["pose0", "trans0", "pose1", "betas", "trans1"]
    return wb.Problem(residuals, free), values


def always_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on the Jacobian of a new problem is sparse, however small it is."""
    monkeypatch.setattr(storage, "DENSE_FROM", 0)
    monkeypatch.setattr(storage, "SPARSE_UP_TO", 2.0)


def test_a_sparse_jacobian_says_what_the_dense_one_says(monkeypatch: pytest.MonkeyPatch) -> None:
    x = {"x": np.linspace(0.5, 2, 30)}
    both = [(chain(30), x), bodies()]
    dense_ones = [problem.linearize(values) for problem, values in both]
    always_sparse(monkeypatch)
    for dense, (problem, values) in zip(dense_ones, [(chain(30), x), bodies()], strict=True):
        point = problem.split(values)
        sparse = problem.linearize_at(*point)
        assert isinstance(sparse.jacobian, csc_array)
        assert sparse.jacobian.nnz < dense.dense.size
        np.testing.assert_allclose(sparse.jacobian.toarray(), dense.jacobian, rtol=0, atol=1e-11)
        np.testing.assert_allclose(sparse.residual, dense.residual, rtol=0, atol=1e-12)
        np.testing.assert_allclose(sparse.gradient, dense.gradient, rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(sparse.column_norms, dense.column_norms, rtol=1e-11)
        assert sparse.finite
        assert problem.optimality(point[0], sparse) == pytest.approx(
            problem.optimality(point[0], dense), rel=1e-9
        )
        for i in (0, dense.shape[1] - 1):
            changed = (one.column(i) != 0 for one in (sparse, dense))
            assert np.equal(*changed).mean() > 0.99  # products may be zero
        sparse.jacobian.data[3] = np.nan
        assert not wb.Linearization(sparse.residual, sparse.jacobian).finite


def test_what_is_small_stays_dense() -> None:
    here = chain(30).linearize({"x": np.ones(30)})
    assert isinstance(here.jacobian, np.ndarray)


def test_it_says_what_was_asked_for_and_what_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "free_memory", lambda: 1000)
    monkeypatch.setattr(storage, "SMALL", 0)
    start = {"x": np.full(10, -1.2)}
    with pytest.raises(TooLarge, match=SENTENCE):
        chain(10).linearize(start)
    for solver in (wb.LevenbergMarquardt(), wb.SteepestDescent(), wb.Scipy("trf"), wb.Ipopt()):
        found = wb.solve(chain(10), start, solver)
        assert found.status is Status.TOO_LARGE
        assert re.match(SENTENCE, found.message)


def test_memory_that_the_system_has_not_is_said_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    def asked(*_: object) -> None:
        raise MemoryError("Unable to allocate 763 MiB")

    monkeypatch.setattr(wb.Problem, "linearize_at", asked)
    found = wb.solve(chain(30), {"x": np.ones(30)})
    assert found.status is Status.TOO_LARGE
    assert found.message.startswith("memory ran out: Unable to allocate 763 MiB; free fewer blocks")


def test_memory_that_the_linear_algebra_has_not_is_said_as_well() -> None:
    def no_room(*_: object) -> None:
        raise MemoryError("Unable to allocate 763 MiB")

    solver = wb.LevenbergMarquardt(linear_algebra=no_room)
    found = wb.solve(chain(30), {"x": np.full(30, 3.0)}, solver)
    assert found.status is Status.TOO_LARGE
    assert found.message.startswith("memory ran out in the linear algebra: Unable to allocate")
    assert np.isfinite(found.cost)


def test_free_memory_is_asked_for_only_where_it_matters(monkeypatch: pytest.MonkeyPatch) -> None:
    def never() -> int:
        raise AssertionError

    monkeypatch.setattr(storage, "free_memory", never)
    check_fits(1000, 1000)
    monkeypatch.setattr(storage, "free_memory", lambda: None)  # no Linux
    check_fits(10**6, 10**6)


@pytest.mark.skipif(sys.platform != "linux", reason="others do not say")
def test_free_memory_is_what_the_limit_leaves() -> None:
    free = free_memory()
    assert free is not None
    assert free > 2**20
    code = (
        "import resource\n"
        "from workbench.problem.storage import free_memory\n"
        "before = free_memory()\n"
        "from pathlib import Path\n"
        "taken = 4096 * int(Path('/proc/self/statm').read_text().split()[0])\n"
        "resource.setrlimit(resource.RLIMIT_AS, (taken + 2**26,) * 2)\n"
        "print(free_memory())\n"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 0 <= int(said.stdout) <= 2**26


SOLVERS = [
    wb.GaussNewton(),
    wb.LevenbergMarquardt(),
    wb.Dogleg(),
    wb.Ipopt(),
    wb.Scipy("trf"),
    wb.Nlopt("LD_LBFGS", max_seconds=100.0),
]


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
def test_ten_thousand_unknowns_are_solved_without_a_dense_matrix(solver: Solver) -> None:
    """A dense Jacobian would take 1.6 GB; nothing here takes a tenth of it."""
    n = 10_000
    problem = chain(n)
    tracemalloc.start()
    try:
        found = wb.solve(problem, {"x": np.zeros(n)}, solver)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.status is Status.CONVERGED, found.message
    assert peak < 160e6


@pytest.mark.parametrize(
    "solver",
    [wb.Ipopt(), wb.Sqp(), wb.Scipy("lm"), wb.Scipy("dogbox"), wb.SteepestDescent()],
    ids=lambda solver: f"{type(solver).__name__} {getattr(solver, 'method', '')}".strip(),
)
def test_other_solvers_take_a_sparse_jacobian_to_the_dense_answer(
    solver: Solver, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = {"x": np.zeros(30)}
    expected = wb.solve(chain(30), start, wb.LevenbergMarquardt())
    always_sparse(monkeypatch)
    problem = chain(30)
    assert problem.sparse
    found = wb.solve(problem, start, solver)
    assert found.status is Status.CONVERGED, found.message
    np.testing.assert_allclose(found.values["x"], expected.values["x"], atol=1e-4)


def test_rotations_of_a_large_problem_are_shortened_without_a_dense_matrix(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The end of a run turns rotation vectors back, and looks at the gradient there."""
    always_sparse(monkeypatch)
    problem, values = bodies()
    values["pose0"][3] = (0.0, 7.0, 0.0)  # more than a turn

    def never(*_: object) -> None:
        raise TooLarge("a dense Jacobian")

    monkeypatch.setattr(storage, "check_fits", never)
    found = wb.solve(problem, values, wb.Nlopt("LD_LBFGS", max_iterations=3))
    assert "dense" not in found.message
    assert np.isfinite(found.optimality)
