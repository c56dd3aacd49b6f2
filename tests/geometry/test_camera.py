"""A camera against OpenCV's model evaluated by hand, its derivatives, and triangulation."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from workbench.blocks import Values
from workbench.errors import BadCamera, MissingValue, NotNumbers, ShapeMismatch
from workbench.geometry.camera import Camera, triangulate

RNG = np.random.default_rng(0)
POINTS = RNG.normal(scale=0.5, size=(7, 3))
K = np.array([[900.0, 0, 640], [0, 950.0, 360], [0, 0, 1]])
DISTORTION = (-0.2, 0.05, 0.003, -0.002, 0.01)


def looking(turn: tuple[float, float, float], camera: Camera, distortion=()) -> Values:
    R = Rotation.from_rotvec(turn).as_matrix()
    return camera.values(K=K, R=R, t=(0.1, -0.2, 4.0), distortion=distortion)


def opencv(points: np.ndarray, R: np.ndarray, t: np.ndarray, k: tuple) -> np.ndarray:
    """projectPoints of OpenCV's calib3d documentation, one point at a time."""
    k1, k2, p1, p2, k3 = k
    pixels = []
    for X in points:
        xc, yc, zc = R @ X + t
        x, y = xc / zc, yc / zc
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        pixels.append((K @ (xd, yd, 1))[:2])
    return np.array(pixels)


@pytest.mark.parametrize("distortion", [(0.0,) * 5, DISTORTION], ids=["pinhole", "lens"])
def test_pixels_are_those_of_opencv(distortion: tuple) -> None:
    camera = Camera("cam/")
    values = looking((0.3, -2.0, 0.5), camera, distortion)
    R = Rotation.from_rotvec((0.3, -2.0, 0.5)).as_matrix()
    expected = opencv(POINTS, R, np.array([0.1, -0.2, 4.0]), distortion)
    np.testing.assert_allclose(camera.pixels(POINTS, values), expected, rtol=1e-12)


def rig(distortion=()) -> tuple[list[Camera], Values]:
    cameras = [Camera(f"{i}/") for i in range(3)]
    turns = ((0.0, 0.1, 0.0), (0.0, 1.5, 0.2), (0.3, -1.4, 0.0))
    values: Values = {}
    for camera, turn in zip(cameras, turns, strict=True):
        values |= looking(turn, camera, distortion)
    return cameras, values


def test_triangulation_finds_points_again() -> None:
    cameras, values = rig()
    pixels = [camera.pixels(POINTS, values) for camera in cameras]
    confidence = RNG.uniform(0.2, 1, (3, len(POINTS)))
    found = triangulate(cameras, values, pixels, confidence)
    np.testing.assert_allclose(found, POINTS, atol=1e-12)


def test_triangulation_needs_two_cameras() -> None:
    cameras, values = rig()
    pixels = [camera.pixels(POINTS, values) for camera in cameras]
    confidence = np.ones((3, len(POINTS)))
    confidence[:2, 0] = 0  # one view left
    pixels[0][1] = np.nan  # two views left, whatever the confidence says
    found = triangulate(cameras, values, pixels, confidence)
    assert np.isnan(found[0]).all()
    np.testing.assert_allclose(found[1:], POINTS[1:], atol=1e-12)
    for some, seen in (([], []), ([Camera()], []), ([], [np.zeros((2, 2))])):
        with pytest.raises(BadCamera, match="give both for each camera"):
            triangulate(some, {}, seen, [np.ones(2)] * len(seen))


def test_depth_is_positive_in_front() -> None:
    camera = Camera()
    values = camera.values(K=K, t=(0, 0, 2.0))
    depths = camera.depths([[0.3, 0.1, 1.0], [0.0, 0.5, -2.5]], values)
    np.testing.assert_allclose(depths, [3.0, -0.5])
    turned = looking((0.3, -2.0, 0.5), camera)
    R = Rotation.from_rotvec((0.3, -2.0, 0.5)).as_matrix()
    np.testing.assert_allclose(camera.depths(POINTS, turned), (POINTS @ R.T)[:, 2] + 4.0)


BAD_CALIBRATIONS: list[tuple[dict[str, Any], str]] = [
    ({"K": np.eye(2)}, "not .2, 2."),
    ({"K": np.eye(3), "distortion": np.ones(8)}, "up to five distortion coefficients"),
    ({"K": [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]}, "0.1.*leave skew out"),
    ({"K": [[np.nan, 0, 0], [0, 1, 0], [0, 0, 1]]}, "finite numbers, but K is"),
    ({"K": np.diag([-900.0, 900, 1])}, "focal lengths above zero"),
    ({"K": K.T}, "transpose K"),
    ({"K": 2 * K}, "divide it"),
    ({"K": K, "R": np.diag([1.0, 1, -1])}, "it mirrors"),
    ({"K": K, "R": 2 * np.eye(3)}, "R must be a rotation"),
    ({"K": K, "t": (0, np.inf, 0)}, "finite numbers, but t is"),
    ({"K": K, "t": None}, "t must be an array of real numbers"),
]


def test_calibration_beyond_the_model_is_refused() -> None:
    for given, said in BAD_CALIBRATIONS:
        with pytest.raises((BadCamera, NotNumbers), match=said):
            Camera().values(**given)


def test_rounded_rotation_is_accepted() -> None:
    R = Rotation.from_rotvec((0.3, -2.0, 0.5)).as_matrix()
    values = Camera().values(K=K, R=R.round(4))
    np.testing.assert_allclose(values["rotation"], (0.3, -2.0, 0.5), atol=1e-3)


def test_points_and_numbers_of_a_camera_are_checked() -> None:
    values = looking((0, 0, 0), Camera())
    for see in (Camera().pixels, Camera().depths):
        with pytest.raises(BadCamera, match=r"points of shape \(\.\.\., 3\), not"):
            see(np.zeros((4, 2)), values)
        with pytest.raises(MissingValue, match="block 'rotation'"):
            see(POINTS, {name: value for name, value in values.items() if name != "rotation"})
        with pytest.raises(ShapeMismatch, match="block 'translation'"):
            see(POINTS, values | {"translation": np.zeros(2)})
        assert np.isnan(np.asarray(see([np.nan, 0, 0], values))).any()  # a point that is nowhere
