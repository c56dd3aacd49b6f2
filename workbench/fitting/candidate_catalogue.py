"""What could be measured of a setup, and which numbers may matter, by the names of the command."""

from collections.abc import Callable, Mapping

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.diagnostics.design import Criterion, Quantity, sd_of
from workbench.diagnostics.design.candidates import Given
from workbench.errors import BadArgument
from workbench.fitting.marker_sets import default_markers
from workbench.fitting.measurement_candidates import (
    cameras_of,
    cameras_on_a_sphere,
    depth_of,
    keypoint_candidates,
    marker_candidates,
    stature_of,
    without_hidden,
)
from workbench.fitting.observations import Photograph
from workbench.fitting.setup import Setup, View
from workbench.geometry.rotation import matrix_from_vector

OWN = "own"


def own_candidates(setup: Setup, values: Values) -> Given:
    """Those that the setup or the user's file names."""
    if not setup.candidates:
        raise BadArgument(
            "this problem names no candidates of its own; define `candidates` in the file, a dict "
            f"of residuals by name, or give --candidates {', '.join(CANDIDATES)}"
        )
    return setup.candidates


def cameras_around(setup: Setup, values: Values) -> Given:
    """36 cameras 4 m from the body's root."""
    body = _body(setup)
    return cameras_on_a_sphere(body, _joints(body, values)[0])


def held_out_views(setup: Setup, values: Values) -> Given:
    """The real cameras of the setup that were held out."""
    views = [view for view in setup.views if view.held_out]
    if not views:
        raise BadArgument("no camera of this problem is held out; hold one out, or take cameras")
    return cameras_of(_body(setup), [_photograph(view, values) for view in views])


def cameras_around_occluded(setup: Setup, values: Values) -> Given:
    """The same 36 cameras, none of which sees what the body hides from it."""
    body = _skinned(setup)
    around = cameras_on_a_sphere(body, _joints(body, values)[0])
    return without_hidden(body, around, values)


def held_out_views_occluded(setup: Setup, values: Values) -> Given:
    """The real cameras that were held out, none of which sees what the body hides from it."""
    views = [_photograph(view, values) for view in setup.views if view.held_out]
    if not views:
        return held_out_views(setup, values)  # which says so
    body = _skinned(setup)
    return without_hidden(body, cameras_of(body, views), values)


def markers_worn(setup: Setup, values: Values) -> Given:
    """Each of the 41 default markers."""
    body = _skinned(setup)
    return marker_candidates(body, default_markers(body))


def keypoints_seen(setup: Setup, values: Values) -> Given:
    """Each keypoint, seen once more by the first camera."""
    view = _view(setup)
    return keypoint_candidates(_body(setup), view.camera, values)


CANDIDATES: Mapping[str, Callable[[Setup, Values], Given]] = {
    OWN: own_candidates,
    "cameras": cameras_around,
    "views": held_out_views,
    "cameras-occluded": cameras_around_occluded,
    "views-occluded": held_out_views_occluded,
    "markers": markers_worn,
    "keypoints": keypoints_seen,
}
QUANTITIES: Mapping[str, Callable[[Setup, Values], Quantity]] = {
    "stature": lambda setup, values: stature_of(_skinned(setup)),
    "depth": lambda setup, values: depth_of(_body(setup), _view(setup).camera, values),
}


def sd_named(name: str, setup: Setup, values: Values) -> Criterion:
    """The standard deviation of a quantity of the catalogue, or else of the entry of that name."""
    return sd_of(QUANTITIES[name](setup, values) if name in QUANTITIES else name)


def _body(setup: Setup) -> Body:
    if setup.body is None or setup.moving is not None:
        raise BadArgument(
            "cameras, markers, keypoints, stature and depth are of a problem that fits a body in "
            "one frame, and this one does not; define `candidates` in the file of the problem and "
            f"give --candidates {OWN}"
        )
    return setup.body


def _skinned(setup: Setup) -> SkinnedBody:
    body = _body(setup)
    if not isinstance(body, SkinnedBody):
        raise BadArgument(
            "markers and stature are those of a skinned body, not of one of triangles"
        )
    return body


def _view(setup: Setup) -> View:
    for view in setup.views:
        if not view.held_out:
            return view
    raise BadArgument("no camera sees the body of this problem")


def _joints(body: Body, values: Values) -> Array:
    return np.asarray(body.joints(*(values[block.name] for block in body.blocks())))


def _photograph(view: View, values: Values) -> Photograph:
    focal, centre, distortion, rotation, t = (values[block.name] for block in view.camera.blocks)
    K = np.array([[focal[0], 0, centre[0]], [0, focal[1], centre[1]], [0, 0, 1]])
    R = matrix_from_vector(rotation)
    return Photograph(view.name, view.size, view.observed, view.confidence, K, R, t, distortion)
