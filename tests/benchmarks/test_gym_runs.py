"""Runs of the gym are judged by answers, and ends that are called converged and are none found."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as cs
import mpmath as mp
import numpy as np
import pytest

from benchmarks.gym import arithmetic, page
from benchmarks.gym.arithmetic import IN_DIGITS, IN_DOUBLES, Arithmetic, arithmetic_of, in_digits
from benchmarks.gym.case import Case, case, setup
from benchmarks.gym.checked import BROKEN, check, draw, end_of, lines, read
from benchmarks.gym.peers import ALL, AS_IT_COMES, Peer
from benchmarks.gym.runs import BUDGET, Kept, least_starts, run
from benchmarks.gym.runs import read as read_runs
from benchmarks.gym.split import tuning
from benchmarks.gym.success import is_solved, target
from benchmarks.gym.verdicts import GRADIENT, LOST, SADDLE, judge
from workbench.blocks import Block, Values
from workbench.comparison.log import KINDS, Observed
from workbench.comparison.record import Ending, Record
from workbench.fitting.known import KnownAnswer
from workbench.fitting.setup import Setup
from workbench.problem import Problem
from workbench.solvers import SOLVERS, Abilities, Boxes, Derivative, Evaluations, Iterate, Status
from workbench.solvers.solution import Solution

pytestmark = pytest.mark.thorough

T = np.linspace(0, 3, 8)
Expression = Callable[[cs.MX], cs.MX]
SMALL = tuple(
    one for one in tuning() if one.name in ("arm-planar-3-0", "more-wild-rosenbrock-2, start x 1")
)


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
def test_false_ends_are_told_from_minima(kind: str) -> None:
    for expression, start, end, wrong in FALSE.values():
        assert verdict(expression, start, end, kind) == wrong
    for expression, start, end in TRUE.values():
        assert verdict(expression, start, end, kind) == ""


def made_up(expression: Expression = decay, start: tuple[float, ...] = (3.0,)) -> Case:
    return case("made-up", "made up", posed, {"expression": expression, "start": start})


def test_table_names_solvers_that_end_at_steep_points(tmp_path: Path) -> None:
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


def test_checked_ends_are_not_repeated(tmp_path: Path) -> None:
    file = tmp_path / "ends.csv"
    first = check([made_up()], {"claims": Claims((1.0,))}, file)
    assert list(read(file)) == first
    again = check([made_up()], {"claims": Claims((1.5,))}, file)  # another answer is not asked for
    assert again == first


def test_solvers_that_raise_are_broken() -> None:
    class Raises(Claims):
        def solve(self, problem: Problem, start: Values, *, callback: Any = None) -> Solution:
            raise ZeroDivisionError("on purpose")

    one = made_up()
    found = end_of(one, one.experiment.setup(), "raises", Raises((0.0,)))
    assert found.status == BROKEN
    assert found.message == "ZeroDivisionError: on purpose"


def test_draw_depends_on_names_alone() -> None:
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


def test_bodies_are_judged_in_doubles() -> None:
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


def record(cost: float, digits: float = np.nan, inside: bool = True) -> Record:
    observed = Observed(
        (0,) * len(KINDS), (0.0,) * len(KINDS), 0, 0.0, np.ones(1), np.zeros((0, 9))
    )
    return Record(
        "a",
        "b",
        Ending.RETURNED,
        "",
        observed,
        "",
        cost=cost,
        digits=digits,
        inside=inside,
        end=np.ones(1),
    )


def test_success_needs_known_cost_and_certified_digits() -> None:
    plain = KnownAnswer("somebody", 2.0)
    certified = KnownAnswer("NIST", 2.0, {"x": np.ones(1)}, {"x": np.ones(1)})
    enough = target(2.0, 1e4)
    assert 2 + 2e-6 < enough < 2 + 2.1e-6
    assert is_solved(record(2 + 1e-6), enough, plain)
    assert is_solved(record(1.0), enough, plain)
    assert not is_solved(record(2 + 1e-5), enough, plain)
    assert not is_solved(record(2.0, inside=False), enough, plain)
    assert not is_solved(record(np.nan), enough, plain)
    assert is_solved(record(2.0, 4.1), enough, certified)
    assert not is_solved(record(2.0, 3.9), enough, certified)
    assert is_solved(record(2.0, 3.9), enough, plain)
    assert not is_solved(replace(record(2.0), end=np.zeros(0)), enough, plain)


def test_far_starts_are_measured_by_the_near_one() -> None:
    several = [one for one in tuning() if one.problem == "mgh-extended-rosenbrock"]
    assert len(several) == 3
    assert least_starts(several) == {"mgh-extended-rosenbrock": pytest.approx(121 / 2, rel=1e-9)}


def test_runs_are_judged_kept_and_not_repeated(tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    solvers = {"levenberg-marquardt": SOLVERS["levenberg-marquardt"], "peer trf": Peer("trf")}
    runs = run(SMALL, solvers, file)
    assert [(one.case, one.solver) for one in runs] == [
        (case.name, solver) for case in SMALL for solver in solvers
    ]
    assert all(one.solved and one.claimed and one.stationary for one in runs)
    assert all(0 < one.evaluations < one.effort for one in runs)
    assert list(read_runs(file)) == runs

    more = run(SMALL, {**solvers, "steepest-descent": SOLVERS["steepest-descent"]}, file)
    assert [one for one in more if one.solver in solvers] == runs
    short = run(
        SMALL,
        {"levenberg-marquardt": SOLVERS["levenberg-marquardt"]},
        tmp_path / "short.jsonl",
        budget=replace(BUDGET, max_evaluations=3),
    )
    assert not any(one.solved for one in short)


def test_peers_find_what_scipy_finds() -> None:
    setup = SMALL[0].experiment.setup()
    for name in ("peer trf", "peer trf, jac", "peer dogbox", "peer dogbox, jac", "peer lm"):
        found = ALL[name].solve(setup.problem, setup.start)
        assert found.cost < 1e-20
        assert setup.problem.linearize(found.values).cost == found.cost
    default = ALL[AS_IT_COMES].solve(setup.problem, setup.start)
    assert default.cost == SOLVERS["trust-region"].solve(setup.problem, setup.start).cost


def profiled() -> dict[str, object]:
    def one(case: str, solver: str, solved: bool, effort: float) -> Kept:
        return Kept(case, solver, solved, 1.0, effort, True, True, 0.0, None, "CONVERGED")

    cases = SMALL
    a, b = (case.name for case in cases)
    return page.kept(
        cases,
        [
            one(a, "trust-region", True, 10.0),
            one(b, "trust-region", False, 5.0),
            one(a, "peer trf", True, 40.0),
            one(b, "peer trf", True, 8.0),
        ],
    )


def test_profile_compares_with_the_best_success() -> None:
    found = profiled()
    assert page.profiled(found) == ["trust-region", "peer trf"]
    assert page.profile(found, (1, 3, 4), by=page.PRICED).tolist() == [
        [0.5, 0.5],
        [0.5, 0.5],
        [0.5, 1.0],
    ]
    assert page.lost(found) == [(SMALL[1].name, SMALL[1].family)]
