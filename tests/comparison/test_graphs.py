"""Solvers that ask the graphs and batches of a problem: they are counted, timed and followed."""

from collections.abc import Callable
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from tests.comparison import askers
from tests.comparison.problems import LINE, line
from workbench import Block, Constraint, GaussNewton, Problem, Residual
from workbench.comparison import Budget, Comparison, TargetOutcome, compare
from workbench.comparison.log import KINDS, Log, Observed
from workbench.comparison.metered import Metered
from workbench.comparison.words import advice
from workbench.solvers.limits import Stop

X, NOTHING = np.full(3, 5.0), np.zeros(0)
COUNTED: dict[str, Callable[[Problem, askers.Array, askers.Array], askers.Ways]] = {
    "by derivative": askers.by_derivative,
    "by names": askers.by_names,
    "by adjoint": askers.by_adjoint,
    "by batches": askers.by_batches,
}


def watched(tmp_path: Path, most: int = 1000) -> tuple[Problem, Callable[[], Observed]]:
    log = tmp_path / "log"
    watch = Metered(line().problem, NOTHING, most, 10.0, Log(log, 3))
    return watch.metered(), lambda: Log.read(log)


def counts(seen: Observed) -> dict[str, int]:
    return {kind: n for kind, n in zip(KINDS, seen.counts, strict=True) if n}


@pytest.fixture(scope="module")
def found() -> Comparison:
    solvers = {name: askers.Asker(ask) for name, ask in COUNTED.items()} | {
        "embedded": askers.Embedded(),
        "own graph": askers.OwnGraph(),
        "house": GaussNewton(),
    }
    return compare(LINE, solvers, budget=Budget(max_seconds=20.0))


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("by derivative", {"residual", "jacobian"}),
        ("by names", {"residual", "jacobian"}),
        ("by adjoint", {"gradient", "hessian"}),
        ("by batches", {"residual", "gradient"}),
    ],
)
def test_what_is_asked_of_graphs_and_batches_is_counted_timed_and_followed(
    found: Comparison, name: str, kinds: set[str]
) -> None:
    """They were counted as 0 evaluations, and as 0 % success."""
    record = found.records[found.instances[0].name, name]
    assert counts(record.observed).keys() == kinds
    assert all(
        s > 0 for s, n in zip(record.observed.spent, record.observed.counts, strict=True) if n
    )
    assert len(record.observed.trace) > 1
    assert record.lowest == pytest.approx(record.cost, rel=1e-9)  # whole way, to rounding
    assert found.success(name, 1e-3).value == 1
    assert np.isfinite(found.effort(name, 1e-3).value)
    assert not found.uncounted(found.instances[0].name, name)


@pytest.mark.parametrize("name", ["embedded", "own graph"])
def test_what_cannot_be_counted_is_said_and_neither_nothing_nor_a_failure(
    found: Comparison, name: str
) -> None:
    assert found.outcomes[found.instances[0].name, name] is TargetOutcome.REACHED
    assert found.success(name, 1e-7).value == 1
    assert found.uncounted(found.instances[0].name, name)
    assert np.isnan(found.effort(name, 1e-5).value)
    assert any(said.startswith(f"{name}: not everything was counted") for said in advice(found))


def test_every_column_is_a_point(tmp_path: Path) -> None:
    problem, seen = watched(tmp_path)
    points = np.column_stack([X, X - 1, X - 2, X + 1])
    r = np.asarray(problem.function(points, np.zeros((0, 4))))
    assert r.shape == (8, 4)
    np.testing.assert_allclose(r[:, 2], line().problem.residual(X - 2, NOTHING), rtol=1e-12)
    assert counts(seen()) == {"residual": 4}
    np.testing.assert_array_equal(seen().trace[:, 0], [1, 2, 3])  # the fourth is no better
    np.testing.assert_array_equal(seen().best, X - 2)
    problem.costs(X, NOTHING, np.array([1]))(np.array([[0.0], [5.0]]))
    assert counts(seen()) == {"residual": 6}
    x = np.array([5.0, 0.0, 5.0])
    lowest = min((x, X, X - 2), key=lambda at: np.sum(line().problem.residual(at, NOTHING) ** 2))
    np.testing.assert_array_equal(seen().best, lowest)


def test_lists_and_named_arguments_are_points_too(tmp_path: Path) -> None:
    problem, seen = watched(tmp_path)
    problem.adjoint([4.0, 4.0, 4.0], [])
    np.testing.assert_array_equal(seen().best, np.full(3, 4.0))
    problem.derivative(x=cs.DM([3.0, 3.0, 3.0]))
    np.testing.assert_array_equal(seen().best, np.full(3, 3.0))
    problem.function.call([2.0, NOTHING])  # one number stands for all
    np.testing.assert_array_equal(seen().best, np.full(3, 2.0))
    assert counts(seen()) == {"residual": 1, "gradient": 1, "jacobian": 1}
    assert not seen().taken


def test_looking_at_a_graph_is_free_and_taking_it_along_is_noticed(tmp_path: Path) -> None:
    problem, seen = watched(tmp_path)
    assert isinstance(problem.function, cs.Function)
    assert problem.function.n_in() == 2
    assert problem.derivative.sparsity_out(1).shape == (8, 3)
    assert "residual" in repr(problem.function)
    assert not seen().taken
    problem.function.buffer()
    assert seen().taken
    assert counts(seen()) == {}


@pytest.mark.parametrize(
    "take",
    [
        lambda f: f(cs.MX.sym("x", 3), NOTHING),
        lambda f: f(cs.SX.sym("x", 3), NOTHING),
        lambda f: f(x=cs.MX.sym("x", 3)),
        lambda f: f.jacobian(),
        lambda f: f.map("many", "serial", 2, [1], []),
        lambda f: cs.Function("whole", [a := cs.MX.sym("a", 3)], [f(a, NOTHING)]),
        lambda f: f.this,  # this is how C++ gets hold of it
    ],
)
def test_ways_of_taking_a_graph_along(
    take: Callable[[cs.Function], object], tmp_path: Path
) -> None:
    problem, seen = watched(tmp_path)
    take(problem.function)
    assert seen().taken


def test_graphs_and_batches_keep_to_the_limits(tmp_path: Path) -> None:
    problem, seen = watched(tmp_path, most=4)
    for a in (4.0, 3.0, 2.0, 1.0, 0.5, 0.4, 0.3):
        problem.function(np.full(3, a), NOTHING)
    for ask in (
        lambda: problem.function(X, NOTHING),
        lambda: problem.adjoint(X, NOTHING),
        lambda: problem.hessian(X, NOTHING),
        lambda: problem.costs(X, NOTHING)(X[None]),
        lambda: problem.slopes(X, NOTHING)(X[None]),
    ):
        with pytest.raises(Stop):
            ask()
    assert counts(seen()) == {"residual": 7}
    assert seen().trace[-1, 0] <= 4
    batch, second = watched(tmp_path, most=4)
    z = np.linspace(4, 0, 10)[:, None] * np.ones(3)
    batch.costs(X, NOTHING)(z)  # of ten points at once only four count
    assert second().trace[-1, 0] <= 4
    assert counts(second()) == {"residual": 10}


def test_with_other_numbers_fixed_a_cost_is_another_one(tmp_path: Path) -> None:
    x, h = Block("x", (2,)), Block("h", (1,))
    problem = Problem((Residual("r", x.symbol - h.symbol, 1.0),), ("x",), blocks=(x, h))
    watch = Metered(problem, np.ones(1), 99, 9.0, Log(tmp_path / "log", 2))
    watch.metered().residual(np.full(2, 3.0), np.full(1, 3.0))
    watch.metered().function(np.full(2, 3.0), np.full(1, 3.0))
    assert not len(Log.read(tmp_path / "log").trace)
    watch.metered().function(np.full(2, 3.0), np.ones(1))
    assert Log.read(tmp_path / "log").trace[-1, -1] == pytest.approx(4.0)


def test_graphs_of_a_part_are_completed_and_those_of_other_costs_make_no_progress(
    tmp_path: Path,
) -> None:
    x, y = Block("x", (1,)), Block("y", (1,))
    both = Residual("both", x.symbol + y.symbol - 3, 1.0), Residual("y", y.symbol, 1.0)
    problem = Problem(both, ("x", "y"), blocks=(x, y))
    watch = Metered(problem, NOTHING, 99, 9.0, Log(tmp_path / "log", 2))
    part = watch.metered().freeing("x")
    part.adjoint(np.ones(1), np.ones(1))  # x = 1 is free, y = 1 fixed
    seen = Log.read(tmp_path / "log")
    np.testing.assert_array_equal(seen.best, [1.0, 1.0])
    assert seen.trace[-1, -1] == pytest.approx(0.5 * (1 + 1))
    watch.metered().without("y").function(np.array([1.5, 1.5]), NOTHING)
    seen = Log.read(tmp_path / "log")
    assert counts(seen) == {"residual": 1, "gradient": 1}
    assert len(seen.trace) == 1


def test_constraints_are_counted_by_kind(tmp_path: Path) -> None:
    x = Block("x", (2,)).symbol
    circle = Constraint("circle", cs.sumsqr(x), 1.0, 1.0)
    problem = Problem((Residual("r", x, 1.0),), ("x",), constraints=(circle,))
    watch = Metered(problem, NOTHING, 99, 9.0, Log(tmp_path / "log", 2))
    asked, at = watch.metered(), np.array([0.6, 0.8])
    there = asked.stacked_constraints
    assert there is not None
    there.values(at, NOTHING)
    there.linearize(at, NOTHING)
    there.hessian(at, NOTHING, np.ones(1))
    asked.linearize_at(at, NOTHING)
    asked.residual(at, NOTHING)
    seen = Log.read(tmp_path / "log")
    assert counts(seen) == {
        "residual": 1,
        "jacobian": 1,
        "constraint": 1,
        "constraint_jacobian": 2,
        "constraint_hessian": 1,
    }
    assert seen.evaluations.constraint == 4
