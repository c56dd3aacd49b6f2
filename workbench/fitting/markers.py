"""Fitting a body to markers of motion capture: pose in every frame, one shape, one set of offsets.

MoSh (Loper, Mahmood and Black, Motion and Shape Capture from Sparse Markers, 2014) estimates the
shape and the places of markers on the body from a few frames, and then the pose of every frame with
these held. Both are problems of the same blocks with other names free.

How far the centre of a ball lies above the skin to which it is glued is known: it is the radius of
the ball and the thickness of its foot. What is not known is where on the surface somebody put it,
so that its offset is uncertain along the surface and nearly known across it (section 3).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from workbench.arrays import Array, Mask
from workbench.blocks import Block, Values
from workbench.blocks.checks import above_zero, reals
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.doubts import of_markers
from workbench.fitting.marker_sets import MARKERS, MarkerSet
from workbench.fitting.observations import BadObservation
from workbench.fitting.placing import moved
from workbench.fitting.setup import Measure, Setup, largest_beta
from workbench.fitting.tracking import Tracker
from workbench.geometry.rigid import procrustes
from workbench.geometry.solids import vertex_normals
from workbench.problem import Problem, sequence
from workbench.residuals import Residual, gaussian, landmarks
from workbench.residuals.kernels import Kernel, quadratic
from workbench.solvers import SolveStage, Staged, TrustRegion
from workbench.solvers.solution import Solver

OFFSET_PRIOR = "offset prior"
DIRECTIONS = "along 1", "along 2", "across"  # the surface: the rows of a marker
SIGMA = 0.002  # m, of a marker's place beside that of the body: noise, and skin that slides
OFFSET_SIGMA = 0.0095 / np.sqrt(3)  # m along each axis: MoSh's 9.5 mm from the nominal place
POSE_WORTH = 0.5  # of a frame, for the pose prior: poses of one person in one clip are alike
FEWEST_MARKERS = 4  # markers that place a body
WIDE_SIGMAS = (0.1, 0.02)  # m, of markers, in turn, while a pose is sought: no arm is twisted
FRAME_ITERATIONS = 100  # of a frame by itself
STAGES = (("trans", "pose", "betas"),)  # before all that is free
TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "left_collar", "right_collar")


def offset_prior(
    body: SkinnedBody, marker_set: MarkerSet, sigma: float, across: float | None = None
) -> Residual:
    """Offsets (M, 3) m of a body that wears the markers, about their nominal places.

    `sigma` is the standard deviation along each axis in m; with `across`, it is that of the two
    directions along the surface, and `across` that of the height above it. The directions are those
    of the surface of the mean person at rest: its normal at the marker's vertex, and two
    perpendicular to it. A surface is curved: on a limb of radius R, a marker at the distance t from
    its vertex lies t^2 / 2R below the tangent plane in which the prior expects it, though its
    height above the skin is right; that is 0.3 mm for t = 5 mm and R = 4 cm. A coarse mesh and the
    shapes of other people add to it (`benchmarks/ACCURACY.md`). Raises BadArgument for standard
    deviations that are not above 0, and where heights are known for a marker on a vertex that
    belongs to no face.
    """
    known = {"offset_sigma": sigma} | ({} if across is None else {"across": across})
    above_zero("markers in m", **known)
    offsets = body.offsets(MARKERS).symbol
    if across is None:
        return gaussian(
            offsets, mean=marker_set.nominal, covariance=sigma**2, unit="m", name=OFFSET_PRIOR
        )
    turns = surface_frames(body, marker_set)
    rows = cs.sparsify(cs.DM(block_diag(*turns))) @ (
        cs.vec(offsets) - cs.DM(marker_set.nominal.ravel())
    )
    labels = tuple(f"{name}, {direction}" for name in marker_set.names for direction in DIRECTIONS)
    sigmas = np.tile([sigma, sigma, across], len(turns))
    return Residual(OFFSET_PRIOR, rows, sigmas, "m", labels=labels)


def surface_frames(body: SkinnedBody, marker_set: MarkerSet) -> Array:
    """(M, 3, 3): two directions along the surface of the mean person at rest, and its normal, as
    the rows of an orthonormal matrix for each marker.
    """
    normals = vertex_normals(body.template, body.faces)[marker_set.vertices]
    if (lost := np.linalg.norm(normals, axis=1) < 0.5).any():
        raise BadArgument(
            f"marker {marker_set.names[int(lost.argmax())]!r} is on a vertex that no face has, so "
            "that it has no height above a surface; leave `across` out, or put the marker elsewhere"
        )
    rows = np.linalg.svd(normals[:, None, :])[2]  # +-n first, and what is perpendicular to it
    return np.concatenate([rows[:, 1:], normals[:, None, :]], axis=1)


def marker_fit(
    markers: ArrayLike,
    body: SkinnedBody,
    marker_set: MarkerSet,
    question: str = "Which shape and poses of the body explain the markers?",
    *,
    sigma: float = SIGMA,
    offset_sigma: float = OFFSET_SIGMA,
    across: float | None = None,
    kernel: Kernel = quadratic,
    start: Values | None = None,
    free: Sequence[str] = ("trans", "pose", "betas", "offsets"),
) -> Setup:
    """Pose and trans of T frames, and the betas and offsets (M, 3) m that all of them share.

    `markers` are (T, M, 3) m in the order of the marker set, NaN where a marker was not seen.
    `sigma` and `offset_sigma` are in m, along each axis. Where the height of the markers above the
    skin is known, `across` is its standard deviation in m, and `offset_sigma` that along the skin
    (`offset_prior`). A kernel is of distances, such as
    `of_norms(scaled(geman_mcclure, 10))` where some are mislabelled. `start` replaces values of the
    start; without a trans in it, every frame is posed by itself (`frame_by_frame`). Blocks that
    are not in `free` are held at their start: with `("trans", "pose")`, shape and offsets are
    given. Solve the problem in the stages of `marker_solver`.

    Raises BadObservation for frames that show less than four markers, or a marker in no frame, and
    BadArgument as `offset_prior` does.
    """
    observed = checked_markers(markers, marker_set)
    known = np.isfinite(observed).all(axis=2).sum(axis=1)
    if (few := known < FEWEST_MARKERS).any():
        t = int(np.argmax(few))
        raise BadObservation(
            f"frame {t} shows {known[t]} of {observed.shape[1]} markers, and a body is placed by "
            f"{FEWEST_MARKERS} or more; leave such frames out"
        )
    dressed = marker_set.on(body)
    _, betas, trans = (block.name for block in dressed.blocks())
    frame, priors = marker_frame(dressed, marker_set, sigma, offset_sigma, kernel, free, across)
    first = dressed.start() | {"offsets": marker_set.nominal} | dict(start or {})
    if start is None or trans not in start:
        shares = tuple(sigma / wide for wide in WIDE_SIGMAS)
        first |= frame_by_frame(frame, dressed, observed, first, shares, every=1)
    return Setup(
        problem=sequence([frame] * len(observed), shared=(betas, "offsets")),
        start=first | observations(observed),
        question=question,
        measures=lambda values: marker_measures(dressed, observed, values),
        doubts=lambda values: of_markers(dressed, marker_set, observed, values),
        priors=priors,
    )


def marker_frame(
    body: SkinnedBody,
    marker_set: MarkerSet,
    sigma: float,
    offset_sigma: float,
    kernel: Kernel,
    free: Sequence[str],
    across: float | None = None,
) -> tuple[Problem, tuple[str, ...]]:
    """The problem of one frame, and the names of its priors; see `marker_fit`.

    The pose prior counts half. It was learned from many people, and what is peculiar to one person,
    such as how the feet are held, is the same in all frames and no independent evidence in each.
    Its fixed blocks are `observed` (M, 3) m and `seen` (M,), the weight of each marker.
    """
    names, offsets = marker_set.names, body.offsets(MARKERS)
    pose, betas, trans = (block.symbol for block in body.blocks())
    points = body.landmark_points(MARKERS, pose, betas, trans, offsets.symbol)
    place, seen = Block("observed", (len(names), 3), "m", names), Block("seen", (len(names),))
    data = landmarks(points, place.symbol, sigma=sigma, kernel=kernel, name=MARKERS)
    data = replace(data, weights=seen.symbol)
    priors = [pose_prior(body).weighed(POSE_WORTH)]
    if "betas" in free:
        priors.append(shape_prior(body))
    if "offsets" in free:
        priors.append(offset_prior(body, marker_set, offset_sigma, across))
    problem = Problem([data, *priors], free, blocks=(place, seen, offsets))
    return problem, tuple(prior.name for prior in priors)


def observations(observed: Array) -> Values:
    """The values of `observed` and `seen` for markers (..., M, 3) m, NaN where not seen."""
    known: Mask = np.asarray(np.isfinite(observed).all(axis=-1))
    return {"observed": np.where(known[..., None], observed, 0.0), "seen": known.astype(float)}


def frame_by_frame(
    frame: Problem,
    body: SkinnedBody,
    observed: Array,
    first: Values,
    shares: tuple[float, ...],
    every: int,
    progress: Callable[[int, int], object] = lambda done, of: None,
) -> Values:
    """The poses (T, K, 3) rad and trans (T, 3) m of T frames, each fitted by itself.

    Shape and offsets are held as in `first`. A frame by itself begins in the rest pose, and others
    in that of the frame before (`Tracker`), both placed by Procrustes' method. In one by itself,
    markers have `shares` of their precision 1 / sigma in turn, so that the pose prior leads at
    first; every `every`-th frame is one. `progress` is called with the number of frames that are
    done, and of all.
    """
    pose, _, trans = (block.name for block in body.blocks())

    def starts(t: int, before: Values | None) -> list[Values]:
        posed = first if before is None else {**first, pose: before[pose]}
        data = observations(observed[t])
        data["seen"] = data["seen"] * shares[-1] ** 2
        return [placed_rigidly(body, observed[t], posed) | data]

    stages = tuple(SolveStage(weights={MARKERS: (s / shares[-1]) ** 2}) for s in shares[:-1])
    solver = TrustRegion(max_iterations=FRAME_ITERATIONS)
    tracker = Tracker(frame.freeing(trans, pose), starts, stages, solver, solver, every)
    frames = tracker.frames(len(observed), progress)
    return {name: np.array([end[name] for end in frames if end]) for name in (pose, trans)}


def marker_solver(solver: Solver | None = None) -> Staged:
    """A solver in stages: poses and shape, and then the offsets as well."""
    return Staged(STAGES, solver or TrustRegion())


def checked_markers(markers: ArrayLike, marker_set: MarkerSet) -> Array:
    """Markers (T, M, 3) m as numbers. Raises BadArgument for another shape, and NotNumbers."""
    numbers, M = reals("markers", markers), len(marker_set.names)
    if numbers.ndim != 3 or numbers.shape[1:] != (M, 3) or not len(numbers):
        raise BadArgument(
            f"markers have the shape (T, {M}, 3), for T frames of the set's {M} markers in metres, "
            f"not {numbers.shape}"
        )
    return numbers


def placed_rigidly(body: SkinnedBody, observed: Array, first: Values) -> Values:
    """The values with the pelvis and trans that bring the markers nearest to observed (M, 3) m.

    It is Procrustes' method, for the markers of the trunk where four of them are seen.
    """
    pose, betas, _ = (block.name for block in body.blocks())
    posed = np.concatenate([np.zeros((1, 3)), first[pose][1:]])
    expected = body.landmark(MARKERS, posed, first[betas], offsets=first["offsets"])
    seen: Mask = np.asarray(np.isfinite(observed).all(axis=1))
    leader = np.asarray(body.landmarks[MARKERS].regressor @ body.weights).argmax(axis=1)
    trunk = seen & np.isin(np.array(body.joint_names)[leader], TRUNK)
    used = trunk if trunk.sum() >= FEWEST_MARKERS else seen
    motion = procrustes(expected[used], observed[used])
    return first | moved(body, motion.R, motion.t, posed, first[betas])


def marker_errors(body: SkinnedBody, observed: Array, values: Values) -> Array:
    """How far each marker is from its observed place, (T, M) m; NaN where it was not seen."""
    pose, betas, trans = (values[block.name] for block in body.blocks())
    fitted = body.landmark(MARKERS, pose, betas, trans, values["offsets"])
    return np.asarray(np.linalg.norm(fitted - observed, axis=2))


def rms_of_markers(errors: Array) -> Array:
    """The root mean square (M,) of the errors (T, M) of each marker; 0 for one never seen."""
    counts = np.isfinite(errors).sum(axis=0)
    return np.asarray(np.sqrt(np.nansum(errors**2, axis=0) / np.maximum(counts, 1)))


def marker_measures(body: SkinnedBody, observed: Array, values: Values) -> tuple[Measure, ...]:
    """The distance of markers, of all and of the three worst by name, and the size of betas."""
    off = 1e3 * marker_errors(body, observed, values)
    counts = np.isfinite(off).sum(axis=0)
    seen = f"{counts.sum()} of {off.size} places in {len(off)} frames"
    measures = [Measure("distance to markers, rms", float(np.sqrt(np.nanmean(off**2))), "mm", seen)]
    each = rms_of_markers(off)
    for m in np.argsort(-each, kind="stable")[:3]:
        name = body.landmark_names(MARKERS)[m]
        measures.append(
            Measure(f"distance to marker {name}, rms", float(each[m]), "mm", f"{counts[m]} frames")
        )
    return (*measures, largest_beta(values[body.blocks()[1].name]))
