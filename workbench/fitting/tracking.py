"""The frames of a recording: which of them differ, and each fitted from where the last one ended.

As in MoSh (Loper, Mahmood and Black, Motion and Shape Capture from Sparse Markers, 2014), the shape
is found from a few frames that differ, and held while every frame gets its pose.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Block, Points, Values
from workbench.bodies.body import Body
from workbench.fitting.body_priors import shape_prior
from workbench.geometry.rigid import procrustes
from workbench.problem import Problem, sequence
from workbench.residuals import Residual, landmarks
from workbench.solvers import SolveStage, Staged, Status, TrustRegion
from workbench.solvers.solution import Solution, Solver

SHAPE_FRAMES = 12  # from which the shape is found
COMPARED_POINTS = 60  # points by which frames are compared
LOST_RATIO = 4.0  # times the cost of the frame before: a frame that may have been lost
# a smaller change is finer than anything observed
QUICK_SOLVER = TrustRegion(max_iterations=40, gradient_tolerance=1e-3)
Starts = Callable[[int, Values | None], Sequence[Values]]
Progress = Callable[[str, int, int], object]


def quiet(what: str, done: int, all_of: int) -> None:
    """A progress that says nothing."""


def solved(solver: Solver, problem: Problem, start: Values) -> Solution:
    """The solution; an interrupt, which a solver keeps for its own end, is raised again."""
    solution = solver.solve(problem, start)
    if solution.status is Status.STOPPED:
        raise KeyboardInterrupt
    return solution


@dataclass(frozen=True, eq=False)
class Tracker:
    """Frames of one problem, fitted one after the other.

    A frame begins where the one before ended. It is fitted by itself as well if it is the first, if
    its turn has come, or if its cost is more than four times that of the frame before; the end of
    lower cost is taken.

    `starts` gives values of all blocks from which frame t may begin, given those at the end of the
    frame before, or None for a frame by itself; none if it shows too little. A frame by itself is
    solved in `stages` before the last one, by `solver`, and one from the frame before by
    `following`. `every` so many frames one is fitted by itself; None for never.
    """

    problem: Problem
    starts: Starts
    stages: tuple[SolveStage, ...] = ()
    solver: TrustRegion = QUICK_SOLVER
    following: TrustRegion = QUICK_SOLVER
    every: int | None = None

    def alone(self, t: int) -> tuple[float, Values] | None:
        """The cost and the values of frame t by itself; None if it shows too little."""
        return self._best(Staged(self.stages, self.solver), self.starts(t, None))

    def frames(
        self, count: int, progress: Callable[[int, int], object] = lambda done, of: None
    ) -> list[Values | None]:
        """The values of so many frames; None for those that show too little."""
        ends: list[Values | None] = []
        last: tuple[float, Values] | None = None
        since = 0
        for t in range(count):
            end = None
            if last is not None:
                end = self._best(self.following, self.starts(t, last[1]))
            since += 1
            due = last is None or (self.every is not None and since >= self.every)
            if due or (last is not None and end is not None and end[0] > LOST_RATIO * last[0]):
                alone = self.alone(t)
                if alone is not None:
                    since = 0
                    end = alone if end is None else min(end, alone, key=lambda one: one[0])
            ends.append(None if end is None else end[1])
            last = end or last
            progress(t + 1, count)
        return ends

    def _best(self, solver: Solver, starts: Sequence[Values]) -> tuple[float, Values] | None:
        ends = []
        for start in starts:
            solution = solved(solver, self.problem, start)
            ends.append((solution.cost, {**start, **solution.values}))
        return min(ends, key=lambda end: end[0], default=None)


@dataclass(frozen=True, eq=False)
class PointTracker:
    """What T frames show of a body: M of its points, written in its blocks, and where they were
    observed, (T, M, 3) m, NaN where not.

    Each point counts `counts` (M,) times; `sigma` is in m, of an observed coordinate, and `prior`
    is on the pose. `starts` is as for `Tracker`, of pose and trans. `widths` are sigmas in m from
    which a frame by itself is narrowed down to `sigma`, and `own` the rows of betas that are each
    frame's own, such as those of an expression.
    """

    body: Body
    points: Points
    observed: Array
    counts: Array
    sigma: float
    prior: Residual
    starts: Starts
    widths: tuple[float, ...] = ()
    own: range = range(0)

    @cached_property
    def frame(self) -> Problem:
        """One frame: pose, betas and trans are free."""
        M = len(self.counts)
        place, seen = Block("observed", (M, 3), "m"), Block("seen", (M,))
        data = landmarks(self.points, place.symbol, sigma=self.sigma, name="points")
        data = replace(data, weights=seen.symbol)
        pose, betas, trans = (block.name for block in self.body.blocks())
        priors = (self.prior, shape_prior(self.body))
        return Problem([data, *priors], (trans, pose, betas), blocks=(place, seen))

    def data(self, t: int) -> Values:
        """What frame t shows."""
        known: Mask = np.asarray(np.isfinite(self.observed[t]).all(axis=1))
        places = np.where(known[:, None], self.observed[t], 0.0)
        return {"observed": places, "seen": known * self.counts}

    def shape(self, betas: Array, progress: Progress = quiet) -> Array:
        """The betas (B,) of some frames that differ, beginning with these."""
        M = self.observed.shape[1]
        some = np.linspace(0, M - 1, min(M, COMPARED_POINTS)).round().astype(int)
        chosen = spread_frames(self.observed[:, some], SHAPE_FRAMES).tolist()
        tracker, frames = self._tracker(betas), []
        for i, t in enumerate(chosen):
            progress("shape", i, len(chosen) + 1)
            end = tracker.alone(t)
            assert end is not None  # for there is a start
            frames.append(end[1])
        names = [block.name for block in self.body.blocks()]
        together = sequence([self.frame] * len(chosen), shared=(names[1],))
        framed = (names[0], names[2], "observed", "seen")
        start = {name: np.array([frame[name] for frame in frames]) for name in framed}
        progress("shape", len(chosen), len(chosen) + 1)
        solution = solved(QUICK_SOLVER, together, {**start, names[1]: betas})
        progress("shape", len(chosen) + 1, len(chosen) + 1)
        return np.asarray(solution.values[names[1]])

    def poses(self, betas: Array, progress: Progress = quiet) -> Values:
        """The poses (T, K, 3) rad, trans (T, 3) m and betas (T, B) of all frames.

        The betas are those given but for each frame's own.
        """
        frames = self._tracker(betas).frames(len(self.observed), partial(progress, "poses"))
        names = [block.name for block in self.body.blocks()]
        return {name: np.array([frame[name] for frame in frames if frame]) for name in names}

    def _tracker(self, betas: Array) -> Tracker:
        """The tracker with these betas held, but for each frame's own."""
        pose, name, trans = (block.name for block in self.body.blocks())

        def starts(t: int, before: Values | None) -> list[Values]:
            starts_of_frame = []
            for start in self.starts(t, before):
                shape = betas.copy()
                shape[self.own] = start.get(name, betas)[self.own]
                starts_of_frame.append({**start, **self.data(t), name: shape})
            return starts_of_frame

        stages = (SolveStage(weights={"points": (self.sigma / w) ** 2}) for w in self.widths)
        frame = self.frame.freeing(trans, pose, *(f"{name}[{b}]" for b in self.own))
        return Tracker(frame, starts, tuple(stages))


def spread_frames(markers: Array, count: int) -> Index:
    """The frames of markers (T, M, 3) m that differ most, by a greedy search, in order.

    The first is that which shows most markers. Each next one is the frame whose distance to the
    nearest of those chosen is largest (Gonzalez 1985); a distance is the root mean square of
    markers that both show, after a rigid motion, times the share of markers that the frame shows.
    """
    known = np.isfinite(markers).all(axis=2)
    chosen = [int(np.argmax(known.sum(axis=1)))]
    apart = np.full(len(markers), np.inf)
    share = known.mean(axis=1)
    while len(chosen) < min(count, len(markers)):
        last = chosen[-1]
        apart = np.minimum(apart, [_distance(markers[last], own) for own in markers])
        apart[last] = -1.0
        chosen.append(int(np.argmax(apart * share)))
    return np.array(sorted(chosen), dtype=np.int64)


def _distance(one: Array, other: Array) -> float:
    """The root mean square distance of markers (M, 3) m that both show, after a rigid motion."""
    both = np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1)
    if both.sum() < 3:
        return 0.0
    motion = procrustes(one[both], other[both])
    return float(np.sqrt(np.mean(np.sum((motion(one[both]) - other[both]) ** 2, axis=1))))
