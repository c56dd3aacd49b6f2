"""A body fitted to a scan that nobody labelled: many starts, from coarse to fine.

The way from an arm that is folded forwards to one that is folded backwards leads uphill. The cost
knows which of the two is right, so limbs begin again from poses that are usual (`unfolded`).
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Values
from workbench.blocks.checks import above_zero, from_zero
from workbench.bodies.body import Body
from workbench.errors import BadArgument
from workbench.fitting.body_priors import usual_priors
from workbench.fitting.scans.scan import Scan
from workbench.fitting.scans.surface import loose_points
from workbench.interrupts import Interrupts
from workbench.problem import Problem
from workbench.registration.from_a_camera import empty_space, seen_starts, sees
from workbench.registration.starts import limb_poses, scan_starts
from workbench.residuals import Residual
from workbench.residuals.contacts import Form, distance
from workbench.residuals.kernels import Kernel, geman_mcclure, scaled
from workbench.residuals.scans import scan_to_model
from workbench.solvers.solution import Hypothesis, Iterate, Solution, Solver
from workbench.solvers.trust_region import TrustRegion

MEASURED_OVER = 3  # iterations, over which a decrease is measured
DECREASES_LEFT = 5  # such decreases are what a run is expected to gain yet, at most
HOPELESS_FACTOR = 1.1  # times the cost that it must come down to: above this it is given up
SHORTEST_LIMB = 3  # joints
LEAST_GAIN = 0.01  # of the cost, by which another pose of a limb must be better
MOST_SWEEPS = 3  # through all limbs: several may be wrong
STARTS_IN_SWEEP = 12  # at most, of those that were compared as they stand
ITERATIONS, SETTLED = 12, 0.01  # of a run that tries another pose of a limb


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
            in case one is folded the wrong way (see `unfolded`).

    A point at the surface lowers the cost by (reach / sigma)^2 / 2, compared with one far from it:
    with a wide reach, a few points of clutter draw hidden limbs to them. So sigma shrinks with the
    reach on the way, and the last reach is three sigmas.
    """

    points: int
    sigma: float
    reach: float
    starts: int
    iterations: int
    settled: float = 0.01
    limbs: int = 0

    def __post_init__(self) -> None:
        several = {name: getattr(self, name) for name in ("points", "starts", "iterations")}
        above_zero("a stage", sigma=self.sigma, reach=self.reach, **several)
        from_zero("a stage", settled=self.settled, limbs=self.limbs)


def joints_of(body: Body, values: Values) -> Array:
    """The joints (K, 3) m of a body whose blocks have these values."""
    return body.joints(*(values[block.name] for block in body.blocks()))


@dataclass(frozen=True)
class FitProgress:
    """How far a fit has come; `stage` and `start` count from 1, `cost` is that of its iterate."""

    stage: int
    stages: int
    start: int
    starts: int
    iteration: int
    cost: float


@dataclass
class StageRuns:
    """The runs of one stage, until `progress` returns True or Ctrl-C is pressed.

    `stage` is its number and how many there are, `iterations` those of all runs together; `stopped`
    says why the runs were stopped, in a sentence, and `given_up` whether the last run was, so that
    its end is only a place on its way.
    """

    body: Body
    problem: Problem
    solver: Solver
    progress: Callable[[FitProgress], object] | None
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
        ends: Sequence[Array] = (),
        near: float = 0.0,
    ) -> Solution:
        """One run that begins at `start`, or at what was found from the start of this number.

        It ends after `most` iterations, when three of them together lower the cost by less than a
        share of it, or when the runs are stopped. It is given up when five times the decrease over
        the last three iterations would leave its cost more than a tenth above `enough`, and at an
        iterate after the first whose joints are within `near` m, in the mean, of one of the `ends`
        (K, 3) m that are known already.
        """
        costs: list[float] = []
        self.given_up = False
        first = FitProgress(*self.stage, number + 1, self.starts, 0, 0.0)

        def ends_here(iterate: Iterate) -> bool:
            costs.append(iterate.cost)
            now = replace(first, iteration=len(costs) - 1, cost=iterate.cost)
            if self.stopped or (self.progress is not None and self.progress(now) is True):
                self.stopped = "stopped"
            if self.stopped or now.iteration >= most:
                return True
            if ends and len(costs) > 1:
                joints = joints_of(self.body, iterate.values)
                distances = np.linalg.norm(np.array(ends) - joints, axis=-1).mean(axis=1)
                if distances.min() < near:
                    self.given_up = True
                    return True
            if len(costs) <= MEASURED_OVER + 1:
                return False
            gained = costs[-1 - MEASURED_OVER] - iterate.cost
            hopeless = iterate.cost - DECREASES_LEFT * gained > HOPELESS_FACTOR * enough
            settles = gained < settled * iterate.cost
            self.given_up = hopeless and not settles
            return settles or hopeless

        end = self.solver.solve(self.problem, start, callback=ends_here)
        self.iterations += len(end.trace) - 1
        if self.stopped or self.interrupted():
            self.stopped = end.message
        return end

    def hypotheses(
        self, starts: Sequence[Values], stage: FitStage, following: int, same: float
    ) -> list[Hypothesis]:
        """The different ends of runs from all starts, the lowest cost first.

        A run that will not come among the best `following`, or that comes to a known end, is given
        up; ends whose joints are less than `same` m apart are one.
        """
        solutions, hypotheses, known = list[Solution](), list[Hypothesis](), list[Array]()
        for k, start in enumerate(starts):
            enough = hypotheses[following - 1].cost if len(hypotheses) >= following else inf
            end = self.run(
                k, start, stage.iterations, stage.settled, enough, known, KNOWN_END * same
            )
            if not self.given_up:
                known.append(joints_of(self.body, end.values))
            solutions.append(end)
            hypotheses = _hypotheses(self.body, solutions, same)
            if self.stopped:
                break
        return hypotheses


SAME = 0.02  # m, mean distance of joints: two ends that are nearer are one hypothesis
KNOWN_END = 0.375  # times that: a run that comes so near to an end leads to it
FULL_QUANTILE = 0.95  # the quantile of the areas from which on all points count fully
SCREEN = FitStage(300, 0.03, 0.06, 1, 1)  # with which poses of limbs are compared as they stand
WITHIN = 0.4  # m: a point farther from the surface has no contact


FIT_STAGES = (
    FitStage(300, 0.05, 0.10, 24, 30, 0.004),
    FitStage(800, 0.02, 0.05, 8, 40, 0.002, limbs=1),
    FitStage(3000, 0.005, 0.015, 3, 60, 0.0005),
)
SEEN_STAGES = (
    FitStage(300, 0.05, 0.10, 16, 20, 0.01),
    FitStage(800, 0.02, 0.05, 5, 40, 0.003, limbs=1),
    FitStage(3000, 0.005, 0.015, 3, 60, 0.0005),
)
"""For a scan whose camera is known: better starts, of which fewer are run, and shorter."""


@dataclass(frozen=True, eq=False)
class ModelFit:
    """A body on a scan, and what else might be there.

    Attributes:
        body: the body.
        scan: the points that were fitted.
        problem: the problem of the last stage.
        priors: the names of its residuals that are priors.
        reach: in m, where bad points begin in it.
        hypotheses: the ends of the last stage that differ, the lowest cost first. `starts` are
            their numbers among the ends of the stage before.
        iterations: of all runs together.
        seconds: the time of all runs, in s.
        stopped: why the fit ended early, in a sentence; empty if it did not.
        way: the start that led to the best hypothesis, and where each stage ended on the way there.
    """

    body: Body
    scan: Scan
    problem: Problem
    priors: tuple[str, ...]
    reach: float
    hypotheses: tuple[Hypothesis, ...]
    iterations: int
    seconds: float
    stopped: str = ""
    way: tuple[Values, ...] = ()

    @property
    def values(self) -> Values:
        """Pose, betas and trans of the best hypothesis."""
        return self.hypotheses[0].values

    @property
    def cost(self) -> float:
        """The cost of the best hypothesis."""
        return self.hypotheses[0].cost

    def vertices(self, hypothesis: int = 0) -> Array:
        """The surface (N, 3) m of a hypothesis."""
        values = self.hypotheses[hypothesis].values
        return self.body.vertices(*(values[block.name] for block in self.body.blocks()))


def fit_model(
    body: Body,
    scan: Scan,
    *,
    keep: Mask | None = None,
    camera: ArrayLike | None = None,
    starts: Callable[[Body, Scan], Sequence[Values]] = scan_starts,
    stages: Sequence[FitStage] = FIT_STAGES,
    kernel: Kernel = geman_mcclure,
    form: Form = distance,
    within: float = WITHIN,
    same: float = SAME,
    priors: Sequence[Residual] | None = None,
    others: Sequence[Residual] = (),
    solver: Solver = TrustRegion(gradient_tolerance=1e-4),  # noqa: B008 - it is immutable
    seed: int = 0,
    progress: Callable[[FitProgress], object] | None = None,
) -> ModelFit:
    """Find pose, betas and trans of a body from a scan alone; y is up, lengths are in m.

    Every stage minimises the robust distances of some points of the scan to the surface, each
    weighted by its area, and the priors, `usual_priors` unless others are given. Normals of the
    scan must point outwards: a point is compared only with surface that faces its way, and at most
    `within` m away. `keep` (M,) leaves out points, such as those at the boundary of a scan.
    `others` are further residuals in the symbols of `body.blocks()`, such as landmarks.

    The first stage begins at all `starts`; each following one at the best different ends of the
    one before, whose joints are `same` m apart or more in the mean. A run that will not come among
    them, or that comes to an end that was found before, is given up.

    `camera` (3,) m is where the whole scan was taken from, if that was one place. Then the body is
    kept out of the space that was seen to be empty (see `residuals.free_space`), the first stage
    begins at `seen_starts`, and loose points are left out, because a limb that was not seen would
    be drawn to them. Points that `keep` leaves out count as seen. `SEEN_STAGES` suit this.

    `progress` is told of every iterate, and stops the fit by returning True; Ctrl-C does so too.
    Either way, what was found is returned.

    Raises BadScan for a scan that cannot be of a person, BadArgument for no stages, no starts, or
    a camera that stands among the points.
    """
    if not stages:
        raise BadArgument("a fit has at least one stage, such as those of FIT_STAGES")
    if camera is not None:
        firm = ~loose_points(scan)
        scan, keep = scan.some(firm), None if keep is None else keep[firm]
    seen = scan if keep is None else scan.some(keep)
    ends: list[Values] = [dict(start) for start in starts(body, seen)]
    if not ends:
        raise BadArgument("there is no start; `scan_starts` makes some")
    began = time.perf_counter()
    if camera is not None:
        if not sees(camera, seen.points):
            raise BadArgument(
                f"a camera at {np.asarray(camera).tolist()} m stands among the points, which it "
                "cannot have seen from there; leave `camera` out, or give its place"
            )
        ends = list(seen_starts(body, seen, np.asarray(camera), ends, stages[0].starts))
    order = np.random.default_rng(seed).permutation(seen.n_points)
    prior_terms = usual_priors(body) if priors is None else tuple(priors)
    names = tuple(block.name for block in body.blocks())

    def problem_of(stage: FitStage) -> Problem:
        rows = order[: stage.points]
        data = _scan_term(body, seen, rows, stage, kernel, form, within)
        free = () if camera is None else (empty_space(body, scan, camera, stage.sigma),)
        return Problem((data, *prior_terms, *others, *free), names)

    first, levels, iterations = ends, list[list[Hypothesis]](), 0
    with Interrupts() as interrupts:
        for number, stage in enumerate(stages, start=1):
            problem, ends = problem_of(stage), ends[: stage.starts]
            place = (number, len(stages))
            runs = StageRuns(
                body, problem, solver, progress, lambda: interrupts.pressed, place, len(ends)
            )
            following = stages[number].starts if number < len(stages) else 1
            hypotheses = runs.hypotheses(ends, stage, following, same)
            if stage.limbs and not runs.stopped:
                screen = problem_of(SCREEN)
                for k, hypothesis in enumerate(hypotheses[: stage.limbs]):
                    hypotheses[k] = unfolded(runs, screen, hypothesis, KNOWN_END * same)
                hypotheses.sort(key=lambda hypothesis: hypothesis.cost)
            iterations += runs.iterations
            ends = [hypothesis.values for hypothesis in hypotheses]
            levels.append(hypotheses)
            if runs.stopped:
                break
    return ModelFit(
        body,
        seen,
        problem,
        tuple(prior.name for prior in prior_terms),
        stage.reach,
        tuple(hypotheses),
        iterations,
        time.perf_counter() - began,
        runs.stopped,
        _path_to_best(first, levels),
    )


def _path_to_best(
    starts: Sequence[Values], levels: Sequence[Sequence[Hypothesis]]
) -> tuple[Values, ...]:
    """From a start to the best hypothesis of the last level, through one of each level before.

    The starts of a hypothesis are numbers of the hypotheses of the level before.
    """
    k, path = 0, []
    for level in reversed(levels):
        path.append(level[k].values)
        k = level[k].starts[0]
    return tuple(reversed([*path, starts[k]]))


def _scan_term(
    body: Body, scan: Scan, rows: Index, stage: FitStage, kernel: Kernel, form: Form, within: float
) -> Residual:
    """The robust distances of some points of the scan to the body."""
    weights = None
    if scan.weights is not None:
        areas = scan.weights[rows]
        full = float(np.quantile(areas, FULL_QUANTILE)) or float(areas.max())
        weights = np.minimum(areas / full, 1.0) if full > 0 else None
    return scan_to_model(
        body.points(*(block.symbol for block in body.blocks())),
        body.faces,
        scan.points[rows],
        sigma=stage.sigma,
        kernel=scaled(kernel, stage.reach / stage.sigma),
        weights=weights,
        normals=None if scan.normals is None else scan.normals[rows],
        within=within,
        form=form,
        name="scan",
    )


def _hypotheses(body: Body, solutions: Sequence[Solution], same: float) -> list[Hypothesis]:
    """The ends as hypotheses, the lowest first; ends with joints in the same places are one."""
    kept: list[Hypothesis] = []
    placed: list[Array] = []
    for number in sorted(range(len(solutions)), key=lambda k: solutions[k].cost):
        end = solutions[number]
        joints = joints_of(body, end.values)
        distances = [float(np.linalg.norm(joints - known, axis=1).mean()) for known in placed]
        same_end = next((i for i, d in enumerate(distances) if d < same), None)
        if same_end is None:
            kept.append(Hypothesis(end.values, end.cost, end.status, (number,), end.violation))
            placed.append(joints)
        else:
            kept[same_end] = replace(kept[same_end], starts=(*kept[same_end].starts, number))
    return kept


def unfolded(runs: StageRuns, screen: Problem, hypothesis: Hypothesis, near: float) -> Hypothesis:
    """The hypothesis, or a lower one in which one or more limbs have other poses.

    Each limb is put to each of `limb_poses` in turn, and a run begins at the 12 of these whose cost
    is lowest as they stand in `screen`, a coarser problem. A run that comes within `near` m of the
    lowest end so far, in the mean of the joints, is given up. The lowest of their ends is taken if
    its cost is lower by more than 1 %; then all limbs are tried again from there.
    """
    body = runs.body
    pose, poses = body.blocks()[0].name, limb_poses(body)
    lowest: list[Solution] = []

    def solve(start: Values) -> Solution:
        ends = [joints_of(body, end.values) for end in lowest]
        end = runs.run(hypothesis.starts[0], start, ITERATIONS, SETTLED, ends=ends, near=near)
        lowest[:] = [min([*lowest, end], key=lambda end: end.cost)]
        return end

    def cost(values: Values) -> float:
        rows = screen.residual(*screen.split(values))
        return float(rows @ rows) / 2

    first = best = solve(hypothesis.values)
    for _ in range(MOST_SWEEPS):
        values = {**hypothesis.values, **best.values}
        starts = [
            {**values, pose: with_limb(values[pose], limb, other)}
            for limb in limbs(body.parents)
            for other in poses
        ]
        ends = [solve(start) for start in sorted(starts, key=cost)[:STARTS_IN_SWEEP]]
        end = min(ends, key=lambda end: end.cost, default=best)
        if end.cost >= (1 - LEAST_GAIN) * best.cost:
            break
        best = end
    if best is first:
        return hypothesis
    return Hypothesis(best.values, best.cost, best.status, hypothesis.starts, best.violation)


def limbs(parents: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """The joints of every unbranched end of a tree that has three joints or more.

    For SMPL's tree these are the arms from the collar, from the shoulder and from the elbow on, and
    the legs from the hip and from the knee on; for a hand they are the fingers.
    """
    below: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            below[parent].append(joint)
    ends = []
    for first in range(1, len(parents)):
        limb = [first]
        while len(below[limb[-1]]) == 1:
            limb += below[limb[-1]]
        if not below[limb[-1]] and len(limb) >= SHORTEST_LIMB:
            ends.append(tuple(limb))
    return tuple(ends)


def with_limb(pose: Array, limb: Sequence[int], other: Array) -> Array:
    """The pose (K, 3) rad with the joints of a limb as in `other` (K - 1, 3), without the root."""
    moved, joints = np.array(pose), np.array(limb)
    moved[joints] = other[joints - 1]
    return moved
