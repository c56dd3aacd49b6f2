"""No solver of a run pays for what is made only once."""

from dataclasses import dataclass, field
from typing import Any

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from workbench.experiments import find, run
from workbench.experiments.experiment import Experiment
from workbench.experiments.running import warm_up
from workbench.fitting import Setup
from workbench.solvers import SOLVERS, Solution, TrustRegion


@dataclass(frozen=True)
class Noted(TrustRegion):
    """A solver that notes how each of its runs ended."""

    ends: list[Solution] = field(default_factory=list, compare=False)

    def solve(self, problem: Any, start: Any, *, callback: Any = None) -> Solution:
        found = super().solve(problem, start, callback=callback)
        self.ends.append(found)
        return found


def test_run_begins_with_one_iterate_that_is_not_reported() -> None:
    solver = Noted()
    setup = find("landmarks", {"body": "small"}).setup()
    outcome = run(Experiment("x", lambda: setup, "x"), solver, compare=False)
    first, second = solver.ends
    assert first.status.name == "STOPPED"
    assert first.iterations <= 1
    assert second is outcome.solution
    assert second.converged


def test_warm_up_passes_over_solvers_that_cannot_solve() -> None:
    x = wb.Block("x", (1,))
    problem = wb.Problem([wb.residuals.gaussian(x.symbol)], "x", {"x": (-1, 1)})
    warm_up(Setup(problem, {"x": np.zeros(1)}, "?"), [SOLVERS["gauss-newton"]])  # takes no bounds


@pytest.mark.parametrize("name", ["ipopt", "sqp", "scipy-trf", "nlopt-lbfgs"])
def test_warm_up_ends_after_the_first_iterate(name: str) -> None:
    setup = find("landmarks", {"body": "small"}).setup()
    warm_up(setup, [SOLVERS[name]])


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
