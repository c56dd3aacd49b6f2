"""Which other convention of keypoints or cameras would make a doubted fit a good one."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, permutations

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.errors import WorkbenchError
from workbench.fitting.keypoints import LEAST_CONFIDENCE, triangulated
from workbench.fitting.observations import COCO
from workbench.fitting.placing import image_starts, place_body
from workbench.fitting.setup import Setup, View
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.solvers import Solution, TrustRegion

BETTER_SHARE = 0.7  # of the cost: another reading that costs less is said
CLOSE_RATIO = 1.5  # times the cost of the best reading, up to which another may be the right one
MIRRORED = "the images are mirrored"
SIDES = "left and right were exchanged, or the image is mirrored"
UPWARDS = "y points up in the image; give v from its upper border"
HALF_TURN = "the image is upside down; turn it by 180 degrees"
QUICK_SOLVER = TrustRegion(max_iterations=50, gradient_tolerance=1e-3)
UPSIDE_DOWN_COSINE = 0.7  # between a body's own y and the image's: it stands on its head
ORDERS = {  # of 17 keypoints
    "Human3.6M": (
        *("pelvis", "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee"),
        *("left_ankle", "spine", "neck", "nose", "head", "left_shoulder", "left_elbow"),
        *("left_wrist", "right_shoulder", "right_elbow", "right_wrist"),
    ),
    "OpenPose's COCO-18 without the neck": (
        *("nose", "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow"),
        *("left_wrist", "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee"),
        *("left_ankle", "right_eye", "left_eye", "right_ear", "left_ear"),
    ),
}
MOST_ORDERED = 4  # cameras, of which all orders are tried; else two that are exchanged
LARGEST_DISAGREEMENT = 0.02  # of the person's size in an image: how far rays miss each other
OPENGL = np.diag([1.0, -1.0, -1.0])  # x right, y up, z backwards
PERSON_SIZES = 0.5, 2.6  # m, between the keypoints of a person that are farthest apart
UNITS = {"mm": 1e-3, "cm": 1e-2, "inches": 0.0254}


def opposite(name: str) -> str:
    """The keypoint of the other side: `left_knee` for `right_knee`."""
    for side, other in (("left_", "right_"), ("right_", "left_")):
        if name.startswith(side):
            return other + name.removeprefix(side)
    return name


def sides_exchanged(view: View, names: Sequence[str]) -> View:
    """The view with the keypoints of left and right exchanged; `names` (M,) are theirs."""
    order = [names.index(opposite(n)) if opposite(n) in names else i for i, n in enumerate(names)]
    return replace(view, observed=view.observed[order], confidence=view.confidence[order])


def y_upwards(view: View) -> View:
    """The view as it was if its v pointed upwards, from the lower border."""
    observed = view.observed * [1, -1] + [0, view.size[1]]
    return replace(view, observed=observed)


def mirrored(view: View) -> View:
    """The view in a mirror."""
    return replace(view, observed=view.observed * [-1, 1] + [view.size[0], 0])


def readings(names: Sequence[str], seen: Collection[str]) -> dict[str, Callable[[View], View]]:
    """Other readings of keypoints with these names, by the words of a doubt: `if ...`.

    Other orders are those of files with COCO's keypoints, and no others `seen`.
    """
    changes: dict[str, Callable[[View], View]] = {
        SIDES: lambda view: sides_exchanged(view, names),
        UPWARDS: y_upwards,
        HALF_TURN: lambda view: y_upwards(mirrored(view)),
        "u and v were exchanged": lambda view: replace(view, observed=view.observed[:, ::-1]),
    }
    if {*COCO} <= {*names} and {*seen} <= {*COCO}:
        for what, order in ORDERS.items():
            changes[f"they are in the order of {what}, not COCO's"] = partial(
                _reordered, names=names, order=order
            )
    return changes


def _reordered(view: View, names: Sequence[str], order: Sequence[str]) -> View:
    """The view if its 17 keypoints, read in COCO's order, were in another."""
    observed, confidence = view.observed.copy(), np.zeros_like(view.confidence)
    for k, name in enumerate(order):
        if name in names:
            row, k_row = names.index(name), names.index(COCO[k])
            observed[row], confidence[row] = view.observed[k_row], view.confidence[k_row]
    return replace(view, observed=observed, confidence=confidence)


def better_reading(setup: Setup, values: Values, solution: Solution, *, doubted: bool) -> str:
    """What would fit the keypoints of one moment much better, in a sentence; empty if nothing does.

    Fits that are `doubted`, and those of a person who stands on their head, are made again with all
    other `readings`, and any other to one image with left and right exchanged.
    """
    views = [view for view in setup.views if not view.held_out]
    if setup.body is None or not views:
        return ""
    names = setup.body.landmark_names(views[0].landmarks)
    seen = np.any([view.confidence > 0 for view in views], axis=0)
    known = readings(names, [name for name, one in zip(names, seen, strict=True) if one])
    if len(views) > 1:
        known[MIRRORED] = mirrored
    head = all(is_upside_down(setup, view, values) for view in views)
    if not (doubted or head):
        known = {SIDES: known[SIDES]} if len(views) == 1 else {}
    costs = {what: _cost(setup, views, [*map(change, views)]) for what, change in known.items()}
    best = min(costs, key=lambda what: costs[what], default="")
    if head:
        up = min((UPWARDS, HALF_TURN), key=lambda what: costs[what])
        if costs[up] < CLOSE_RATIO * costs[best] or costs[best] > solution.cost:
            return f"the person stands on their head in the image; if they do not, {up}"
    one_sigma = setup.problem.size / 2  # the cost of what is met as well as is expected
    if best and costs[best] < min(BETTER_SHARE * solution.cost, one_sigma):
        share = 100 * costs[best] / solution.cost
        return f"the keypoints would fit better, at {share:.0f} % of the cost, if {best}"
    return ""


def is_upside_down(setup: Setup, view: View, values: Values) -> bool:
    """Whether the body's own y points down in the image."""
    assert setup.body is not None
    root = matrix_from_vector(values[setup.body.blocks()[0].name][0])
    root = root @ matrix_from_vector(setup.body.bind_pose[0]).T
    camera = matrix_from_vector(np.asarray(values[view.camera.rotation.name]))
    return bool((camera @ root)[1, 1] > UPSIDE_DOWN_COSINE)


def _cost(setup: Setup, views: Sequence[View], changed: Sequence[View]) -> float:
    """The cost of the fit to other readings of the views, from its own start."""
    body, start = setup.body, dict(setup.start)
    assert body is not None
    for view, other in zip(views, changed, strict=True):
        prefix = view.camera.prefix
        start |= {prefix + "observed": other.observed, prefix + "confidence": other.confidence}
    try:
        with np.errstate(all="ignore"):
            start |= place_body(body, changed, start)
            if len(changed) == 1:
                start |= image_starts(body, changed[0], start, 1)[0]
            solver = QUICK_SOLVER if setup.strategy is None else setup.strategy(None)
            cost = solver.solve(setup.problem, start).cost
    except (WorkbenchError, ArithmeticError, np.linalg.LinAlgError):
        return np.inf
    return cost if np.isfinite(cost) else np.inf


Extrinsics = list[tuple[Array, Array]]  # R (3, 3) and t (3,) of each camera
CONVENTIONS: dict[str, Callable[[Array, Array], tuple[Array, Array]]] = {
    "the extrinsics are camera-to-world, not world-to-camera (--camera-to-world)": (
        lambda R, t: (R.T, -R.T @ t)
    ),
    "rotations are in degrees": lambda R, t: (
        matrix_from_vector(np.radians(vector_from_matrix(R))),
        t,
    ),
    "`t` are the places of the cameras, not translations": lambda R, t: (R, -R @ t),
    "the cameras have OpenGL's axes (y up, z backwards)": lambda R, t: (OPENGL @ R, OPENGL @ t),
    "the extrinsics are camera-to-world, with OpenGL's axes (y up, z backwards)": lambda R, t: (
        OPENGL @ R.T,
        -OPENGL @ R.T @ t,
    ),
}


def disagreement(views: Sequence[View], values: Values) -> float:
    """How far triangulated keypoints are from those of the views, as a share of the person's size.

    It is the median of the reprojection errors, each divided by the size of the person in its
    image; infinite for points behind a camera, and NaN where no keypoint is seen by two views.
    """
    points, off = triangulated(views, values), []
    several = np.sum([view.confidence > LEAST_CONFIDENCE for view in views], axis=0) > 1
    for view in views:
        rows = several & (view.confidence > LEAST_CONFIDENCE)
        if not rows.any():
            continue
        seen = view.observed[rows]
        size = float(np.linalg.norm(np.ptp(seen, axis=0)))
        depth = view.camera.depths(points[rows], values)
        error = np.linalg.norm(view.camera.pixels(points[rows], values) - seen, axis=1)
        off.append(np.where(depth > 0, error / max(size, 1e-9), np.inf))
    return float(np.median(np.concatenate(off))) if off else np.nan


def unit_of_translations(views: Sequence[View], values: Values) -> str:
    """The unit in which the person would have the size of one; empty if metres are right."""
    points = triangulated(views, values)
    points = points[np.isfinite(points).all(axis=1)]
    size = float(np.linalg.norm(points[:, None] - points, axis=-1).max(initial=0.0))
    if not size or PERSON_SIZES[0] <= size <= PERSON_SIZES[1]:
        return ""
    low, high = PERSON_SIZES
    fitting = [unit for unit, m in UNITS.items() if low <= m * size <= high]
    usual = np.sqrt(low * high)  # m; taken for cm, inches make a small person
    nearest = min(fitting, key=lambda unit: abs(np.log(UNITS[unit] * size / usual)), default="")
    return nearest or "another unit"


def agreeing_convention(views: Sequence[View], values: Values, names: Sequence[str]) -> str:
    """What would make views that contradict each other agree; empty if nothing known does.

    Other conventions of the extrinsics, other orders of the cameras, other readings of images, and
    views left out are tried. `names` (M,) are those of the keypoints.
    """
    extrinsics: Extrinsics = [
        (
            matrix_from_vector(np.asarray(values[v.camera.rotation.name])),
            np.asarray(values[v.camera.translation.name], dtype=float),
        )
        for v in views
    ]
    tried: list[tuple[str, Sequence[View], Values]] = []
    for what, changed_extrinsics in _conventions(extrinsics):
        changed = dict(values)
        for view, (R, t) in zip(views, changed_extrinsics, strict=True):
            changed[view.camera.rotation.name] = vector_from_matrix(R)
            changed[view.camera.translation.name] = t
        tried.append((what, views, changed))
    tried += [(what, seen, values) for what, seen in _other_views(views, names)]
    with np.errstate(all="ignore"):
        here, best, phrase = disagreement(views, values), LARGEST_DISAGREEMENT / 0.8, ""
        for what, seen, changed in tried:
            off = disagreement(seen, changed)
            if off < min(0.8 * best, here / 3):
                best, phrase = off, what
                if unit := unit_of_translations(seen, changed):
                    phrase = f"{what}, with translations in {unit}"
        if phrase or len(views) < 3:
            return phrase
        others = [disagreement((*views[:k], *views[k + 1 :]), values) for k in range(len(views))]
    k = int(np.argmin(np.nan_to_num(others, nan=np.inf)))
    if not others[k] < LARGEST_DISAGREEMENT:
        return ""
    return f"{views[k].name} is left out; look at its calibration, its keypoints and whom it shows"


def _other_views(
    views: Sequence[View], names: Sequence[str]
) -> Iterator[tuple[str, Sequence[View]]]:
    """Other readings of the images, of one or of all."""
    for k, view in enumerate(views):
        yield (
            f"left and right were exchanged in {view.name}",
            (*views[:k], sides_exchanged(view, names), *views[k + 1 :]),
        )
    for what, change in (("y pointed up", y_upwards), ("u pointed left (mirrored)", mirrored)):
        yield f"{what} in all images", tuple(map(change, views))
        for k, view in enumerate(views):
            yield f"{what} in {view.name}", (*views[:k], change(view), *views[k + 1 :])


def _conventions(extrinsics: Extrinsics) -> Iterator[tuple[str, Extrinsics]]:
    for what, change in CONVENTIONS.items():
        yield what, [change(R, t) for R, t in extrinsics]
    every = range(len(extrinsics))
    swapped = ([{i: j, j: i}.get(k, k) for k in every] for i, j in combinations(every, 2))
    for order in permutations(every) if len(extrinsics) <= MOST_ORDERED else swapped:
        numbers = ", ".join(str(k + 1) for k in order)
        yield (
            f"the cameras belong to the files in the order {numbers}",
            [extrinsics[k] for k in order],
        )
