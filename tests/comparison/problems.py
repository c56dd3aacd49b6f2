"""Small problems whose basins are known, and solvers that misbehave: workers import them here."""

import os
import random
from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench import Block, Problem, Residual, Solution, Status, Values
from workbench.experiments import Experiment, Setup
from workbench.solvers import Callback, Evaluations

DEPTH, TILT = 0.1, 0.02  # of the double well that `slide` has along its weak direction
STARTS = ((3.0, 2.0), (3.0, -2.0), (-1.0, 1.5))


def slide(start: int = 0) -> Setup:
    """A stiff direction a, and along b, hardly seen, two wells: near b = -1, and lower at 1."""
    x = Block("x", (2,), labels=("a", "b"))
    a, b = x.symbol[0], x.symbol[1]
    seen = Residual("seen", 10 * a, 1.0)
    hardly = Residual("hardly seen", cs.vertcat(DEPTH * (b**2 - 1), TILT * (b - 1)), 1.0)
    problem = Problem((seen, hardly), ("x",), blocks=(x,))
    return Setup(problem, {"x": np.array(STARTS[start])}, "Which well?")


def lost_well() -> float:
    """Where the upper well of `slide` is, by the roots of its derivative."""
    d, t = DEPTH**2, TILT**2
    return float(min(np.roots([2 * d, 0, t - 2 * d, -t]).real))


def angle(start: int = 0) -> Setup:
    """A point on a circle: a full turn further the residual is the same."""
    x = Block("x", (1,))
    r = cs.vertcat(cs.cos(x.symbol[0]) - 1, cs.sin(x.symbol[0]) - 0.5)
    where = (0.2, 0.2 + 2 * np.pi)[start]
    return Setup(Problem((Residual("r", r, 1.0),), ("x",)), {"x": np.array([where])}, "Where?")


def line(seed: int = 0) -> Setup:
    """Linear: every seed has data of its own."""
    rng = np.random.default_rng(seed)
    A, y = rng.normal(size=(8, 3)), rng.normal(size=8)
    x = Block("x", (3,)).symbol
    return Setup(
        Problem((Residual("line", A @ x - y, 1.0),), ("x",)), {"x": np.full(3, 5.0)}, "Which line?"
    )


def nowhere() -> Setup:
    """Its cost is NaN at the start, and everywhere else."""
    x = Block("x", (1,)).symbol
    return Setup(
        Problem((Residual("root", cs.sqrt(-1 - x**2), 1.0),), ("x",)), {"x": np.zeros(1)}, "How?"
    )


SLIDE = Experiment("slide", slide, "for tests")
ANGLE = Experiment("angle", angle, "for tests")
LINE = Experiment("line", line, "for tests")
NOWHERE = Experiment("nowhere", nowhere, "for tests")


def says(problem: Problem, values: Values, status: Status = Status.CONVERGED) -> Solution:
    """A solution by nobody's measure but its own."""
    free = {name: values[name] for name in problem.free.names}
    return Solution(free, 0.0, 0.0, status, "trust me", "made up", Evaluations(), 0.0, ())


@dataclass(frozen=True)
class Liar:
    """Stays where it is and claims to have converged."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        return says(problem, start)


@dataclass(frozen=True)
class Raiser:
    """Looks once, and raises."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        problem.linearize(start)
        raise ValueError("out of ideas")


@dataclass(frozen=True)
class NotANumber:
    """Returns NaN."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        return says(problem, {name: np.nan * value for name, value in start.items()})


@dataclass(frozen=True)
class Forever:
    """Looks once, and never stops: nor does it listen to any limit."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        problem.linearize(start)
        while True:
            pass


@dataclass(frozen=True)
class InC:
    """Never stops inside of C, with the interpreter locked; nor does it hear a signal."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        problem.linearize(start)
        return says(problem, start, Status(sum(range(10**15))))


@dataclass(frozen=True)
class Dies:
    """Takes its process with it."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        print("farewell")
        os.abort()


@dataclass(frozen=True)
class Leaves:
    """Ends the program, as far as it can."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        raise SystemExit(3)


@dataclass(frozen=True)
class Spendthrift:
    """Asks for one residual after the other, and knows no limits."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        x, fixed = problem.split(start)
        while True:
            problem.residual(x, fixed)


@dataclass(frozen=True)
class Drawer:
    """Goes to points that it draws, from the generators that everybody shares."""

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        x, fixed = problem.split(start)
        for _ in range(20):
            x = np.random.normal(size=x.size) + random.random()
            problem.residual(x, fixed)
        return says(problem, problem.free.unpack(x))
