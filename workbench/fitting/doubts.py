"""Whether a fit may be believed, judged without the truth.

A doubt is a sentence: what was seen, what it probably means, and what to do. None of them says that
a fit is wrong; they name what a converged solver does not look at. The thresholds are judgements;
how many good fits they doubt has not been measured yet.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.fitting.body_priors import POSE_PRIOR
from workbench.fitting.camera_conventions import (
    AGREE,
    agreeing_convention,
    disagreement,
    unit_of_translations,
)
from workbench.fitting.depth_interval import depth_interval
from workbench.fitting.keypoints import LEAST_CONFIDENCE
from workbench.fitting.setup import Setup, View
from workbench.fitting.stature import stature
from workbench.solvers import Solution, Status

FRACTIONS = 1.5  # px: keypoints that all lie within are fractions of the image
MISFIT = 0.06  # m, of the median keypoint at the person's distance
OUTLIER = 0.15  # m: a keypoint that is farther away counts as an outlier
MOST_OUTLIERS = 0.3  # of the keypoints
LIMBS = {
    f"{side} {limb}": tuple(f"{side}_{joint}" for joint in joints)
    for side in ("left", "right")
    for limb, joints in (("arm", ("elbow", "wrist")), ("leg", ("knee", "ankle")))
}
SHAPE = 3.0  # mean square of betas, which is 1 for shapes drawn from the prior
ONE_BETA = 3.5  # standard deviations
POSE = 2.0  # mean square of the rows of the prior on the pose
STATURES = 1.2, 2.2  # m
DISTANCES = 0.5, 60.0  # m, from the camera
MET = 0.3  # sigmas, root mean square: data that are met so well count less than they seem to
UNLIKELY = 1.5  # sigmas, root mean square of a prior's rows, beside data that are met


def doubts(setup: Setup, values: Values, solution: Solution) -> tuple[str, ...]:
    """What speaks against a fit, in sentences; none if nothing does.

    `values` are those of all blocks at the end, free and fixed.
    """
    found = [*_ending(solution)]
    views = [view for view in setup.views if not view.held_out]
    if setup.moving is None and setup.body is not None and views:
        wrong = [*_units(views), *(_views(setup.body, views, values) if len(views) > 1 else ())]
        if wrong:  # all else follows from it
            return (*found, *wrong)
        for view in views:
            found += _view(setup.body, view, values, alone=len(views) == 1)
        found += _interval(setup, values)
    return (*found, *_person(setup, values), *_priors(setup, values))


def _ending(solution: Solution) -> Iterator[str]:
    if solution.status not in (Status.CONVERGED, Status.STOPPED):
        yield (
            f"the solver did not converge ({solution.status.name.lower().replace('_', ' ')}); the "
            "numbers are those of the best point that it found"
        )


def _units(views: Sequence[View]) -> Iterator[str]:
    for view in views:
        seen = view.observed[view.confidence > 0]
        if np.abs(seen).max(initial=0.0) <= FRACTIONS:
            yield (
                f"all keypoints of {view.name} lie within {np.abs(seen).max():.2g} px: they are "
                "fractions of the image; multiply them by its width and height in px"
            )


def _views(body: Body, views: Sequence[View], values: Values) -> Iterator[str]:
    off = disagreement(views, values)
    unit = unit_of_translations(views, values)
    if off <= AGREE and not unit:
        return
    if off <= AGREE:
        yield (
            f"the views agree, but on a person of another size: the translations of the cameras "
            f"seem to be in {unit}; give them in m"
        )
        return
    size = f"{100 * off:.1f} % of the person's size" if np.isfinite(off) else "no common point"
    convention = agreeing_convention(views, values, body.landmark_names(views[0].landmarks))
    do = (
        f"they would agree if {convention}"
        if convention
        else "compare the calibration with the files, their order, and the person in each"
    )
    yield f"the views contradict each other (rays of a keypoint miss by {size}); {do}"


def _view(body: Body, view: View, values: Values, *, alone: bool) -> Iterator[str]:
    pose, betas, trans = (values[block.name] for block in body.blocks())
    landmarks = body.landmark(view.landmarks, pose, betas, trans)
    depth = float(np.median(view.camera.depths(landmarks, values)))
    if not DISTANCES[0] <= depth <= DISTANCES[1]:
        yield (
            f"the person is {depth:,.2f} m from the camera; check the size of the image, the "
            "focal length and that coordinates are in px"
        )
    if not depth > 0:
        return
    focal = float(np.mean(values[view.camera.focal.name]))
    px = np.linalg.norm(view.camera.pixels(landmarks, values) - view.observed, axis=1)
    seen, off = view.confidence > LEAST_CONFIDENCE, px * depth / focal  # m
    if not seen.any():
        return
    of = "" if alone else f" of {view.name}"
    far = off > OUTLIER
    share = float(np.mean(far[seen]))
    if np.median(off[seen]) > MISFIT or share > MOST_OUTLIERS:
        yield (
            f"the body misses the keypoints{of}: by {np.median(px[seen]):.0f} px in the median "
            f"({100 * np.median(off[seen]):.0f} cm at its distance), and {100 * share:.0f} % by "
            f"over {100 * OUTLIER:.0f} cm; check their order, left and right, and the camera"
        )
        return
    names = body.landmark_names(view.landmarks)
    for limb, joints in LIMBS.items():
        rows = np.array([names.index(j) for j in joints if j in names and seen[names.index(j)]])
        if len(rows) == len(joints) and far[rows].all():
            yield (
                f"all keypoints of the {limb}{of} count as outliers, up to {px[rows].max():.0f} px "
                "from the body; look at the picture: they may be another person's, or exchanged"
            )


def _interval(setup: Setup, values: Values) -> Iterator[str]:
    found = depth_interval(setup, values)
    if found is not None and found.low <= 0:
        yield (
            f"the 90 % interval of the distance, {found.low:.2f} to {found.high:.2f} m, reaches "
            "behind the camera: the keypoints hardly tell how far away the person is; give "
            "--height or --focal"
        )


def _person(setup: Setup, values: Values) -> Iterator[str]:
    body, problem = setup.body, setup.problem
    if body is None:
        return
    name = body.blocks()[1].name
    betas = np.asarray(values.get(name, np.zeros(0)), dtype=float)
    if name in problem.free.names and betas.size:
        largest, square = float(np.abs(betas).max()), float(np.mean(betas**2))
        if largest > ONE_BETA or square > SHAPE:
            k = int(np.abs(betas).argmax())
            yield (
                f"the shape is improbable: betas[{k}] is {betas[k]:.1f} standard deviations from "
                f"the mean person, root mean square {np.sqrt(square):.1f}; check the units, which "
                "points are which, and whether the body is one of this person"
            )
        if isinstance(body, SkinnedBody) and _is_person(body):
            height = float(np.max(stature(body, betas)))
            if not STATURES[0] <= height <= STATURES[1]:
                yield f"the person would be {height:.2f} m tall; check the units of the data"
    rows = problem.rows.get(POSE_PRIOR)
    if rows is not None and setup.moving is None:
        off = problem.linearize(values).residual[rows]
        if np.mean(off**2) > POSE:
            yield (
                f"the pose is improbable: joints are {np.sqrt(np.mean(off**2)):.1f} standard "
                "deviations off the mean pose (root mean square); look at the body, and check "
                "left and right and the order of the points"
            )


def _is_person(body: SkinnedBody) -> bool:
    return STATURES[0] < float(np.ptp(body.template, axis=0).max()) < STATURES[1]


def _priors(setup: Setup, values: Values) -> Iterator[str]:
    """Data that are met far better than their sigma says, by a body that the priors object to."""
    problem = setup.problem
    if not setup.priors or len(setup.priors) == len(problem.residuals):
        return
    residual = problem.linearize(values).residual
    prior = np.zeros(len(residual), dtype=bool)
    for name in setup.priors:
        prior[problem.rows[name]] = True
    if not prior.any() or prior.all():
        return
    of_prior, of_data = (_rms(residual[rows]) for rows in (prior, ~prior))
    if of_data < MET and of_prior > UNLIKELY:
        share = float(np.sum(residual[prior] ** 2) / np.sum(residual**2))
        yield (
            f"priors carry {100 * share:.0f} % of the cost: the data are met to {of_data:.2g} of "
            f"their sigma, by a body {of_prior:.1f} standard deviations off the priors; the points "
            "may not be where the body has them, or sigma is too large"
        )


def _rms(numbers: Array) -> float:
    return float(np.sqrt(np.mean(numbers**2)))
