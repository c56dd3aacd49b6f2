"""Solvers that ask the graphs and batches of a problem, each the same minimum in its own way."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as cs
import numpy as np

from tests.comparison.problems import says
from workbench import Problem, Solution, Values
from workbench.arrays import Array
from workbench.solvers import Callback

STEPS = 12
Ways = tuple[Callable[[Array], float], Callable[[Array], Array]]  # the cost, and a step


@dataclass(frozen=True)
class Asker:
    """Steps that `ask` makes, halved until the cost falls."""

    ask: Callable[[Problem, Array, Array], Ways]

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        x, fixed = problem.split(start)
        cost, step = self.ask(problem, x, fixed)
        best = cost(x)
        for _ in range(STEPS):
            p, t = step(x), 1.0
            while (found := cost(x + t * p)) > best and t > 1e-3:
                t /= 2
            if found <= best:
                x, best = x + t * p, found
        return says(problem, problem.free.unpack(x))


def by_batches(problem: Problem, x: Array, fixed: Array) -> Ways:
    """Steepest descent: `cost_gradients` for the direction, `costs` of a fan of step lengths."""
    costs, slopes = problem.costs(x, fixed), problem.cost_gradients(x, fixed)

    def cost(x: Array) -> float:
        return float(costs(x[None])[0])

    def step(x: Array) -> Array:
        g = slopes(x[None])[1][0]
        lengths = np.geomspace(1e-3, 1, 9)
        fan = costs(x - lengths[:, None] * g)
        return np.asarray(-lengths[int(np.argmin(fan))] * g)

    return cost, step


@dataclass(frozen=True)
class OwnGraph:
    """From the expressions of the residuals: the problem is never asked at all."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        (block,) = problem.free.blocks
        r = cs.vertcat(*(residual.whitened for residual in problem.residuals))
        nlp = {"x": block.symbol, "f": 0.5 * cs.sumsqr(r)}
        solver = cs.nlpsol("own", "ipopt", nlp, {"ipopt.print_level": 0, "print_time": 0})
        x, _ = problem.split(start)
        return says(problem, problem.free.unpack(np.asarray(solver(x0=x)["x"]).ravel()))
