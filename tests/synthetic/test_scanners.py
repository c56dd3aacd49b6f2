"""Scanners and what they hit, against formulas and against every ray with every triangle."""

import numpy as np
import pytest
import trimesh

from tests.tiers import few
from workbench import load_body
from workbench.errors import BadArgument
from workbench.geometry.camera import Camera
from workbench.synthetic import Scanner, scanners
from workbench.synthetic.scanners import depth_image, visible

CUBE = trimesh.creation.box((0.6, 0.6, 0.6))
BODY = load_body("small")
BENT = BODY.vertices(0.4 * np.random.default_rng(1).standard_normal((24, 3)))


def every_hit(
    vertices: np.ndarray, faces: np.ndarray, origin: np.ndarray, rays: np.ndarray
) -> np.ndarray:
    """How far along each ray (R, 3) each face is hit, (R, F), in lengths of the ray; else inf."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    far = np.full((len(rays), len(faces)), np.inf)
    for i, d in enumerate(rays):
        M = np.stack([a - b, a - c, np.broadcast_to(d, a.shape)], axis=2)
        solvable = np.abs(np.linalg.det(M)) > 1e-14
        x = np.linalg.solve(M[solvable], (a - origin)[solvable][:, :, None])[:, :, 0]
        hit = (x[:, 0] >= -1e-12) & (x[:, 1] >= -1e-12) & (x[:, 0] + x[:, 1] <= 1 + 1e-12)
        far[i, np.flatnonzero(solvable)[hit]] = x[hit, 2]
    return far


def test_scanners_look_at_the_target_upright() -> None:
    target = np.array([0.1, 0.2, -0.3])
    some = scanners(4, distance=2.0, height=0.5, target=target, turn=0.3)
    for scanner in some:
        np.testing.assert_allclose(scanner.R @ scanner.R.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(scanner.R) == pytest.approx(1)
        x, y, z = scanner.seen(target)
        assert (x, y) == pytest.approx((0, 0), abs=1e-15)
        assert z == pytest.approx(np.hypot(2, 0.5))
        up = scanner.seen(target + [0, 0.1, 0])
        assert up[0] == pytest.approx(0, abs=1e-15)
        assert up[1] < 0  # y of the image points down
    left = scanners(4)[1]  # of a body that faces +z, the left side is at +x
    np.testing.assert_allclose(left.place, [2, 0, 0], atol=1e-15)


def test_rays_go_through_the_middles_of_pixels() -> None:
    (scanner,) = scanners(1, height=0.4, turn=1.0, size=(7, 5))
    camera = Camera()
    values = camera.values(K=scanner.K, R=scanner.R, t=scanner.t)
    pixels = camera.pixels(scanner.place + 1.7 * scanner.directions(), values)
    u, v = np.meshgrid(np.arange(7) + 0.5, np.arange(5) + 0.5)
    np.testing.assert_allclose(pixels, np.stack([u.ravel(), v.ravel()], axis=1), atol=1e-9)
    np.testing.assert_allclose(scanner.seen(scanner.place + scanner.directions())[:, 2], 1)


def test_depth_of_a_cube() -> None:
    image = depth_image(CUBE.vertices, CUBE.faces, scanners(1, distance=2.0)[0])
    np.testing.assert_allclose(image.depth, 1.7, rtol=1e-15)
    assert len(image.pixel) == (2 * round(164 * 0.3 / 1.7)) ** 2  # no pixel of the diagonal is lost


def test_depth_image_agrees_with_an_exhaustive_search() -> None:
    (scanner,) = scanners(1, distance=2.0, turn=0.5, size=(24, 30), focal=25.0)
    image = depth_image(BENT, BODY.faces, scanner)
    far = every_hit(BENT, BODY.faces, scanner.place, scanner.directions()).min(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(far)), image.pixel)
    np.testing.assert_allclose(image.depth, far[image.pixel], rtol=1e-12)


@pytest.mark.parametrize("turn", few([1.1, 0.0], 1))
def test_points_lie_on_their_triangles(turn: float) -> None:
    (scanner,) = scanners(1, turn=turn, height=0.3)
    image = depth_image(BENT, BODY.faces, scanner)
    points = scanner.place + image.depth[:, None] * scanner.directions()[image.pixel]
    corners = BENT[BODY.faces[image.face]]
    np.testing.assert_allclose(
        np.einsum("hk,hki->hi", image.shares, corners), points, rtol=0, atol=1e-12
    )
    assert image.shares.min() >= 0
    np.testing.assert_allclose(image.shares.sum(axis=1), 1, rtol=1e-14)


def test_visibility_agrees_with_an_exhaustive_search() -> None:
    (scanner,) = scanners(1, turn=0.5, height=0.2)
    far = every_hit(BENT, BODY.faces, scanner.place, BENT - scanner.place)
    expected = far.min(axis=1) > 1 - 1e-7
    seen = visible(BENT, BODY.faces, scanner)
    np.testing.assert_array_equal(seen, expected)
    assert 0.2 < seen.mean() < 0.6


def test_scanners_that_cannot_be_are_refused() -> None:
    with pytest.raises(BadArgument, match="n of scanners"):
        scanners(0)
    with pytest.raises(BadArgument, match="straight down or up"):
        scanners(1, distance=0.01, height=2.0)
    with pytest.raises(BadArgument, match="focal of a scanner"):
        Scanner(np.eye(3), np.zeros(3), focal=0.0)
