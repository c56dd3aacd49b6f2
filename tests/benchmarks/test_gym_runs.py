"""Runs of the gym are judged by answers, and ends that are called converged and are none found."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.gym import page
from benchmarks.gym.peers import ALL, AS_IT_COMES, Peer
from benchmarks.gym.runs import BUDGET, Kept, least_starts, run
from benchmarks.gym.runs import read as read_runs
from benchmarks.gym.split import tuning
from benchmarks.gym.success import is_solved, target
from workbench.comparison.record import KINDS, ObservedRun, Record, RunEnding
from workbench.fitting.setup import KnownAnswer
from workbench.solvers import SOLVERS

pytestmark = pytest.mark.thorough

SMALL = tuple(
    one for one in tuning() if one.name in ("arm-planar-3-0", "more-wild-rosenbrock-2, start x 1")
)


def record(cost: float, digits: float = np.nan, inside: bool = True) -> Record:
    observed = ObservedRun(
        (0,) * len(KINDS), (0.0,) * len(KINDS), 0, 0.0, np.ones(1), np.zeros((0, 9))
    )
    return Record(
        "a",
        "b",
        RunEnding.RETURNED,
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
