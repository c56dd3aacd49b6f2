"""A cloud as a target."""

import numpy as np
import pytest

from workbench.errors import BadArgument
from workbench.registration import PointCloud

RNG = np.random.default_rng(0)
CLOUD = RNG.normal(size=(40, 3))
NORMALS = CLOUD / np.linalg.norm(CLOUD, axis=1, keepdims=True)
ASKED = RNG.normal(size=(15, 3))


def test_the_nearest_point_is_found() -> None:
    every = np.linalg.norm(ASKED[:, None] - CLOUD, axis=2)
    found = PointCloud(CLOUD).closest(ASKED)
    np.testing.assert_array_equal(found.faces, every.argmin(axis=1))
    np.testing.assert_allclose(found.distances, every.min(axis=1), atol=1e-15)
    np.testing.assert_array_equal(found.points, CLOUD[found.faces])
    np.testing.assert_array_equal(found.normals, np.zeros((15, 3)))
    np.testing.assert_array_equal(found.shares, np.tile([1.0, 0, 0], (15, 1)))


def test_the_gate_and_the_normals_decide() -> None:
    every = np.linalg.norm(ASKED[:, None] - CLOUD, axis=2)
    n = ASKED / np.linalg.norm(ASKED, axis=1, keepdims=True)
    every[n @ NORMALS.T < 0.8] = np.inf
    found = PointCloud(CLOUD[:16], NORMALS[:16]).closest(ASKED, 0.9, n, 0.8)
    least = every[:, :16].min(axis=1)
    there = least <= 0.9
    assert 0 < there.sum() < 15
    np.testing.assert_array_equal(found.faces, np.where(there, every[:, :16].argmin(axis=1), -1))
    np.testing.assert_array_equal(found.distances, np.where(there, least, 0.9))
    np.testing.assert_array_equal(found.points[~there], ASKED[~there])
    assert not found.normals[~there].any()
    np.testing.assert_array_equal(found.normals[there], NORMALS[found.faces[there]])


def test_a_single_point_is_a_cloud() -> None:
    one = PointCloud([[1.0, 2.0, 3.0]], [[0.0, 1.0, 0.0]])
    assert one.closest(ASKED, normals=-ASKED * 0 + [0, 1, 0]).faces.tolist() == [0] * 15


@pytest.mark.parametrize(
    ("points", "normals", "said"),
    [
        (np.zeros((0, 3)), None, "the points of a cloud must be finite"),
        (np.zeros((4, 2)), None, r"not of shape \(4, 2\)"),
        ([[np.nan, 0, 0]], None, "leave out points that were not measured"),
        (CLOUD, NORMALS[:3], "a cloud of 40 points was given 3 normals"),
    ],
)
def test_what_is_no_cloud_is_told(points, normals, said) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(BadArgument, match=said):
        PointCloud(points, normals)
