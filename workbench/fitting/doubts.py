"""Whether a fit may be believed, judged without the truth: the doubts of every kind of fit.

A doubt is a sentence: what was seen, what it probably means, and what to do. None of them says that
a fit is wrong; they name what a converged solver does not look at. Scans are judged by
`registration.doubts`, in sentences of the same form. The thresholds are judgements, tuned on other
seeds and frames than those on which they were counted.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.errors import some_of
from workbench.fitting.body_priors import POSE_PRIOR, n_of_shape, pose_gaussian, stature
from workbench.fitting.conventions import (
    LARGEST_DISAGREEMENT,
    agreeing_convention,
    better_reading,
    disagreement,
    unit_of_translations,
)
from workbench.fitting.images import depth_interval
from workbench.fitting.keypoints import LEAST_CONFIDENCE
from workbench.fitting.marker_sets import MARKERS, MarkerSet
from workbench.fitting.setup import Setup, View
from workbench.geometry.rigid import procrustes
from workbench.solvers import Solution, Status

LARGEST_FRACTION = 1.5  # px: keypoints that all lie within are fractions of the image
LARGEST_CENTRE_OFFSET = 0.2  # of the image: a principal point that is farther from its middle
MISSED_KEYPOINT = 0.05  # m at the person's distance: a keypoint that is farther away is missed
MOST_MISSED_SHARE = 0.25  # of the keypoints
OUTLIER_DISTANCE = 0.15  # m: a keypoint that is farther away counts as an outlier
LIMBS = {
    f"{side} {limb}": tuple(f"{side}_{joint}" for joint in joints)
    for side in ("left", "right")
    for limb, joints in (("arm", ("elbow", "wrist")), ("leg", ("knee", "ankle")))
}
LARGEST_SHAPE_SQUARE = 3.0  # mean square of betas, which is 1 for shapes drawn from the prior
LARGEST_BETA = 3.5  # standard deviations
LARGEST_POSE_SQUARE = 2.0  # mean square of the pose in standard deviations of its prior
STATURES = 1.2, 2.2  # m
DISTANCES = 0.5, 60.0  # m, from the camera
FAR_OFF = 5.0  # sigmas, root mean square: above, a residual does not explain its data
WELL_MET = 0.3  # sigmas, root mean square: data that are met so well count less than they seem to
UNLIKELY_BY_PRIOR = 1.5  # sigmas, root mean square of a prior's rows, beside data that are met
MISSED_VERTEX = 0.03  # m, of the median vertex of a mesh
OTHER_SIZE_RATIO = 2.0  # times the size of the body
PERSON_RATIO = 1.5  # the factor by which a person may differ from the mean one
UNIT_MISTAKES = {  # what was taken for what, by the factor between them
    1e3: "mm were taken for m",
    1e2: "cm were taken for m",
    10.0: "mm were taken for cm",
    1 / 0.0254: "inches were taken for m",
    2.54: "cm were taken for inches",
    1 / 2.54: "inches were taken for cm",
    0.1: "cm were taken for mm",
    1e-2: "m were taken for cm",
    1e-3: "m were taken for mm",
}
TORSO = ("pelvis", "spine1", "spine2", "spine3", "neck", "head", "left_collar", "right_collar")
FEWEST_TORSO_MARKERS = 5  # markers
OPPOSITE_LETTER = {"L": "R", "R": "L", "l": "r", "r": "l"}  # how labels of markers begin
MISSED_MARKER = 0.06  # m: a marker that is farther from its nominal place
MISSED_MARKERS_MEDIAN = 0.02  # m, of the median marker
FRAMES_LOOKED_AT = 12  # of a clip, that are looked at
OFTEN_SHARE = 0.5  # of them: what is seen in more is said


def doubts(
    setup: Setup, values: Values, solution: Solution, *, again: bool = True
) -> tuple[str, ...]:
    """What speaks against a fit, in sentences; none if nothing does.

    `values` are those of all blocks at the end, free and fixed. With `again`, one image is fitted
    again with left and right exchanged also where nothing else speaks against the fit, which takes
    as long as the fit itself.
    """
    sentences = []
    if solution.status not in (Status.CONVERGED, Status.STOPPED):
        sentences.append(
            f"the solver did not converge ({solution.status.name.lower().replace('_', ' ')}); the "
            "numbers are those of the best point that it found"
        )
    body = setup.body if setup.moving is None else setup.moving.body
    moments = [] if body is None else _moments(setup, values)
    by_moment = [] if body is None else [_of_moment(body, *moment) for moment in moments]
    wrong = _often([of_views for of_views, _ in by_moment])
    if wrong:  # all else follows from it
        return (*sentences, *wrong)
    sentences += _often([other for _, other in by_moment])
    if setup.moving is None and moments:
        depth = depth_interval(setup, values)
        if depth is not None and depth.low <= 0:
            sentences.append(
                f"the 90 % interval of the distance, {depth.low:.2f} to {depth.high:.2f} m, "
                "reaches behind the camera: the keypoints hardly tell how far away the person is; "
                "give --height or --focal"
            )
    free, odd = setup.problem.free.names, list[str]()
    if body is not None:
        pose, betas, _ = (block.name for block in body.blocks())
        sentences += of_person(body, values[betas]) if betas in free else ()
        if moments and pose in free and POSE_PRIOR in setup.problem.rows:
            odd += of_pose(body, values[pose])
    sentences += [*setup.doubts(values), *_of_residuals(setup, values)]
    if setup.moving is None and moments and (sentences or odd or again):
        better = better_reading(setup, values, solution, doubted=bool(sentences or odd))
        if better:
            return (better, *sentences, *odd)
    # several views show a pose, however rare it is
    return tuple(sentences) if any(len(views) > 1 for views, _ in moments) else (*sentences, *odd)


Views = tuple[View, ...]
Said = dict[str, str]  # sentences by what they are about


def _moments(setup: Setup, values: Values) -> list[tuple[Views, Values]]:
    """The fitted views of a photograph or of some frames of a clip, and the values of each."""
    if setup.moving is None:
        views = tuple(view for view in setup.views if not view.held_out)
        return [(views, values)] if views else []
    body, views = setup.moving.body, setup.moving.views
    pose, betas, trans = (block.name for block in body.blocks())
    sure = [(view.confidence > LEAST_CONFIDENCE).any(axis=1) for view in views]
    seen = np.flatnonzero(np.all(sure, axis=0))
    spread = np.unique(np.linspace(0, len(seen) - 1, FRAMES_LOOKED_AT).round().astype(int))
    some = seen[spread] if len(seen) else []
    shapes = np.broadcast_to(values[betas], (len(values[pose]), values[betas].shape[-1]))
    return [
        (
            tuple(replace(v, observed=v.observed[t], confidence=v.confidence[t]) for v in views),
            {**values, pose: values[pose][t], trans: values[trans][t], betas: shapes[t]},
        )
        for t in some
    ]


def _often(moments: Sequence[Said]) -> list[str]:
    """The sentences that hold at most moments, as the middle one of these moments has them."""
    count = Counter(about for by_subject in moments for about in by_subject)
    sentences = []
    for about, n_frames in count.items():
        if n_frames > OFTEN_SHARE * len(moments):
            alike = [by_subject[about] for by_subject in moments if about in by_subject]
            frames = f"in {n_frames} of {len(moments)} frames " if len(moments) > 1 else ""
            sentences.append(frames + alike[len(alike) // 2])
    return sentences


def _of_moment(body: Body, views: Views, values: Values) -> tuple[Said, Said]:
    """What is wrong with the views themselves, and what speaks against the fit to them."""
    wrong: Said = {}
    for view in views:
        farthest = np.abs(view.observed[view.confidence > 0]).max(initial=0.0)
        if farthest <= LARGEST_FRACTION:
            wrong[f"unit of {view.name}"] = (
                f"all keypoints of {view.name} lie within {farthest:.2g} px: "
                "they are fractions of the image; multiply them by its width and height in px"
            )
        centre = values[view.camera.centre.name]
        if np.abs(centre / view.size - 0.5).max() > LARGEST_CENTRE_OFFSET:
            wrong[f"centre of {view.name}"] = (
                f"the principal point of {view.name} is {centre[0]:.0f}, {centre[1]:.0f} px in an "
                f"image of {view.size[0]}x{view.size[1]} px; check whether it was calibrated with "
                "images of this size that were not turned"
            )
    if len(views) > 1:
        wrong |= _views(body, views, values)
    if wrong:
        return wrong, {}
    against: Said = {}
    for view in views:
        against |= _view(body, view, values, "" if len(views) == 1 else f" of {view.name}")
    return {}, against


def _views(body: Body, views: Views, values: Values) -> Said:
    off = disagreement(views, values)
    unit = unit_of_translations(views, values)
    if off <= LARGEST_DISAGREEMENT and not unit:
        return {}
    if off <= LARGEST_DISAGREEMENT:
        return {
            "unit": "the views agree, but on a person of another size: the translations of the "
            f"cameras seem to be in {unit}; give them in m"
        }
    size = f"{100 * off:.1f} % of the person's size" if np.isfinite(off) else "no common point"
    convention = agreeing_convention(views, values, body.landmark_names(views[0].landmarks))
    do = "compare the calibration with the files, their order, and the person in each"
    if convention:
        do = f"they would agree if {convention}"
    text = f"the views contradict each other (rays of a keypoint miss by {size}); {do}"
    return {"views": text}


def _view(body: Body, view: View, values: Values, of: str) -> Said:
    landmarks = body.landmark(view.landmarks, *(values[block.name] for block in body.blocks()))
    depth = float(np.median(view.camera.depths(landmarks, values)))
    against: Said = {}
    seen = view.confidence > LEAST_CONFIDENCE
    outside: Mask = np.asarray(((view.observed < 0) | (view.observed > view.size)).any(axis=1))
    if outside[seen].sum() > MOST_MISSED_SHARE * seen.sum():
        against[f"size{of}"] = (
            f"{outside[seen].sum()} of {seen.sum()} keypoints{of} lie outside of the image of "
            f"{view.size[0]}x{view.size[1]} px; check its size, or give no confidence to those "
            "that the detector only guessed"
        )
    if not DISTANCES[0] <= depth <= DISTANCES[1]:
        against["distance"] = (
            f"the person is {depth:,.2f} m from the camera; check the size of the image, the "
            "focal length and that coordinates are in px"
        )
    if not depth > 0:
        return against
    focal = float(np.mean(values[view.camera.focal.name]))
    px = np.linalg.norm(view.camera.pixels(landmarks, values) - view.observed, axis=1)
    off = px * depth / focal  # m
    if not seen.any():
        return against
    far, share = off > OUTLIER_DISTANCE, float(np.mean(off[seen] > MISSED_KEYPOINT))
    if share > MOST_MISSED_SHARE:
        return against | {
            f"misfit{of}": f"the body misses {100 * share:.0f} % of the keypoints{of} by over "
            f"{100 * MISSED_KEYPOINT:.0f} cm at its distance, and the median one by "
            f"{np.median(px[seen]):.0f} px; check their order, left and right, and the camera"
        }
    names = body.landmark_names(view.landmarks)
    for limb, joints in LIMBS.items():
        rows = np.array([names.index(j) for j in joints if j in names and seen[names.index(j)]])
        if len(rows) == len(joints) and far[rows].all():
            against[limb + of] = (
                f"all keypoints of the {limb}{of} count as outliers, up to {px[rows].max():.0f} px "
                "from the body; look at the picture: they may be another person's, or exchanged"
            )
    return against


def of_person(body: Body, betas: Array) -> Iterator[str]:
    """What speaks against a shape (B,) that was found, or shapes (T, B) of frames."""
    betas = np.asarray(betas, dtype=float)
    if not betas.size:
        return
    if betas.ndim == 2:
        betas = np.median(betas, axis=0)
    shape = betas[: n_of_shape(body)]
    largest, square = float(np.abs(shape).max()), float(np.mean(shape**2))
    if largest > LARGEST_BETA or square > LARGEST_SHAPE_SQUARE:
        k = int(np.abs(shape).argmax())
        yield (
            f"the shape is improbable: betas[{k}] is {betas[k]:.1f} standard deviations from "
            f"the mean person, root mean square {np.sqrt(square):.1f}; check the units, which "
            "points are which, and whether the body is one of this person"
        )
    size = float(np.ptp(body.template, axis=0).max())
    if isinstance(body, SkinnedBody) and STATURES[0] < size < STATURES[1]:  # not a hand
        height = float(stature(body, betas))
        if not STATURES[0] <= height <= STATURES[1]:
            yield (
                f"the person would be {height:.2f} m tall; check the units of the data, and "
                "whether the body is one of this person, such as a child"
            )


def of_pose(body: Body, pose: Array) -> Iterator[str]:
    """What speaks against a pose (K, 3) rad that was found, or the median one of a motion's."""
    square = float(np.median(pose_square(body, pose)))
    if square > LARGEST_POSE_SQUARE:
        yield (
            f"the pose is improbable: joints are {np.sqrt(square):.1f} standard deviations off the "
            "mean pose (root mean square); look at the body, and check left and right and the "
            "order of the points"
        )


def of_vertices(errors: Array) -> Iterator[str]:
    """What speaks against a body whose vertices are so far (N,) in m from where they were seen."""
    middle = float(np.median(errors))
    if middle > MISSED_VERTEX:
        yield (
            f"the body misses the vertices by {100 * middle:.0f} cm in the median; check that they "
            "come in the body's order, and their unit"
        )


def of_markers(
    body: SkinnedBody, marker_set: MarkerSet, observed: Array, values: Values
) -> Iterator[str]:
    """What speaks against a body that wears markers, seen at (T, M, 3) m, NaN where not."""
    names = marker_set.names
    scale = _extent(observed) / _extent(body.landmark(MARKERS)[None])
    if not 1 / OTHER_SIZE_RATIO < scale < OTHER_SIZE_RATIO:
        units = (w for f, w in UNIT_MISTAKES.items() if 1 / PERSON_RATIO < scale / f < PERSON_RATIO)
        mistake = next((f", as if {what}" for what in units), "")
        yield (
            f"the markers reach {scale:.3g} times as far as those of the body{mistake}; "
            "check their unit, and whether the body is the one that wore them"
        )
        return
    pose, betas, trans = (values[block.name] for block in body.blocks())
    nominal = body.landmark(MARKERS, pose, betas, trans, marker_set.nominal)
    if _sides_of_markers_exchanged(body, marker_set, observed, betas):
        yield "left and right of the markers are exchanged, or the recording is mirrored"
        return
    seen: Mask = np.asarray(np.isfinite(observed).all(axis=-1))
    off = np.linalg.norm(nominal - observed, axis=-1)  # m, (T, M)
    medians = np.array(
        [np.median(off[seen[:, m], m]) if seen[:, m].any() else 0.0 for m in range(len(names))]
    )
    wrong: Mask = np.asarray(medians > MISSED_MARKER)
    if wrong.any():
        which = [names[m] for m in np.argsort(-medians) if wrong[m]]
        yield (
            f"markers are up to {100 * medians.max():.0f} cm from where the set has them on the "
            f"body: {some_of(which)}; check their labels, which may be exchanged, and the marker "
            "set"
        )
    elif np.median(medians) > MISSED_MARKERS_MEDIAN:
        yield (
            f"markers are {1e3 * np.median(medians):.0f} mm from where the set has them on the "
            "body, in the median; check the labels, the marker set and the body"
        )
    yield from of_person(body, betas)


def _sides_of_markers_exchanged(
    body: SkinnedBody, marker_set: MarkerSet, observed: Array, betas: Array
) -> bool:
    """Whether the markers of the torso fit much better with left and right exchanged."""
    names = marker_set.names
    opposites = [OPPOSITE_LETTER.get(label[:1], label[:1]) + label[1:] for label in names]
    other = np.array([names.index(label) if label in names else -1 for label in opposites])
    torso = np.isin(np.array(body.joint_names)[marker_set.leaders(body)], TORSO) & (other >= 0)
    if torso.sum() < FEWEST_TORSO_MARKERS:
        return False
    rest = body.landmark(MARKERS, betas=betas, offsets=marker_set.nominal)[torso]
    own = _rigid_error(rest, observed[:, torso])
    return _rigid_error(rest, observed[:, other[torso]]) < own / 2


def _extent(places: Array) -> float:
    """How far points (T, M, 3) reach in a usual frame, in m."""
    return float(np.median(np.sqrt(np.nansum(np.nanvar(places, axis=1), axis=1))))


def _rigid_error(rest: Array, observed: Array) -> float:
    """How far points (T, M, 3) m are from rigidly moved ones (M, 3), in a usual frame."""
    errors = []
    for places in observed:
        seen = np.isfinite(places).all(axis=1)
        if seen.sum() >= FEWEST_TORSO_MARKERS:
            motion = procrustes(rest[seen], places[seen])
            off = rest[seen] @ motion.R.T + motion.t - places[seen]
            errors.append(np.sqrt(np.mean(off**2)))
    return float(np.median(errors)) if errors else np.nan


def pose_square(body: Body, pose: Array) -> Array:
    """The mean square (...,) of poses (..., K, 3) rad in standard deviations of `pose_gaussian`.

    It is 1 on average for poses that are drawn from it.
    """
    mean, covariance = pose_gaussian(body)
    off = np.asarray(pose, dtype=float)[..., 1:, :] - np.reshape(mean, (-1, 3))
    flat = off.reshape(*off.shape[:-2], -1)
    if np.ndim(covariance) < 2:
        return np.asarray(np.mean(flat**2 / covariance, axis=-1))
    whole = np.linalg.solve(covariance, flat[..., None])[..., 0]
    return np.asarray(np.sum(flat * whole, axis=-1) / flat.shape[-1])


def _of_residuals(setup: Setup, values: Values) -> Iterator[str]:
    """Data that are missed by many sigmas, or met far better, by a body that priors object to."""
    problem = setup.problem
    residual = problem.residual(*problem.split(values))
    sizes = {
        name: float(np.sqrt(np.mean(residual[rows] ** 2)))
        for name, rows in problem.rows.items()
        if name not in setup.priors
    }
    if not sizes:
        return
    worst = max(sizes, key=lambda name: sizes[name])
    if FAR_OFF < sizes[worst] < np.inf:
        yield (
            f"residual {worst!r} is {sizes[worst]:.3g} times its sigma (root mean square), so that "
            "the standard deviations of a diagnosis are too small; check the formula and its "
            "units, outliers, bounds that exclude the answer, and sigma"
        )
    prior = problem.rows_named(setup.priors)
    if not prior.any():
        return
    of_prior, of_data = (float(np.sqrt(np.mean(residual[rows] ** 2))) for rows in (prior, ~prior))
    if of_data < WELL_MET and of_prior > UNLIKELY_BY_PRIOR:
        share = float(np.sum(residual[prior] ** 2) / np.sum(residual**2))
        yield (
            f"priors carry {100 * share:.0f} % of the cost: the data are met to {of_data:.2g} of "
            f"their sigma, by a body {of_prior:.1f} standard deviations off the priors; the points "
            "may not be where the body has them, or sigma is too large"
        )
