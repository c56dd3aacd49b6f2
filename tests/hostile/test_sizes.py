"""Problems whose dense Jacobian does not fit: what is said, and what is solved all the same."""

import re
import tracemalloc

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.tiers import few
from workbench.errors import TooLarge
from workbench.problem import storage
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


def test_dense_jacobians_that_do_not_fit_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "free_memory", lambda: 1000)
    monkeypatch.setattr(storage, "ALWAYS_FITS", 0)
    start = {"x": np.full(10, -1.2)}
    with pytest.raises(TooLarge, match=SENTENCE):
        chain(10).linearize(start)
    for solver in (wb.LevenbergMarquardt(), wb.Scipy("trf"), wb.Ipopt()):
        found = wb.solve(chain(10), start, solver)
        assert found.status is Status.TOO_LARGE
        assert re.match(SENTENCE, found.message)


@pytest.mark.parametrize("error", [MemoryError, TooLarge])
def test_memory_errors_are_a_status(error: type, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_room(*_: object) -> None:
        raise error("Unable to allocate 763 MiB")

    for solver in (wb.LevenbergMarquardt(linear_algebra=no_room), wb.Newton(convexify=no_room)):
        found = wb.solve(chain(30), {"x": np.full(30, 3.0)}, solver)
        assert found.status is Status.TOO_LARGE
        assert "Unable to allocate" in found.message
        assert np.isfinite(found.cost)
    monkeypatch.setattr(wb.Problem, "linearize_at", no_room)
    found = wb.solve(chain(30), {"x": np.ones(30)})
    assert found.status is Status.TOO_LARGE
    sentence = "memory ran out: Unable to allocate 763 MiB; free fewer blocks"
    assert error is TooLarge or found.message.startswith(sentence)


SOLVERS = [
    wb.LevenbergMarquardt(),
    wb.GaussNewton(),
    wb.Dogleg(),
    wb.Ipopt(),
    wb.Scipy("trf"),
    wb.Nlopt("LD_LBFGS", max_seconds=100.0),
]


@pytest.mark.parametrize(
    "solver", few([pytest.param(one, id=type(one).__name__) for one in SOLVERS], 1)
)
def test_ten_thousand_unknowns_need_no_dense_matrix(solver: Solver) -> None:
    """A dense Jacobian would take 1.6 GB; nothing here takes a tenth of it."""
    problem = chain(10_000)
    tracemalloc.start()
    try:
        found = wb.solve(problem, {"x": np.zeros(10_000)}, solver)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.status is Status.CONVERGED, found.message
    assert peak < 160e6
