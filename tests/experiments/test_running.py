"""Experiments are run: how solvers compare, and what an interrupt leaves of that."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np
import pytest

from tests.outcomes_made_up import outcome_made_up, setup_made_up
from workbench.experiments import Experiment, find, run
from workbench.experiments.running import as_good, best_cost, excess, warm_up
from workbench.solvers import (
    SOLVERS,
    Evaluations,
    Iterate,
    LevenbergMarquardt,
    Nlopt,
    Solution,
    Status,
)

MADE_UP = Experiment("made up", setup_made_up, "for tests")  # asks gauss-newton, nlopt-lbfgs


def ended(cost: float, start: float = 1e6, seconds: float = 1.0) -> Solution:
    trace = tuple(Iterate({}, c, 0.0, 0.0, 0.0, Evaluations(), 0.0) for c in (start, cost))
    return Solution({}, cost, 0.0, Status.CONVERGED, "", "x", Evaluations(), seconds, trace)


def test_excess_is_a_share_of_the_best_cost() -> None:
    two = {"a": ended(3.0), "b": ended(2.0)}
    assert best_cost(two) == 2.0
    assert [excess(s, two) for s in two.values()] == [0.5, 0.0]
    assert as_good(two) == ("b",)
    assert np.isnan(best_cost({"never": ended(np.inf)}))


def test_costs_within_rounding_are_as_good() -> None:
    exact = {"a": ended(1e-21), "b": ended(1e-17, seconds=0.5), "c": ended(0.0)}
    assert [excess(s, exact) for s in exact.values()] == [0.0, 0.0, 0.0]
    assert as_good(exact) == ("a", "b", "c")  # as given: no clock ranks them
    slower = {name: replace(s, seconds=2.0 - s.seconds) for name, s in exact.items()}
    assert as_good(slower) == as_good(exact)
    assert excess(ended(1.0), exact | {"d": ended(1.0)}) == np.inf


def test_outcome_names_a_solver_that_found_less() -> None:
    outcome = outcome_made_up()
    assert outcome.better is None
    assert outcome.best_cost == min(s.cost for s in outcome.compared.values())
    less = replace(outcome.solution, cost=0.9 * outcome.solution.cost)
    poor = replace(outcome, compared=outcome.compared | {"ipopt": less})
    assert poor.better == "ipopt"
    assert poor.excess("trust-region") == pytest.approx(1 / 0.9 - 1)
    barely = replace(outcome.solution, cost=(1 - 1e-8) * outcome.solution.cost)
    assert replace(outcome, compared=outcome.compared | {"ipopt": barely}).better is None


@dataclass(frozen=True)
class Counting:
    """Levenberg-Marquardt, counted."""

    solves: list[str]

    def solve(self, *arguments: Any, **options: Any) -> Solution:
        self.solves.append("once more")
        return LevenbergMarquardt().solve(*arguments, **options)


def test_asked_solver_is_compared_and_not_run_twice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counting = Counting([])
    monkeypatch.setitem(SOLVERS, "gauss-newton", counting)  # type: ignore[arg-type]
    outcome = run(MADE_UP, counting)
    assert len(counting.solves) == 2  # the first one warms up
    assert list(outcome.compared) == ["gauss-newton", "nlopt-lbfgs"]
    assert outcome.solver == "gauss-newton"
    assert outcome.compared["gauss-newton"] is outcome.solution


def test_solvers_go_by_their_catalogue_names() -> None:
    outcome = run(MADE_UP, SOLVERS["nlopt-lbfgs"], compare=False)
    assert outcome.solution.solver not in SOLVERS
    assert outcome.solver == "nlopt-lbfgs"
    assert list(outcome.compared) == ["nlopt-lbfgs"]
    short = run(MADE_UP, Nlopt("LD_LBFGS", max_iterations=3))
    assert list(short.compared) == [
        "nlopt LD_LBFGS (with other options)",
        "gauss-newton",
        "nlopt-lbfgs",
    ]


@dataclass(frozen=True)
class Interrupted:
    """A solver at which somebody presses Ctrl-C: it keeps what it has, or has no time to."""

    keeps: bool

    def solve(self, *arguments: Any, **options: Any) -> Solution:
        if not self.keeps:
            raise KeyboardInterrupt
        found = LevenbergMarquardt(max_iterations=2).solve(*arguments, **options)
        return replace(found, status=Status.STOPPED)


@pytest.mark.parametrize("keeps", [True, False])
def test_interrupts_keep_what_was_compared(monkeypatch: pytest.MonkeyPatch, keeps: bool) -> None:
    monkeypatch.setitem(SOLVERS, "gauss-newton", Interrupted(keeps))  # type: ignore[arg-type]
    told: list[str] = []
    outcome = run(MADE_UP, progress=told.append)
    assert outcome.solution.converged
    assert outcome.interrupted
    assert "comparing: nlopt-lbfgs" not in told
    assert outcome.skipped == ("nlopt-lbfgs",) if keeps else ("gauss-newton", "nlopt-lbfgs")
    assert set(outcome.compared) == {"trust-region", *(["gauss-newton"] if keeps else [])}


def test_costs_of_residuals_add_up() -> None:
    outcome = outcome_made_up()
    costs: Mapping[str, float] = outcome.costs
    assert sum(costs.values()) == pytest.approx(outcome.solution.cost)
    assert outcome.prior_share == 0
    setup = replace(outcome.setup, priors=("place",))
    share = costs["place"] / outcome.solution.cost
    assert replace(outcome, setup=setup).prior_share == pytest.approx(share)


def test_warm_up_builds_what_a_solver_asks_for_at_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search for a saddle asks for gradients: no solve builds a function after the warm-up."""
    setup, built = find("landmarks").setup(), list[str]()
    warm_up(setup, [SOLVERS["trust-region"]])
    made = cs.Function.__init__

    def noted(self: Any, *arguments: Any, **options: Any) -> None:
        built.append(str(arguments[0]) if arguments else "")
        made(self, *arguments, **options)

    monkeypatch.setattr(cs.Function, "__init__", noted)
    assert SOLVERS["trust-region"].solve(setup.problem, setup.start).converged
    assert built == []
