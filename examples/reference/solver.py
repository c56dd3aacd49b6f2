"""Solver, Abilities: an algorithm of your own, taken wherever one of ours is."""

from dataclasses import KW_ONLY, dataclass

import numpy as np

import workbench as wb
from workbench.solvers import Boxes, Callback, Derivative, Limits, Run


@dataclass(frozen=True)
class HalfSteps(Limits):  # half of every Gauss-Newton step
    _: KW_ONLY
    max_seconds: float = 10.0  # the other limits keep their defaults

    @property
    def abilities(self) -> wb.Abilities:
        return wb.Abilities(Derivative.JACOBIAN, Boxes.REFUSED)

    def solve(
        self, problem: wb.Problem, start: wb.Values, *, callback: Callback = None
    ) -> wb.Solution:
        with Run("half-steps", self, problem, start, callback) as run:  # refuses what it must
            x, here = run.x, run.begin()
            while True:  # until the run has converged or reached a limit
                x, here = run.move(x + 0.5 * here.step(0.0))
        return run.solution()


x = wb.Block("x", (2,))
problem = wb.Problem([wb.Residual("data", x.symbol**2 - [1, 4], sigma=1.0)], ["x"], blocks=[x])
solver: wb.Solver = HalfSteps()
solution = wb.solve(problem, {"x": np.array([3.0, 3.0])}, solver)
print(solution.status.name, solution.values["x"].round(4), solution.iterations, "steps")
