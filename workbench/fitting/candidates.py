"""Measurements of a body that could be made, and the catalogue of them that `design` takes.

All of them see every landmark, also those that the body itself hides.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.blocks.checks import above_zero, reals
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.diagnostics.design import Candidate, Criterion, Quantity, sd_of
from workbench.diagnostics.design.candidates import Given
from workbench.errors import BadArgument
from workbench.fitting.body_priors import stature_expression
from workbench.fitting.keypoints import camera_values, landmark_set
from workbench.fitting.marker_sets import MARKERS, MarkerSet, default_markers
from workbench.fitting.markers import OFFSET_SIGMA, SIGMA
from workbench.fitting.observations import Photograph, pinhole
from workbench.fitting.setup import Setup, View
from workbench.geometry.camera import Camera
from workbench.geometry.rotation import matrix_from_vector
from workbench.residuals import Residual, keypoints, landmarks

AZIMUTHS = tuple(range(0, 360, 30))  # degrees
ELEVATIONS = (0, 30, 60)  # degrees
PREFIX = "candidate/"  # of the blocks of a camera that could be put up
OWN = "own"


def looking_at(centre: ArrayLike, around: float, up: float, distance: float) -> tuple[Array, Array]:
    """R (3, 3) and t (3,) m of an upright camera that looks at a point (3,) m.

    It stands `distance` m away, `around` degrees about the y axis (0 is in front, at +z, and 90 at
    +x) and `up` degrees above the height of the point. Straight above, the top of its image is
    away from where it would stand on the ground.
    """
    a, e = np.radians([around, up])
    towards = -np.array([np.cos(e) * np.sin(a), np.sin(e), np.cos(e) * np.cos(a)])
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    R = np.array([right, np.cross(towards, right), towards])
    return R, distance * np.array([0.0, 0.0, 1.0]) - R @ np.asarray(centre, dtype=float)


def cameras_on_a_sphere(
    body: Body,
    centre: ArrayLike,
    *,
    distance: float = 4.0,
    around: Sequence[float] = AZIMUTHS,
    up: Sequence[float] = ELEVATIONS,
    focal: float = 1200.0,
    size: tuple[int, int] = (1000, 1000),
    sigma: float = 4.0,
) -> dict[str, Candidate]:
    """Cameras around a point (3,) m, each of which sees the body's keypoints.

    Angles are in degrees, see `looking_at`; focal and sigma are in px. They are called `90 around,
    30 up`. Raises BadArgument for a centre that is no point, or a distance that is not above zero.
    """
    middle = reals("the centre of the cameras", centre)
    if middle.shape != (3,) or not np.isfinite(middle).all():
        raise BadArgument(f"the centre of the cameras is a point (3,) in m, not {middle.tolist()}")
    above_zero("cameras", distance=distance, focal=focal, sigma=sigma)
    K, numbers = pinhole(focal, *size), {}
    for u in up:
        for a in around:
            R, t = looking_at(middle, a, u, distance)
            numbers[f"{a:g} around, {u:g} up"] = Camera(PREFIX).values(K=K, R=R, t=t)
    return _cameras(body, numbers, sigma)


def cameras_of(
    body: Body, photographs: Sequence[Photograph], *, sigma: float = 4.0
) -> dict[str, Candidate]:
    """Cameras that exist: those of photographs, by their names. What they observed does not count.

    Each sees all keypoints of the body, with a sigma in px. Raises BadArgument for a camera without
    a calibration.
    """
    for photo in photographs:
        if photo.K is None or photo.R is None or photo.t is None:
            raise BadArgument(
                f"{photo.name} has no calibration; a camera that could be put up needs K, R and t"
            )
    camera = Camera(PREFIX)
    return _cameras(
        body, {photo.name: camera_values(camera, photo) for photo in photographs}, sigma
    )


def _cameras(body: Body, numbers: dict[str, Values], sigma: float) -> dict[str, Candidate]:
    count = len(body.landmark_names(landmark_set(body)))
    seen = _keypoints(body, Camera(PREFIX), np.ones(count), sigma)
    return {name: Candidate((seen,), values) for name, values in numbers.items()}


def marker_candidates(
    body: SkinnedBody,
    marker_set: MarkerSet,
    *,
    sigma: float = SIGMA,
    offset_sigma: float = OFFSET_SIGMA,
) -> dict[str, Candidate]:
    """Each marker of a set by itself, seen once; sigmas in m along each axis.

    A marker is beside its nominal place by an offset that one moment cannot tell from the body, so
    its rows have the standard deviation sqrt(sigma^2 + offset_sigma^2).
    """
    names = marker_set.names
    seen = Block(PREFIX + "seen", (len(names),), "1", names)  # weights, which count one alone
    symbols = [block.symbol for block in body.blocks()]
    points = marker_set.on(body).landmark_points(MARKERS, *symbols)
    origin = np.zeros((len(names), 3))
    spread = float(np.hypot(sigma, offset_sigma))
    rows = replace(landmarks(points, origin, sigma=spread, name=MARKERS), weights=seen.symbol)
    only = np.eye(len(names))
    return {label: Candidate((rows,), {seen.name: only[i]}) for i, label in enumerate(names)}


def stature_of(body: SkinnedBody) -> Quantity:
    """The stature of a body in m, a linear function of its betas; see `stature`."""
    betas = body.blocks()[1]
    expression = stature_expression(body, betas.symbol)
    return Quantity("stature", expression, "m", blocks=(betas,))


def depth_of(body: Body, camera: Camera, numbers: Values) -> Quantity:
    """How far the body's root is from a camera's plane, in m along the axis of the camera."""
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    axis = cs.DM(matrix_from_vector(np.asarray(numbers[camera.rotation.name], dtype=float))[2])
    away = float(np.asarray(numbers[camera.translation.name], dtype=float)[2])
    name = f"the distance from {camera.prefix.rstrip('/') or 'the camera'}"
    return Quantity(name, cs.dot(axis, joints.symbol[:, 0]) + away, "m", (joints,))


def _keypoints(body: Body, camera: Camera, confidence: cs.MX | Array, sigma: float) -> Residual:
    """The residual of all keypoints of a body in a camera, for its Jacobian alone."""
    name = landmark_set(body)
    points = body.landmark_points(name, *(block.symbol for block in body.blocks()))
    origin = np.zeros((len(body.landmark_names(name)), 2))
    return keypoints(points, camera, origin, confidence, sigma=sigma, name="keypoints")


Candidates = Callable[[Setup, Values], Given]


def own_candidates(setup: Setup, values: Values) -> Given:
    """Those that the setup or the user's file names."""
    if not setup.candidates:
        raise BadArgument(
            "this problem names no candidates of its own; define `candidates` in the file, a dict "
            f"of residuals by name, or give --candidates {', '.join(CANDIDATES)}"
        )
    return setup.candidates


def cameras_around(setup: Setup, values: Values) -> dict[str, Candidate]:
    """36 cameras 4 m from the body's root."""
    body = _body(setup)
    root = body.joints(*(values[block.name] for block in body.blocks()))[0]
    return cameras_on_a_sphere(body, root)


def held_out_views(setup: Setup, values: Values) -> dict[str, Candidate]:
    """The real cameras of the setup that were held out."""
    numbers = {
        view.name: {
            block.name: values[own.name]
            for block, own in zip(Camera(PREFIX).blocks, view.camera.blocks, strict=True)
        }
        for view in setup.views
        if view.held_out
    }
    if not numbers:
        raise BadArgument("no camera of this problem is held out; hold one out, or take cameras")
    return _cameras(_body(setup), numbers, 4.0)


CANDIDATES: Mapping[str, Candidates] = {
    OWN: own_candidates,
    "cameras": cameras_around,
    "views": held_out_views,
    "markers": lambda setup, values: marker_candidates(
        _skinned(setup), default_markers(_skinned(setup))
    ),
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
