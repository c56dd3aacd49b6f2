"""One stage of the fit of a body to a scan, and the runs of a solver in it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf

from workbench.blocks import Values
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.solvers.solution import Iterate, Solution, Solver

OVER = 3  # iterations, over which a decrease is measured
FURTHER = 5  # such decreases are what a run is expected to gain yet, at most
CLEARLY = 1.1  # times the cost that it must come down to: above this it is given up


@dataclass(frozen=True)
class FitStage:
    """One stage of a fit, from coarse to fine.

    Attributes:
        points: of the scan, drawn at random; all if there are fewer.
        sigma: in m, how far good points are from the model's surface: noise, and what the model
            cannot express.
        reach: in m, the scale of the robust kernel, where bad points begin.
        starts: how many of the best ends of the stage before are taken up.
        iterations: the most from each start.
        settled: a run ends when three iterations together lower the cost by less than this share.
        limbs: of how many of the best ends the arms and legs begin again in other poses afterwards,
            in case one is folded the wrong way (see `limbs.other_limbs`).

    A point at the surface lowers the cost by (reach / sigma)^2 / 2, compared with one far from it.
    With a wide reach, a few points of clutter outweigh the prior, and draw hidden limbs to them.
    So sigma shrinks with the reach on the way, and the last reach is three sigmas.
    """

    points: int
    sigma: float
    reach: float
    starts: int
    iterations: int
    settled: float = 0.01
    limbs: int = 0

    def __post_init__(self) -> None:
        least = min(self.points, self.sigma, self.reach, self.starts, self.iterations)
        if not least > 0 or not 0 <= self.settled < 1 or self.limbs < 0:
            raise BadArgument(
                "the numbers of a stage are above zero, settled < 1 and limbs 0 or more, "
                f"not {self}"
            )


@dataclass(frozen=True)
class Progress:
    """How far a fit has come; `stage` and `start` count from 1, `cost` is that of its iterate."""

    stage: int
    stages: int
    start: int
    starts: int
    iteration: int
    cost: float


@dataclass
class StageRuns:
    """The runs of one stage, one after the other, until somebody stops them.

    Attributes:
        problem: what they solve.
        solver: what solves it.
        progress: is told of every iterate, and stops all runs by returning True.
        interrupted: whether Ctrl-C was pressed.
        stage: the number of the stage, and how many there are.
        starts: how many starts there are.
        iterations: of all runs together.
        stopped: why the runs were stopped, in a sentence; empty if they were not.
        given_up: whether the last run was, so that its end is only a place on its way.
    """

    problem: Problem
    solver: Solver
    progress: Callable[[Progress], object] | None
    interrupted: Callable[[], bool]
    stage: tuple[int, int]
    starts: int
    iterations: int = 0
    stopped: str = ""
    given_up: bool = False

    def run(
        self,
        number: int,
        start: Values,
        most: int,
        settled: float,
        enough: float = inf,
        known: Callable[[Values], bool] | None = None,
    ) -> Solution:
        """One run that begins at `start`, or at what was found from the start of this number.

        It ends after `most` iterations, when three of them together lower the cost by less than a
        share of it, or when the runs are stopped. It is given up when five times the decrease over
        the last three iterations would leave its cost more than a tenth above `enough`, and at an
        iterate after the first that `known` says is near an end that is known already.
        """
        costs: list[float] = []
        self.given_up = False
        at = Progress(*self.stage, number + 1, self.starts, 0, 0.0)

        def done(iterate: Iterate) -> bool:
            costs.append(iterate.cost)
            now = replace(at, iteration=len(costs) - 1, cost=iterate.cost)
            if self.stopped or (self.progress is not None and self.progress(now) is True):
                self.stopped = "stopped"
            if self.stopped or now.iteration >= most:
                return True
            if known is not None and len(costs) > 1 and known(iterate.values):
                self.given_up = True
                return True
            if len(costs) <= OVER + 1:
                return False
            gained = costs[-1 - OVER] - iterate.cost
            hopeless = iterate.cost - FURTHER * gained > CLEARLY * enough
            settles = gained < settled * iterate.cost
            self.given_up = hopeless and not settles
            return settles or hopeless

        end = self.solver.solve(self.problem, start, callback=done)
        self.iterations += len(end.trace) - 1
        if self.stopped or self.interrupted():
            self.stopped = end.message
        return end
