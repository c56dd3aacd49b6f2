"""Which other reading of their keypoints photographs of a person would fit much better."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from workbench.blocks import Values
from workbench.errors import WorkbenchError
from workbench.fitting.image_starts import image_starts
from workbench.fitting.keypoint_start import place_body
from workbench.fitting.observations import COCO
from workbench.fitting.setup import Setup, View
from workbench.geometry.rotation import matrix_from_vector
from workbench.solvers import Solution, TrustRegion

BETTER = 0.7  # of the cost: another reading that costs less is said
CLOSE = 1.5  # times the cost of the best reading, up to which another may be the right one
MIRRORED = "the images are mirrored"
SIDES = "left and right were exchanged, or the image is mirrored"
UPWARDS = "y points up in the image; give v from its upper border"
HALF_TURN = "the image is upside down; turn it by 180 degrees"
PLAIN = TrustRegion(max_iterations=50, gradient_tolerance=1e-3)
DOWN = 0.7  # cosine between a body's own y and the image's, from which on it stands on its head
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


def readings(names: Sequence[str]) -> dict[str, Callable[[View], View]]:
    """Other readings of keypoints with these names, by the words of a doubt: `if ...`."""
    found: dict[str, Callable[[View], View]] = {
        SIDES: lambda view: sides_exchanged(view, names),
        UPWARDS: y_upwards,
        HALF_TURN: lambda view: y_upwards(mirrored(view)),
        "u and v were exchanged": lambda view: replace(view, observed=view.observed[:, ::-1]),
    }
    if {*COCO} <= {*names}:
        for what, order in ORDERS.items():
            found[f"they are in the order of {what}, not COCO's"] = partial(
                _reordered, names=names, order=order
            )
    return found


def _reordered(view: View, names: Sequence[str], order: Sequence[str]) -> View:
    """The view if its 17 keypoints, read in COCO's order, were in another."""
    observed, confidence = view.observed.copy(), np.zeros_like(view.confidence)
    for k, name in enumerate(order):
        if name in names:
            row, there = names.index(name), names.index(COCO[k])
            observed[row], confidence[row] = view.observed[there], view.confidence[there]
    return replace(view, observed=observed, confidence=confidence)


def better_reading(setup: Setup, values: Values, solution: Solution, *, doubted: bool) -> str:
    """What would fit the keypoints of one moment much better, in a sentence; empty if nothing does.

    Fits that are `doubted` are made again with all other `readings`, those of a person who stands
    on their head with those that turn the image, and any other to one image with left and right
    exchanged.
    """
    views = [view for view in setup.views if not view.held_out]
    if setup.body is None or not views:
        return ""
    known = readings(setup.body.landmark_names(views[0].landmarks))
    if len(views) > 1:
        known[MIRRORED] = mirrored
    head = all(is_upside_down(setup, view, values) for view in views)
    if not doubted:
        once = (UPWARDS, HALF_TURN) if head else (SIDES,) if len(views) == 1 else ()
        known = {what: known[what] for what in once}
    costs = {what: _cost(setup, views, [*map(change, views)]) for what, change in known.items()}
    best = min(costs, key=lambda what: costs[what], default="")
    if head and (up := min((UPWARDS, HALF_TURN), key=lambda what: costs[what])):
        best = up if costs[up] < CLOSE * costs[best] or costs[best] > solution.cost else best
    if best in (UPWARDS, HALF_TURN) and head:
        return f"the person stands on their head in the image; if they do not, {best}"
    if best and costs[best] < BETTER * solution.cost:
        share = 100 * costs[best] / solution.cost
        return f"the keypoints would fit better, at {share:.0f} % of the cost, if {best}"
    return ""


def is_upside_down(setup: Setup, view: View, values: Values) -> bool:
    """Whether the body's own y points down in the image."""
    assert setup.body is not None
    root = matrix_from_vector(values[setup.body.blocks()[0].name][0])
    if setup.body.bind_pose[0].any():
        root = root @ matrix_from_vector(setup.body.bind_pose[0]).T
    camera = matrix_from_vector(np.asarray(values[view.camera.rotation.name]))
    return bool((camera @ root)[1, 1] > DOWN)


def _cost(setup: Setup, views: Sequence[View], changed: Sequence[View]) -> float:
    """The cost of the fit to other readings of the views, from its own start."""
    body = setup.body
    assert body is not None
    start = dict(setup.start)
    for view, other in zip(views, changed, strict=True):
        prefix = view.camera.prefix
        start |= {prefix + "observed": other.observed, prefix + "confidence": other.confidence}
    try:
        with np.errstate(all="ignore"):
            start |= place_body(body, changed, start)
            if len(changed) == 1:
                placed = replace(setup, start=start, views=tuple(changed))
                start |= image_starts(body, placed, 1)[0]
            solver = PLAIN if setup.strategy is None else setup.strategy(None)
            cost = solver.solve(setup.problem, start).cost
    except (WorkbenchError, ArithmeticError, np.linalg.LinAlgError):
        return np.inf
    return cost if np.isfinite(cost) else np.inf
