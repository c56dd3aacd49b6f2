"""IPOPT is made once for a problem, and one run after the other is served by it."""

import gc
import weakref
from dataclasses import dataclass
from typing import Any

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.solvers.problems import T, decay
from workbench import Block, Constraint, Ipopt, Problem, Residual, Solution, Status, Values
from workbench.problem import Linearization
from workbench.solvers import Run, exact_hessian, made

OTHER = {"y": 2.5 * np.exp(-0.8 * T) + 0.1, "x": np.array([0.5, 1.0, 0.2])}


@pytest.fixture
def count(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Grows by one for each solver that CasADi makes."""
    found: list[str] = []
    make = cs.nlpsol

    def counted(*given: Any) -> cs.Function:
        found.append(given[0])
        return make(*given)

    monkeypatch.setattr(cs, "nlpsol", counted)
    return found


def limited() -> tuple[Problem, Values]:
    """The decay, and its first two numbers are at most 3 together."""
    x, y = Block("x", (3,)).symbol, Block("y", (15,)).symbol
    fit = Residual("decay", x[0] * cs.exp(-x[1] * T) + x[2] - y, sigma=0.05)
    at_most = Constraint("at most", x[0] + x[1] ** 2, upper=3.0)
    return Problem((fit,), ("x",), {"x": (-5.0, 5.0)}, constraints=(at_most,)), decay()[1]


def numbers(found: Solution) -> list[Any]:
    """All that a run leaves but its time."""
    trace = [(i.values["x"].tolist(), i.cost, i.optimality, i.damping) for i in found.trace]
    return [trace, found.status, found.message, found.evaluations, found.judging]


@pytest.mark.parametrize("hessian", [Ipopt().hessian, exact_hessian, None])
@pytest.mark.parametrize("posed", [decay, limited])
def test_the_same_run_as_by_a_solver_of_its_own(posed: Any, hessian: Any, count: list[str]) -> None:
    solver, (problem, start) = Ipopt(hessian), posed()
    starts = (start, start | OTHER, start)
    together = [numbers(solver.solve(problem, one)) for one in starts]
    assert len(count) == 1
    assert together == [numbers(solver.solve(posed()[0], one)) for one in starts]
    assert len(count) == 4


def test_other_options_take_another_solver(count: list[str]) -> None:
    problem, start = decay()
    assert Ipopt().solve(problem, start).iterations > 2
    assert Ipopt(max_iterations=2).solve(problem, start).status is Status.MAX_ITERATIONS
    assert len(count) == 2


@dataclass(frozen=True)
class Scaled:
    """A user's Hessian that holds an array, so that two of them cannot be compared as a whole."""

    by: np.ndarray

    def __call__(self, run: Run, x: np.ndarray, here: Linearization) -> np.ndarray:
        return np.asarray(here.normal) * self.by


def test_hessians_of_a_user_share_a_solver_and_are_not_kept(count: list[str]) -> None:
    problem, start = decay()
    one, other = Scaled(np.array([1.0, 1.0, 1.0])), Scaled(np.array([2.0, 2.0, 2.0]))
    found = [numbers(Ipopt(each).solve(problem, start)) for each in (one, other)]
    assert len(count) == 1
    assert found[1] == numbers(Ipopt(other).solve(decay()[0], start)) != found[0]
    kept = weakref.ref(other)
    del other
    gc.collect()
    assert kept() is None


def test_a_run_within_a_run_has_its_own(count: list[str]) -> None:
    (problem, start), inner = decay(), []
    expected = numbers(Ipopt().solve(decay()[0], start)), numbers(Ipopt().solve(problem, OTHER))

    def within(_: object) -> None:
        if not inner:
            inner.append(numbers(Ipopt().solve(problem, OTHER)))

    assert numbers(Ipopt().solve(problem, start, callback=within)) == expected[0]
    assert inner == [expected[1]]
    assert len(count) == 3


def test_a_residual_that_raised_leaves_a_solver_for_the_next_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, start = decay()
    expected = numbers(Ipopt().solve(problem, start))
    asked = iter(range(100))

    def failing(x: np.ndarray, fixed: np.ndarray) -> np.ndarray:
        if next(asked) == 2:
            raise ValueError("no more")
        return Problem.residual(problem, x, fixed)

    monkeypatch.setitem(vars(problem), "residual", failing)
    assert Ipopt().solve(problem, start).status is Status.RAISED
    monkeypatch.undo()
    assert numbers(Ipopt().solve(problem, start)) == expected


def test_nothing_of_a_run_is_kept() -> None:
    runs: list[weakref.ref[Run]] = []

    def hessian(run: Run, x: np.ndarray, here: Linearization) -> np.ndarray:
        runs.append(weakref.ref(run))
        return np.asarray(here.normal)

    problem, start = decay()
    assert Ipopt(hessian).solve(problem, start).converged
    gc.collect()
    assert runs
    assert runs[0]() is None
    assert len(problem.solvers_made) == 1


def test_a_large_problem_keeps_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(made, "MOST", 2)
    problem, start = decay()
    assert wb.solve(problem, start, Ipopt()).converged
    assert problem.solvers_made == []
