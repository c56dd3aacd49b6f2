"""Ends that are called converged and are none are found, and minima are not called false."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as cs
import mpmath as mp
import numpy as np
import pytest

from benchmarks.gym import arithmetic, checked, page
from benchmarks.gym.arithmetic import IN_DIGITS, IN_DOUBLES, Arithmetic, arithmetic_of, in_digits
from benchmarks.gym.case import Case, case, setup
from benchmarks.gym.checked import BROKEN, COLUMNS, End, check, draw, end_of, lines, read
from benchmarks.gym.split import tuning
from benchmarks.gym.verdicts import GRADIENT, LOST, SADDLE, judge
from workbench.blocks import Block, Values
from workbench.fitting.setup import Setup
from workbench.problem import Problem
from workbench.solvers import SOLVERS, Abilities, Boxes, Derivative, Evaluations, Iterate, Status
from workbench.solvers.solution import Solution

PLACE = Path(__file__).parents[2] / "benchmarks"
T = np.linspace(0, 3, 8)
Expression = Callable[[cs.MX], cs.MX]


def posed(expression: Expression, start: tuple[float, ...]) -> Setup:
    x = Block("x", (len(start),))
    return setup("made up", expression(x.symbol), x, np.array(start), "here", np.zeros(len(start)))


@dataclass(frozen=True)
class Claims:
    """A solver that calls a given point converged."""

    end: tuple[float, ...]

    @property
    def abilities(self) -> Abilities:
        return Abilities(Derivative.COST, Boxes.TAKEN)

    def solve(self, problem: Problem, start: Values, *, callback: Any = None) -> Solution:
        there = {"x": np.array(self.end)}
        trace = tuple(
            Iterate(at, problem.linearize(at).cost, 0.0, 0.0, 0.0, Evaluations(), 0.0)
            for at in ({"x": np.asarray(start["x"])}, there)
        )
        return Solution(
            there,
            trace[-1].cost,
            0.0,
            Status.CONVERGED,
            "",
            "claims",
            Evaluations(),
            0.0,
            trace,
        )


def decay(x: cs.MX) -> cs.MX:
    return cs.exp(-x[0] * cs.DM(T + 0.1)) - cs.DM(np.exp(-T - 0.1))


FALSE = {  # the residual, the start, the end that is claimed, and what is wrong with it
    "a maximum in x": (
        lambda x: cs.vertcat(x[0] ** 2 - 1, x[1]),
        (0.5, 1.0),
        (0.0, 0.0),
        f"{LOST} {SADDLE}",
    ),
    "a saddle between two minima": (
        lambda x: cs.vertcat(x[0] * x[1] - 1, 0.1 * x[0], 0.1 * x[1]),
        (0.5, 0.3),
        (0.0, 0.0),
        f"{SADDLE}",
    ),
    "the desert of an exponential": (decay, (3.0,), (900.0,), LOST),
    "a steep point": (decay, (3.0,), (1.5,), GRADIENT),
    "a point beside the minimum": (decay, (3.0,), (1.0 + 1e-4,), GRADIENT),
}
TRUE = {
    "the minimum": (decay, (3.0,), (1.0,)),
    "a penalty that is not active": (
        lambda x: cs.vertcat(x[0] - 1, cs.fmax(0, -x[1])),
        (0.0, -1.0),
        (1.0, 2.0),
    ),
    "a minimum where the column is zero": (
        lambda x: cs.vertcat(1 + x[0] ** 2, x[1]),
        (1.0, 1.0),
        (0.0, 0.0),
    ),
    "an unknown that is not read anywhere": (
        lambda x: cs.vertcat(x[0] - 1, 0 * x[1]),
        (0.0, 1.0),
        (1.0, 1.0),
    ),
    "a flat minimum": (lambda x: cs.vertcat(x[0] ** 2, x[1]), (1.0, 1.0), (0.0, 0.0)),
}


def in_doubles(problem: Problem, fixed: Any) -> Arithmetic:
    def residual(x: Any) -> Any:
        return problem.residual(x, fixed)

    return Arithmetic(IN_DOUBLES, residual, lambda x: np.array(x), 2.0**-52)


def verdict(expression: Expression, start: Any, end: Any, kind: str) -> str:
    found = posed(expression, start)
    x, fixed = found.problem.split(found.start)
    to = np.array(end)
    how = in_doubles(found.problem, fixed) if kind == IN_DOUBLES else None
    told = judge(found.problem, fixed, to, [x, to], 1e-6, how)
    assert told.arithmetic == kind
    return " ".join(told.violations)


@pytest.mark.parametrize("kind", [IN_DIGITS, IN_DOUBLES])
@pytest.mark.parametrize("name", FALSE)
def test_false_ends_are_found(name: str, kind: str) -> None:
    expression, start, end, wrong = FALSE[name]
    assert verdict(expression, start, end, kind) == wrong


@pytest.mark.parametrize("kind", [IN_DIGITS, IN_DOUBLES])
@pytest.mark.parametrize("name", TRUE)
def test_minima_are_not_called_false(name: str, kind: str) -> None:
    expression, start, end = TRUE[name]
    assert verdict(expression, start, end, kind) == ""


def test_a_fall_that_the_tolerance_counts_as_none_is_recorded_and_no_violation() -> None:
    expression, start, end, _ = next(one for one in FALSE.values() if one[3] == SADDLE)
    found = posed(expression, start)
    x, fixed = found.problem.split(found.start)
    to = np.array(end)
    strict, loose = (judge(found.problem, fixed, to, [x, to], t) for t in (1e-6, 1.0))
    assert strict.violations == (SADDLE,)
    assert loose.violations == ()
    assert strict.fall == loose.fall > 0
    told = End("a case", "made up", "claims", "CONVERGED", "1", "0", IN_DIGITS, fall="2.3e-14")
    text = "\n".join(lines([told]))
    assert "0 of these ends are not what CONVERGED claims" in text
    assert "One of them lies at a saddle all the same" in text
    assert "(claims on a case, by 2.3e-14 of it)" in text


def made_up(expression: Expression = decay, start: tuple[float, ...] = (3.0,)) -> Case:
    return case("made-up", "made up", posed, {"expression": expression, "start": start})


def test_a_solver_that_calls_a_steep_point_converged_is_in_the_table(tmp_path: Path) -> None:
    solvers = {"claims": Claims((1.5,)), "levenberg-marquardt": SOLVERS["levenberg-marquardt"]}
    ends = check([made_up()], solvers, tmp_path / "ends.csv")
    assert [(end.solver, end.status, end.violations) for end in ends] == [
        ("claims", "CONVERGED", GRADIENT),
        ("levenberg-marquardt", "CONVERGED", ""),
    ]
    table = list(lines(ends))
    assert table[0].startswith("2 runs, of which 2 end as CONVERGED; 1 of these ends")
    assert table[1] == "| solver | runs | CONVERGED | lost | gradient | saddle |"
    assert table[3] == "| claims | 1 | 1 | 0 | 1 | 0 |"
    assert "| all | 2 | 2 | 0 | 1 | 0 |" in table
    assert table[-1].startswith("| gradient | made-up | claims |")


def test_runs_are_kept_and_not_repeated(tmp_path: Path) -> None:
    file = tmp_path / "ends.csv"
    first = check([made_up()], {"claims": Claims((1.0,))}, file)
    assert list(read(file)) == first
    again = check([made_up()], {"claims": Claims((1.5,))}, file)  # another answer is not asked for
    assert again == first
    assert file.read_text().splitlines()[0] == ",".join(COLUMNS)
    checked.write(tmp_path / "out" / "ends.csv", again)
    assert list(read(tmp_path / "out" / "ends.csv")) == first


def test_a_solver_that_raises_is_written_down() -> None:
    class Raises(Claims):
        def solve(self, problem: Problem, start: Values, *, callback: Any = None) -> Solution:
            raise ZeroDivisionError("on purpose")

    one = made_up()
    found = end_of(one, one.experiment.setup(), "raises", Raises((0.0,)))
    assert found.status == BROKEN
    assert found.message == "ZeroDivisionError: on purpose"


def test_the_draw_depends_on_names_alone() -> None:
    some = tuning()[:12]
    solvers = dict(list(SOLVERS.items()))
    drawn = draw(some, solvers, 40)
    assert sum(map(len, drawn.values())) == 40
    assert draw(some[::-1], dict(reversed(solvers.items())), 40).keys() == drawn.keys()
    more = draw(some, solvers, 60)
    assert all(set(names) <= set(more[case]) for case, names in drawn.items())
    every = draw(some, solvers, 10_000)
    assert all(len(names) == len(solvers) - 1 for names in every.values())
    assert not any("nlopt-mlsl" in names for names in every.values())  # it needs bounds


def test_fifty_digits_agree_with_double_precision() -> None:
    one = next(one for one in tuning() if one.problem == "robust-damped-huber-0")
    problem = one.experiment.setup().problem
    x, fixed = problem.split(one.experiment.setup().start)
    here = problem.linearize_at(x, fixed)
    with mp.workdps(arithmetic.DIGITS):
        exact = arithmetic_of(problem, fixed)
        assert exact.name == IN_DIGITS
        column, error = exact.column(x, 2, abs(x[2]))
        along, of_along = exact.curvature(x, np.eye(x.size)[2], abs(x[2]))
    np.testing.assert_allclose(column.astype(float), here.column(2), rtol=1e-11, atol=1e-11)
    assert np.linalg.norm(error) < 1e-25 * np.linalg.norm(here.column(2))
    H = problem.hessian_at(x, fixed)[2, 2]
    assert along == pytest.approx(float(H), rel=1e-9)
    assert of_along < 1e-15 * abs(H)


def test_bodies_are_judged_in_doubles_with_an_error_that_covers_the_difference() -> None:
    one = next(one for one in tuning() if one.family == "bodies")
    found = one.experiment.setup()
    x, fixed = found.problem.split(found.start)
    assert in_digits(found.problem, fixed) is None
    by_difference = arithmetic_of(found.problem, fixed)
    assert by_difference.name == IN_DOUBLES
    exact = found.problem.linearize_at(x, fixed).column(4)
    column, error = by_difference.column(x, 4, 1.0)
    assert 0 < np.linalg.norm(column - exact) <= np.linalg.norm(error)
    assert np.linalg.norm(error) < 1e-8 * np.linalg.norm(exact)


def test_the_page_holds_the_table_of_ends() -> None:
    ends = [End("a case", "made up", "claims", "CONVERGED", "1", "0", IN_DIGITS)]
    text = "\n".join(page.lines({}, lines(ends)))
    assert "## Ends that are called converged" in text
    assert "1 runs, of which 1 end as CONVERGED; 0 of these" in text
    assert "## Ends" not in "\n".join(page.lines({}))
