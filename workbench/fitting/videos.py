"""Fitting a body to the keypoints of a clip: one problem of all frames, which share the shape.

The likeliest motion and the expected one differ, as in single images (`sampling.posterior_mean`).
Draws of all frames at once would take minutes. Each frame counts n / T times in a video
(`effective_frames`), and smoothness lets about T / n frames tell of one pose, so that a pose is
taken to be as uncertain as one frame by itself leaves it, given the shape. The mean of that
posterior is found in a few frames, and its difference from the likeliest pose and place, which
changes slowly, is interpolated and smoothed.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter1d

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.blocks.checks import reals
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.keypoints import (
    COUNTED,
    LEAST_CONFIDENCE,
    camera_residual,
    camera_values,
    focal_prior,
    height_in_view,
    landmark_set,
    usual_sigma,
)
from workbench.fitting.observations import FEWEST_PLACING, BadObservation, Clip, Film
from workbench.fitting.placing import place_body
from workbench.fitting.setup import Measure, Moving, Setup, View, largest_beta
from workbench.fitting.tracking import Tracker
from workbench.geometry.camera import Camera
from workbench.problem import Problem, sequence
from workbench.residuals import Residual, smooth
from workbench.residuals.kernels import Kernel, geman_mcclure, scaled
from workbench.residuals.sequences import Between, Frames
from workbench.sampling.posterior_mean import posterior_mean
from workbench.solvers import SolveStage, TrustRegion

COARSE_SIGMAS = (0.345, 0.048)  # of a person's height in an image: the sigmas of the stages before
FROM_SCRATCH_EVERY = 10  # frames between two that are fitted from scratch
# of frames by themselves, and of those that follow; all frames are fitted again
QUICK_SOLVER = TrustRegion(max_iterations=30, gradient_tolerance=1e-3)
ROUGH_SOLVER = TrustRegion(max_iterations=30, gradient_tolerance=1e-2)
OUTLIER_SHARE = 0.12  # of a person's height: 100 px at 830, as in SMPLify (Bogo et al., 2016)
FRAMES_FOR_HEIGHT = 9
POSE_SIGMA, PLACE_SIGMA = 36.0, 11.0  # rad/s^2 and m/s^2, of all joints and axes together
EVIDENCE = "evidence"  # the fixed block that says how often each frame counts
DRAW_INTERVAL = 1 / 12  # s, between frames of which the posterior is drawn
BLUR_SD = 0.1  # s, of the Gaussian that smooths between them


def effective_frames(errors: ArrayLike, known: ArrayLike | None = None) -> float:
    """The number of independent frames whose mean error is as uncertain as that of these T frames.

    Errors of a detector are alike from frame to frame: a constant part, such as a hip that is
    always found too far out, and noise that changes slowly. If x_t has the autocorrelation r_k
    about zero, the mean of T frames has the variance of the mean of

        n = T / (1 + 2 sum over k of (1 - k / T) r_k)

    independent ones (Geyer, Practical Markov chain Monte Carlo, 1992). With the sums of x_t x_{t+k}
    of all pairs of frames for r_k this is mean(x^2) / mean(x)^2, so that no lag has to be cut off.
    The squares are summed over all series, one for each coordinate of each landmark, before they
    are divided. White noise has n = T, a constant n = 1, and noise with x_t = rho x_{t-1} + e_t
    T (1 - rho) / (1 + rho) for large T.

    `errors` (T, ...) are differences that a fit left, in sigmas, one series for each entry of a
    frame; `known` of the same shape is False where nothing was observed. Errors that the fit took
    over into the shape or the pose are not among them, so that n is an estimate from above.
    The result is between 1 and T. Raises BadObservation if no series has two known frames, or if
    a known error is not finite.
    """
    x = reals("the errors of a video", errors)
    observed = np.ones(x.shape, dtype=bool) if known is None else np.asarray(known, dtype=bool)
    if x.ndim == 0 or observed.shape != x.shape:
        raise BadObservation(
            f"errors are (T, ...) and `known` has the same shape, not {x.shape} and "
            f"{observed.shape}"
        )
    x = np.where(observed, x, 0.0).reshape(len(x), -1)
    count = observed.reshape(x.shape).sum(axis=0)
    used = count > 1
    if not np.isfinite(x).all() or not used.any():
        raise BadObservation(
            "the errors of a video are finite where something was observed, and some landmark was "
            "observed in two frames or more"
        )
    return worth_of_errors(x[:, used], count[used])


def worth_of_errors(x: Array, count: Array) -> float:
    """n of errors (T, M), zero where not known; `count` (M,) says how often each is known."""
    squares, sums = np.sum(x**2), np.sum(x.sum(axis=0) ** 2 / count)
    return float(np.clip(squares / sums if sums > 0 else np.inf, 1, len(x)))


@dataclass(frozen=True)
class Smoothness:
    """What is expected of a motion, in seconds, whatever the number of frames; None for nothing.

    Attributes:
        pose: the standard deviation of joints' acceleration in rad/s^2.
        place: that of trans, in m/s^2.
    """

    pose: float | None = POSE_SIGMA
    place: float | None = PLACE_SIGMA


SMOOTH = Smoothness()


def video_fit(
    clip: Clip,
    body: SkinnedBody | TriangleBody,
    question: str,
    *,
    sigma: float | None = None,
    kernel: Kernel | None = None,
    smoothness: Smoothness = SMOOTH,
    shared: Sequence[str] = ("betas",),
    worth: float | None = None,
    told: Callable[[int, int], object] = lambda done, all_: None,
) -> Setup:
    """Poses and places in T frames, and one shape, from the keypoints of one or several cameras.

    `sigma` is in px; without one, it follows the person's height in each film (`usual_sigma`).
    The kernel is Geman and McClure's, with outliers from 12 % of the height on, unless another is
    given. Cameras without K share a free focal length. Blocks of the body named in `shared` are one
    for all frames. The start is found frame by frame, and `told` is called with the number of
    frames that are done and of all.

    A detector's errors are alike from frame to frame, so that T frames are not T times the evidence
    on the shape. All terms of frames, data, priors and smoothness, have the weight n / T of the
    fixed block `evidence`, where n is what the frames are worth together: `worth`, or else
    `effective_frames` of the errors at the start. Terms of what is shared have the weight 1. So the
    likeliest poses given the shape stay what they are, and the shape is found, and its uncertainty
    told, as from n frames. The uncertainty of a single pose is that of one frame only if smoothness
    joins about T / n frames; with less, it is overstated (lecture 17).

    Raises BadArgument for a worth outside of 1 to T, BadObservation if the keypoints cannot place
    the body in any frame, and what Setup raises.
    """
    T = clip.count
    if worth is not None and not 1 <= worth <= T:
        raise BadArgument(f"{T} frames are worth 1 to {T} independent ones, not {worth:g}")
    kind = landmark_set(body, clip.names)
    evidence = Block(EVIDENCE, (1,))
    terms = _film_terms(clip, body, kind, evidence, sigma, kernel)
    frame = _frame_problem(body, terms, evidence, shared)
    common: Values = {EVIDENCE: np.ones(1)}
    for term in terms:
        first = int(np.argmax((term.film.confidence > 0).any(axis=1)))
        common |= camera_values(term.camera, term.film.photograph(first))
    frames = _frame_by_frame(frame, body, terms, kind, common, told)
    of_cameras = [block.name for term in terms for block in term.camera.blocks]
    names = [*of_cameras, EVIDENCE, *shared]
    problem = sequence(
        [frame] * T, shared=names, between=_between(smoothness, body, evidence, clip)
    )
    start = {name: np.array([values[name] for values in frames]) for name in problem.known}
    start |= {name: np.median(start[name], axis=0) for name in start if name in names}
    data_names = tuple(term.residual.name for term in terms)
    if worth is None:
        worth = worth_of(problem, start, data_names) if T > 1 else 1.0
    start[EVIDENCE] = np.array([worth / T])
    whole = tuple(_view(term.film, term.camera, kind) for term in terms)
    moving = Moving(body, whole, clip.fps, data_names, frame)
    gaps = clip.gaps
    missing = f"In {len(gaps)} of {T} frames no keypoint was observed; smoothness alone fills them"
    return Setup(
        problem=problem,
        start=start,
        question=question,
        measures=lambda values: video_measures(moving, values),
        priors=tuple(r.name for r in problem.residuals if r.name not in data_names),
        notes=(
            *clip.notes,
            *([missing] if gaps else []),
            f"The {T} frames count as {worth:.1f} independent ones for what they share",
        ),
        moving=moving,
    )


@dataclass(frozen=True, eq=False)
class _FilmTerm:
    """A film in the problem of a frame: the residual of its keypoints, the blocks of what it
    observed, and sigma as a share of the person's height.
    """

    film: Film
    camera: Camera
    residual: Residual
    observed: tuple[Block, Block]
    share: float

    def values(self, frame: int) -> Values:
        """What the film shows in one frame."""
        pixels, confidence = (block.name for block in self.observed)
        return {pixels: self.film.pixels[frame], confidence: self.film.confidence[frame]}


def _film_terms(
    clip: Clip,
    body: SkinnedBody | TriangleBody,
    kind: str,
    evidence: Block,
    sigma: float | None,
    kernel: Kernel | None,
) -> list[_FilmTerm]:
    """The residuals of a clip's films, which count as often as the block `evidence` says."""
    landmarks = body.landmark_names(kind)
    points = body.landmark_points(kind, *(block.symbol for block in body.blocks()))
    order = [clip.names.index(name) if name in clip.names else -1 for name in landmarks]
    films = [film.ordered(order) for film in clip.films]
    terms = []
    for film, height in zip(films, heights_of(films, body, kind), strict=True):
        camera = Camera(film.name + "/")
        own_sigma = usual_sigma(height, film.size) if sigma is None else sigma
        own_kernel = kernel or scaled(geman_mcclure, OUTLIER_SHARE * height / own_sigma)
        residual, blocks = camera_residual(points, camera, landmarks, own_sigma, own_kernel)
        residual = replace(residual, weights=residual.weights * evidence.symbol)
        terms.append(_FilmTerm(film, camera, residual, blocks, own_sigma / height))
    return terms


def _frame_problem(
    body: SkinnedBody | TriangleBody,
    terms: Sequence[_FilmTerm],
    evidence: Block,
    shared: Sequence[str],
) -> Problem:
    """The problem of one frame; priors of what is not shared count as often as its data."""
    betas = body.blocks()[1]
    of_pose, of_shape = pose_prior(body), shape_prior(body)
    of_pose = replace(of_pose, weights=evidence.symbol)
    if betas.name not in shared:
        of_shape = replace(of_shape, weights=evidence.symbol)
    unknown = [term for term in terms if term.film.K is None]
    focal_priors = [focal_prior(term.camera, max(term.film.size)) for term in unknown]
    return Problem(
        [*(term.residual for term in terms), of_pose, of_shape, *focal_priors],
        [block.name for block in (*body.blocks(), *(term.camera.focal for term in unknown))],
        blocks=[*(block for term in terms for block in term.camera.blocks), evidence],
    )


def _view(film: Film, camera: Camera, kind: str, frame: int | slice = slice(None)) -> View:
    """What a camera observed in one frame, or in all of them."""
    pixels, confidence = film.pixels[frame], film.confidence[frame]
    return View(film.name, camera, film.size, kind, pixels, confidence)


def _frame_by_frame(
    frame: Problem,
    body: Body,
    terms: Sequence[_FilmTerm],
    kind: str,
    common: Values,
    progress: Callable[[int, int], object],
) -> list[Values]:
    """The values of each frame; those without enough keypoints are as the last one with them.

    `common` are values of all frames, such as focal lengths, which are held here. A frame by itself
    is placed in closed form, and fitted in stages whose sigma falls to the last one. Raises
    BadObservation if no frame has enough keypoints to place the body.
    """
    own = [block.name for block in body.blocks()]
    T = len(terms[0].film.confidence)

    def observed(t: int) -> Values:
        values = body.start() | common
        for term in terms:
            values |= term.values(t)
        return values

    def starts(t: int, before: Values | None) -> list[Values]:
        views = [_view(term.film, term.camera, kind, t) for term in terms]
        views = [view for view in views if (view.confidence > 0).sum() >= FEWEST_PLACING]
        if not views:
            return []
        values = observed(t)
        if before is None:
            return [values | place_body(body, views, values)]
        return [values | {name: before[name] for name in own}]

    stages = tuple(
        SolveStage(weights={term.residual.name: (term.share / wide) ** 2 for term in terms})
        for wide in COARSE_SIGMAS
    )
    frame = frame.freeing(*own)
    tracker = Tracker(frame, starts, stages, QUICK_SOLVER, ROUGH_SOLVER, FROM_SCRATCH_EVERY)
    ends = tracker.frames(T, progress)
    last = next((end for end in ends if end), None)
    if last is None:
        raise BadObservation(
            f"no frame shows {FEWEST_PLACING} keypoints in one image, which a body needs to be "
            "placed"
        )
    whole = []
    for t, end in enumerate(ends):
        last = end or last
        whole.append(observed(t) | {name: last[name] for name in own})
    return whole


def heights_of(films: Sequence[Film], body: Body, kind: str) -> list[float]:
    """How high the person is in each film in px: the median over some frames."""
    T = len(films[0].confidence)
    heights: list[list[float]] = [[] for _ in films]
    for t in np.unique(np.linspace(0, T - 1, min(T, FRAMES_FOR_HEIGHT)).round().astype(int)):
        values, views = body.start(), []
        for i, film in enumerate(films):
            if (film.confidence[t] > 0).sum() < FEWEST_PLACING:
                continue
            camera = Camera(film.name + "/")
            values |= camera_values(camera, film.photograph(t))
            views.append((i, _view(film, camera, kind, t)))
        with suppress(BadObservation, np.linalg.LinAlgError):
            values |= place_body(body, [view for _, view in views], values)
            for i, view in views:
                heights[i].append(height_in_view(body, view, values))
    known = [float(np.median(some)) for some in heights if some]
    usual = float(np.median(known)) if known else 0.5 * min(films[0].size)
    return [max(1.0, float(np.median(some))) if some else usual for some in heights]


def errors_of(problem: Problem, values: Values, data: Sequence[str]) -> tuple[Array, Array]:
    """Differences at `values` that count, (T, ...) in sigmas, shrunk by the kernel and weighted by
    confidence, and which of them were observed.
    """
    whole = {EVIDENCE: np.ones(1)} if EVIDENCE in problem.known else {}
    residual = problem.residual(*problem.split({**values, **whole}))
    columns = []
    for name in data:
        rows = problem.rows[name]
        frames = len(next(term for term in problem.residuals if term.name == name).by_frame)
        columns.append(residual[rows].reshape(frames, -1))
    errors = np.concatenate(columns, axis=1)
    return errors, errors != 0


def worth_of(problem: Problem, values: Values, data: Sequence[str]) -> float:
    """What the frames are worth together, by `effective_frames` of their errors at `values`."""
    return effective_frames(*errors_of(problem, values, data))


def landmarks_of(moving: Moving, values: Values) -> Array:
    """The landmarks of the body in every frame, (T, M, 3) m."""
    numbers = (values[block.name] for block in moving.body.blocks())
    return np.asarray(moving.body.landmark(moving.views[0].landmarks, *numbers))


def video_measures(moving: Moving, values: Values) -> tuple[Measure, ...]:
    """Mean reprojection errors, the acceleration of landmarks, stature, and how many independent
    frames the fit counted.
    """
    places = landmarks_of(moving, values)
    measures = []
    for view in moving.views:
        off = np.linalg.norm(view.camera.pixels(places, values) - view.observed, axis=-1)
        well = view.confidence > LEAST_CONFIDENCE
        mean = float(off[well].mean()) if well.any() else np.nan
        measures.append(
            Measure(f"reprojection, {view.name}", mean, "px", f"{well.sum()} {COUNTED}")
        )
    betas = values[moving.body.blocks()[1].name]
    if betas.ndim == 1:
        tall = np.ptp(moving.body.vertices(betas=betas)[:, 1])
        measures.append(Measure("height at rest", 1e3 * float(tall), "mm"))
    if len(places) > 2:
        change = np.linalg.norm(np.diff(places, 2, axis=0), axis=-1)
        measures.append(Measure("change of speed a frame", 1e3 * float(change.mean()), "mm"))
    if len(places) > 1:
        worth = float(values[EVIDENCE][0]) * len(places)
        measures.append(Measure("independent frames", worth, "1", f"{len(places)} frames"))
    return (*measures, largest_beta(betas))


def _between(smoothness: Smoothness, body: Body, evidence: Block, clip: Clip) -> list[Between]:
    """The residuals between frames, with the weight of the frames."""
    order = min(2, clip.count - 1)  # of two frames, the speed
    if order < 1:
        return []
    pose, _, trans = (block.name for block in body.blocks())
    links = (pose, smoothness.pose, "smooth pose"), (trans, smoothness.place, "smooth place")

    def weighted(link: Between, frames: Frames) -> Residual:
        residual = link(frames)
        return replace(residual, weights=evidence.symbol, blocks=(*residual.blocks, evidence))

    return [
        partial(weighted, smooth(what, sigma=sigma / clip.fps**order, order=order, name=name))
        for what, sigma, name in links
        if sigma is not None
    ]


def video_mean(
    setup: Setup,
    values: Values,
    *,
    told: Callable[[int, int], object] = lambda done, all_: None,
) -> Values:
    """The expected pose and trans in every frame, given the shape; other blocks as they are.

    `setup` is one of `video_fit`, and `values` are its solution. `told` is called with the number
    of frames that have been drawn, and of all that will be. Frames with less than four keypoints in
    every image are not drawn, because they do not place a body. Raises BadArgument for a setup
    without frames.
    """
    moving = setup.moving
    if moving is None or moving.frame is None:
        raise BadArgument("this setup is not that of a video; give one that `video_fit` made")
    pose, _, trans = (block.name for block in moving.body.blocks())
    own = moving.frame.freeing(trans, pose)
    framed = {name for name, block in setup.problem.known.items() if block.framed}
    counts = [(view.confidence > 0).sum(axis=1) for view in moving.views]
    seen = np.flatnonzero(np.max(counts, axis=0) >= FEWEST_PLACING)
    step = max(1, round(DRAW_INTERVAL * moving.fps))
    drawn = np.unique(np.append(seen[::step], seen[-1]))
    moved: dict[str, list[np.ndarray]] = {pose: [], trans: []}
    T = len(values[trans])
    for done, t in enumerate(drawn):
        here = {n: values[n][t] if n in framed else values[n] for n in own.known}
        mean = posterior_mean(own, here | {EVIDENCE: np.ones(1)}, seed=int(t)).values
        for name, differences in moved.items():
            differences.append(mean[name] - here[name])
        told(done + 1, len(drawn))
    means = dict(values)
    times = np.arange(T)
    for name, differences in moved.items():
        each = np.reshape(differences, (len(drawn), -1)).T
        whole = np.stack([np.interp(times, drawn, series) for series in each], axis=1)
        whole = gaussian_filter1d(whole, BLUR_SD * moving.fps, axis=0, mode="nearest")
        means[name] = values[name] + whole.reshape(values[name].shape)
    return means
