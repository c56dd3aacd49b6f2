"""Which convention of their extrinsics would make several views of a person agree."""

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.fitting.keypoint_conventions import mirrored, sides_exchanged, y_upwards
from workbench.fitting.keypoints import LEAST_CONFIDENCE
from workbench.fitting.setup import View
from workbench.geometry.camera import triangulate
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix

AGREE = 0.02  # of the size of the person in an image: rays that miss each other by more contradict
MOST_ORDERS = 5  # cameras of which all orders are tried; of more, every exchange of two
OPENGL = np.diag([1.0, -1.0, -1.0])  # x right, y up, z backwards
PERSON = 0.5, 2.6  # m, between the keypoints of a person that are farthest apart
UNITS = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254}
Extrinsics = list[tuple[Array, Array]]  # R (3, 3) and t (3,) of each camera


def triangulated(views: Sequence[View], values: Values) -> Array:
    """The keypoints (M, 3) m that two views or more see; NaN for others."""
    confidences = [
        np.where(view.confidence > LEAST_CONFIDENCE, view.confidence, 0.0) for view in views
    ]
    observed = [view.observed for view in views]
    return triangulate([view.camera for view in views], values, observed, confidences)


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
    if not size or PERSON[0] <= size <= PERSON[1]:
        return ""
    fitting = [unit for unit, m in UNITS.items() if PERSON[0] <= m * size <= PERSON[1]]
    return fitting[0] if fitting else "another unit"


def agreeing_convention(views: Sequence[View], values: Values, names: Sequence[str]) -> str:
    """What would make views that contradict each other agree; empty if nothing known does.

    Other conventions of the extrinsics, other orders of the cameras, other readings of images, and
    views left out are tried. `names` (M,) are those of the keypoints.
    """
    given: Extrinsics = [
        (
            matrix_from_vector(np.asarray(values[v.camera.rotation.name])),
            np.asarray(values[v.camera.translation.name], dtype=float),
        )
        for v in views
    ]
    tried: list[tuple[str, Sequence[View], Values]] = []
    for what, extrinsics in _conventions(given):
        changed = dict(values)
        for view, (R, t) in zip(views, extrinsics, strict=True):
            changed[view.camera.rotation.name] = vector_from_matrix(R)
            changed[view.camera.translation.name] = t
        tried.append((what, views, changed))
    for what, seen in _other_views(views, names):
        tried.append((what, seen, values))
    with np.errstate(all="ignore"):
        here, best, said = disagreement(views, values), AGREE / 0.8, ""
        for what, seen, changed in tried:
            found = disagreement(seen, changed)
            if found < min(0.8 * best, here / 3):
                best, said = found, what
                if unit := unit_of_translations(seen, changed):
                    said = f"{what}, with translations in {unit}"
        if said or len(views) < 3:
            return said
        others = [disagreement((*views[:k], *views[k + 1 :]), values) for k in range(len(views))]
    k = int(np.argmin(np.nan_to_num(others, nan=np.inf)))
    if not others[k] < AGREE:
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


def _conventions(given: Extrinsics) -> Iterator[tuple[str, Extrinsics]]:
    yield (
        "the extrinsics are camera-to-world, not world-to-camera",
        [(R.T, -R.T @ t) for R, t in given],
    )
    yield (
        "rotations are in degrees",
        [(matrix_from_vector(np.radians(vector_from_matrix(R))), t) for R, t in given],
    )
    yield "`t` are the places of the cameras, not translations", [(R, -R @ t) for R, t in given]
    yield (
        "the cameras have OpenGL's axes (y up, z backwards)",
        [(OPENGL @ R, OPENGL @ t) for R, t in given],
    )
    yield (
        "the extrinsics are camera-to-world, with OpenGL's axes (y up, z backwards)",
        [(OPENGL @ R.T, -OPENGL @ R.T @ t) for R, t in given],
    )
    count = len(given)
    orders = permutations(range(count)) if count <= MOST_ORDERS else _exchanges(count)
    for order in orders:
        if list(order) != list(range(count)):
            said = ", ".join(str(k + 1) for k in order)
            yield f"the cameras belong to the files in the order {said}", [given[k] for k in order]


def _exchanges(count: int) -> Iterator[tuple[int, ...]]:
    for i in range(count):
        for j in range(i + 1, count):
            order = list(range(count))
            order[i], order[j] = j, i
            yield tuple(order)
