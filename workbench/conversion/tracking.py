"""The motion of a body from observed points: one shape for all frames, then frame by frame.

As in MoSh (Loper, Mahmood and Black, Motion and Shape Capture from Sparse Markers, 2014), the shape
is found from a few frames that differ, and held while every frame gets its pose. A frame begins
where the one before ended, moved on by what is known of the motion.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Block, Points, Values
from workbench.bodies.body import Body
from workbench.fitting.body_priors import shape_prior
from workbench.fitting.marker_frames import spread_frames
from workbench.problem import Problem, sequence
from workbench.residuals import Residual, landmarks
from workbench.solvers import Status, TrustRegion
from workbench.solvers.solution import Solution

FRAMES = 12  # from which the shape is found
COMPARED = 60  # points by which frames are compared
WORSE = 4.0  # times the cost of the frame before: a frame that may have been lost
QUICK = TrustRegion(max_iterations=40, gradient_tolerance=1e-3)  # what is observed is not better
Starts = Callable[[int, Values | None], list[Values]]
Progress = Callable[[str, int, int], object]


def quiet(what: str, done: int, all_of: int) -> None:
    """A progress that says nothing."""


def solved(solver: TrustRegion, problem: Problem, start: Values) -> Solution:
    """The solution; an interrupt, which a solver keeps for its own end, is raised again."""
    found = solver.solve(problem, start)
    if found.status is Status.STOPPED:
        raise KeyboardInterrupt
    return found


@dataclass(frozen=True, eq=False)
class Tracker:
    """What T frames show of a body: its points, and where M of them were observed.

    Attributes:
        body: the body.
        points: M of its points, written in its blocks.
        observed: (T, M, 3) m, NaN where a point was not seen.
        counts: (M,) how often each point counts.
        sigma: m, of an observed coordinate.
        prior: on the pose.
        starts: values of pose and trans from which frame t may begin, given those of the frame
            before, or None for a frame by itself.
        widths: sigmas in m from which a frame by itself is narrowed down to `sigma`.
        own: the rows of betas that are each frame's own, such as those of an expression.
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

    @cached_property
    def alone(self) -> Problem:
        """One frame with the betas held, but for its own."""
        pose, betas, trans = (block.name for block in self.body.blocks())
        return self.frame.freeing(trans, pose, *(f"{betas}[{b}]" for b in self.own))

    def data(self, t: int) -> Values:
        """What frame t shows."""
        known: Mask = np.asarray(np.isfinite(self.observed[t]).all(axis=1))
        places = np.where(known[:, None], self.observed[t], 0.0)
        return {"observed": places, "seen": known * self.counts}

    def posed(
        self, t: int, starts: list[Values], betas: Array, widths: tuple[float, ...]
    ) -> "Frame":
        """Frame t with the betas given, as the best of several starts ends."""
        data, name = self.data(t), self.body.blocks()[1].name
        ends = []
        for start in starts:
            shape = betas.copy()
            shape[self.own] = start.get(name, betas)[self.own]
            values, cost = {**start, **data, name: shape}, np.inf
            for width in (*widths, self.sigma):
                values["seen"] = data["seen"] * (self.sigma / width) ** 2
                found = solved(QUICK, self.alone, values)
                values, cost = {**values, **found.values}, found.cost
            ends.append((cost, values))
        cost, values = min(ends, key=lambda end: end[0])
        return Frame({block.name: values[block.name] for block in self.body.blocks()}, cost)

    def shape(self, betas: Array, progress: Progress = quiet) -> Array:
        """The betas (B,) of some frames that differ, beginning with these."""
        chosen = self.chosen()
        frames = []
        for i, t in enumerate(chosen):
            progress("shape", i, len(chosen) + 1)
            frames.append(self.posed(t, self.starts(int(t), None), betas, self.widths).values)
        names = [block.name for block in self.body.blocks()]
        together = sequence([self.frame] * len(chosen), shared=(names[1],))
        start = {n: np.array([f[n] for f in frames]) for n in (names[0], names[2])}
        data = [self.data(int(t)) for t in chosen]
        start |= {n: np.array([d[n] for d in data]) for n in ("observed", "seen")}
        progress("shape", len(chosen), len(chosen) + 1)
        found = solved(QUICK, together, {**start, names[1]: betas})
        progress("shape", len(chosen) + 1, len(chosen) + 1)
        return np.asarray(found.values[names[1]])

    def chosen(self) -> Index:
        """The frames from which the shape is found."""
        M = self.observed.shape[1]
        some = np.linspace(0, M - 1, min(M, COMPARED)).round().astype(int)
        return spread_frames(self.observed[:, some], FRAMES)

    def poses(self, betas: Array, progress: Progress = quiet) -> Values:
        """The poses (T, K, 3) rad, trans (T, 3) m and betas (T, B) of all frames.

        The betas are those given but for each frame's own.
        """
        found: list[Frame] = []
        for t in range(len(self.observed)):
            before = found[-1] if found else None
            if before is None:
                own = self.posed(t, self.starts(t, None), betas, self.widths)
            else:
                own = self.posed(t, self.starts(t, before.values), betas, ())
                if own.cost > WORSE * before.cost:
                    again = self.posed(t, self.starts(t, None), betas, self.widths)
                    own = min(own, again, key=lambda frame: frame.cost)
            found.append(own)
            progress("poses", t + 1, len(self.observed))
        names = [block.name for block in self.body.blocks()]
        return {name: np.array([f.values[name] for f in found]) for name in names}


@dataclass(frozen=True, eq=False)
class Frame:
    """Pose, betas and trans of a frame, and their cost."""

    values: Values
    cost: float
