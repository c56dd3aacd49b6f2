"""Where the fit of a video begins: frame by frame, some from scratch, the others from the last."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from workbench.blocks import Values
from workbench.bodies.body import Body
from workbench.fitting.keypoint_start import place_body
from workbench.fitting.observations import BadObservation
from workbench.fitting.setup import View
from workbench.problem import Problem
from workbench.solvers import Solver, SolveStage, Staged, Status, TrustRegion

COARSE = (0.345, 0.048)  # of a person's height in an image: the sigmas of the stages before
EVERY = 10  # frames between two that are fitted from scratch
FEWEST = 4  # keypoints that place a body
QUICK = TrustRegion(max_iterations=30, gradient_tolerance=1e-3)
ROUGHLY = TrustRegion(max_iterations=30, gradient_tolerance=1e-2)  # all frames are fitted again
Told = Callable[[int, int], object]  # called with the number of a frame and that of all frames


@dataclass(frozen=True, eq=False)
class FrameFits:
    """Fits of single frames.

    Attributes:
        frame: the problem of a frame.
        body: the body.
        sigmas: the standard deviations of the residuals of keypoints, by their names, as shares of
            the height of the person in the image.
        solver: what solves each stage of a fit from scratch.
        following: what solves a frame from the one before.
    """

    frame: Problem
    body: Body
    sigmas: Mapping[str, float]
    solver: TrustRegion = QUICK
    following: TrustRegion = ROUGHLY

    def from_scratch(self, values: Values, views: Sequence[View]) -> Values:
        """Placed in closed form, then in stages whose sigma falls to the last one."""
        seen = [view for view in views if (view.confidence > 0).sum() >= FEWEST]
        stages = tuple(
            SolveStage(weights={name: (own / wide) ** 2 for name, own in self.sigmas.items()})
            for wide in COARSE
        )
        start = values | place_body(self.body, seen, values)
        return self._solved(Staged(stages, self.solver), start)

    def from_there(self, values: Values) -> Values:
        """The last stage alone."""
        return self._solved(self.following, values)

    def _solved(self, solver: Solver, values: Values) -> Values:
        solution = solver.solve(self.frame, values)
        if solution.status is Status.STOPPED:
            raise KeyboardInterrupt  # the solver kept it for its own end
        return values | solution.values


def frame_by_frame(
    fits: FrameFits,
    values: Sequence[Values],
    views: Sequence[Sequence[View]],
    told: Told = lambda done, all_: None,
    every: int = EVERY,
) -> list[Values]:
    """The values of each frame. Frames without keypoints take those of the frame before.

    Every `every`-th frame is fitted from scratch and from the frame before it, and the answer of
    lower cost is taken; the others begin at the frame before. Raises BadObservation if no frame
    has enough keypoints to place the body.
    """
    own = [block.name for block in fits.body.blocks()]
    enough = [any((v.confidence > 0).sum() >= FEWEST for v in some) for some in views]
    if not any(enough):
        raise BadObservation(
            f"no frame shows {FEWEST} keypoints in one image, which a body needs to be placed"
        )
    found: list[Values | None] = [None] * len(values)
    last: Values | None = None
    scratch = 0
    for t, (given, some) in enumerate(zip(values, views, strict=True)):
        told(t, len(values))
        ends = []
        if not enough[t]:
            if last is not None:
                found[t] = {**given, **{name: last[name] for name in own}}
            continue
        if last is not None:
            ends.append(fits.from_there({**given, **{name: last[name] for name in own}}))
        if last is None or t >= scratch:
            ends.append(fits.from_scratch(given, some))
            scratch = t + every
        last = found[t] = min((end for end in ends if end), key=lambda end: _cost(fits, end))
    first = next(one for one in found if one is not None)
    return [
        {**given, **{name: (one or first)[name] for name in own}}
        for given, one in zip(values, found, strict=True)
    ]


def _cost(fits: FrameFits, values: Values) -> float:
    residual = fits.frame.residual(*fits.frame.split(values))
    return float(residual @ residual)
