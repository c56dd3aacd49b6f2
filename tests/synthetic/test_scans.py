"""Simulated scans: the truth that is kept, every effect by itself, and seeds."""

from typing import Any

import numpy as np
import pytest
import trimesh

from tests.tiers import few
from workbench import load_body
from workbench.errors import BadArgument, BadMesh
from workbench.fitting import BadScan
from workbench.synthetic import (
    Clutter,
    Crate,
    Floor,
    HalfSpace,
    Holes,
    Joining,
    Noise,
    SimulatedScan,
    Specks,
    scan,
    scanners,
)

BODY = load_body("small")
BENT = BODY.vertices(0.3 * np.random.default_rng(1).standard_normal((24, 3)))
FOUR = scanners(4)
SPHERE = trimesh.creation.icosphere(5, 0.5)
WALL = np.array([[-3.0, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]])
WALL_FACES = np.array([[0, 1, 2], [0, 2, 3]])
EVERYTHING: dict[str, Any] = {
    "noise": Noise(),
    "holes": Holes(),
    "steepest": 1.3,
    "clutter": Clutter(),
    "region": HalfSpace((0, -0.4, 0), (0, 1, 0)),
    "joining": Joining(),
}


def of_bent(seed: int = 0, **effects: Any) -> SimulatedScan:
    return scan(BENT, BODY.faces, FOUR, seed=seed, **effects)


def without(effect: str, seed: int = 0) -> SimulatedScan:
    return of_bent(seed, **{name: it for name, it in EVERYTHING.items() if name != effect})


def rays(made: SimulatedScan) -> list[tuple[int, int]]:
    """View and pixel of every point of the body."""
    pixels: list[tuple[int, int]] = []
    for number, scanner in enumerate(FOUR):
        x, y, z = scanner.seen(made.scan.points[(made.view == number) & ~made.clutter]).T
        u, v = np.floor(164 * x / z + 75), np.floor(164 * y / z + 100)
        pixels += [(number, int(pixel)) for pixel in v * 150 + u]
    return pixels


def depths(made: SimulatedScan, points: np.ndarray) -> np.ndarray:
    """The depths of the points of the body, in m, as their scanners see them."""
    by_view = [FOUR[n].seen(points[(made.view == n) & ~made.clutter])[:, 2] for n in range(4)]
    return np.concatenate(by_view)


def errors(made: SimulatedScan) -> dict[tuple[int, int], float]:
    """The error of the depth of every ray of the body, in m."""
    off = depths(made, made.scan.points) - depths(made, made.true_points)
    return dict(zip(rays(made), off.tolist(), strict=True))


def test_same_seed_gives_the_same_scan() -> None:
    one, same, other = (of_bent(seed, **EVERYTHING) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.scan.points, same.scan.points)
    np.testing.assert_array_equal(one.scan.normals, same.scan.normals)
    np.testing.assert_array_equal(one.scan.faces, same.scan.faces)
    np.testing.assert_array_equal(one.seen, same.seen)
    assert not np.array_equal(one.scan.points, other.scan.points)


# Every effect switched off by itself.


def test_noise_moves_points_alone() -> None:
    made, exact = of_bent(**EVERYTHING), without("noise")
    assert rays(made) == rays(exact)
    np.testing.assert_array_equal(made.true_points, exact.true_points)
    np.testing.assert_array_equal(made.seen, exact.seen)
    np.testing.assert_allclose(
        exact.scan.points[~exact.clutter], exact.true_points[~exact.clutter], rtol=0, atol=1e-12
    )
    off = np.linalg.norm(made.scan.points - exact.scan.points, axis=1)  # of clutter as well
    assert 0 < np.median(off[made.clutter]) < 0.02


@pytest.mark.parametrize("effect", ["holes", "steepest", "region"])
def test_losses_leave_other_points_alone(effect: str) -> None:
    made, more = of_bent(**EVERYTHING), without(effect)
    np.testing.assert_array_equal(made.surface, more.surface)
    some, all_of_them = errors(made), errors(more)
    assert some.keys() < all_of_them.keys()
    np.testing.assert_allclose(
        list(some.values()), [all_of_them[ray] for ray in some], rtol=0, atol=1e-12
    )
    assert not (made.seen & ~more.seen).any()
    assert made.seen.sum() < more.seen.sum()


# What each effect does.


@pytest.mark.parametrize("distance", few([2.0, 4.0], 1))
def test_noise_grows_with_the_square_of_the_depth(distance: float) -> None:
    some = scanners(1, distance=distance, focal=400.0)
    made = scan(WALL, WALL_FACES, some, noise=Noise(grazing=0.0), seed=0)
    depth = some[0].seen(made.scan.points)[:, 2] - distance
    assert len(depth) == 30_000
    assert depth.std() == pytest.approx(1.425e-3 * distance**2, rel=0.02)
    assert abs(depth.mean()) < 4 * depth.std() / np.sqrt(30_000)


def test_noise_is_along_the_ray() -> None:
    made = scan(SPHERE.vertices, SPHERE.faces, scanners(1, focal=300.0), noise=Noise(), seed=0)
    (scanner,) = made.scanners
    off, at = made.scan.points - made.true_points, made.true_points - scanner.place
    assert np.abs(np.cross(off, at)).max() < 1e-12
    normals = made.true_points / np.linalg.norm(made.true_points, axis=1, keepdims=True)
    cosine = -(normals * at).sum(axis=1) / np.linalg.norm(at, axis=1)
    sizes = [
        np.std(
            scanner.seen(made.scan.points)[:, 2][some] - scanner.seen(made.true_points)[:, 2][some]
        )
        for some in (cosine > 0.9, cosine < 0.25)
    ]
    theta = np.radians(80)
    assert sizes[1] > 1.1 * sizes[0]
    assert Noise().sigma(np.array([1.0]), np.array([1.56])) == pytest.approx(
        1.425e-3 + 1e-4 * (theta / (np.pi / 2 - theta)) ** 2
    )


def test_normals_are_those_of_the_surface() -> None:
    made = scan(SPHERE.vertices, SPHERE.faces, FOUR, seed=0)
    normals = made.scan.normals
    assert normals is not None
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-12)
    places = np.array([scanner.place for scanner in FOUR])[made.view]
    assert (np.einsum("mi,mi->m", normals, places - made.scan.points) >= 0).all()
    radial = made.scan.points / np.linalg.norm(made.scan.points, axis=1, keepdims=True)
    away = np.degrees(np.arccos(np.einsum("mi,mi->m", normals, radial).clip(-1, 1)))
    assert np.median(away) < 1
    assert np.mean(away < 10) > 0.95
    rough = of_bent(noise=Noise(), seed=0)
    assert rough.scan.normals is not None
    places = np.array([scanner.place for scanner in FOUR])[rough.view]
    facing = np.einsum("mi,mi->m", rough.scan.normals, places - rough.scan.points)
    assert (facing >= 0).all()


def test_normals_and_area_of_a_plane() -> None:
    some = scanners(1, distance=1.0, turn=0.6)
    made = scan(WALL, WALL_FACES, some, seed=0)
    assert made.scan.normals is not None
    assert made.scan.weights is not None
    np.testing.assert_allclose(made.scan.normals, np.tile([0, 0, 1.0], (30_000, 1)), atol=1e-6)
    corners = scan(WALL, WALL_FACES, some, seed=0, joining=Joining(100)).scan
    assert corners.faces is not None
    a, b, c = corners.points[corners.faces].transpose(1, 0, 2)
    between = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2  # half a pixel less around
    assert made.scan.weights.sum() == pytest.approx(between, rel=0.03)
    assert made.scan.weights.sum() > between


@pytest.mark.parametrize(
    ("share", "things"), [(0.0, (Floor(),)), (0.2, (Floor(), Specks())), (0.5, (Crate(),))]
)
def test_clutter_is_the_share_that_was_asked_for(share: float, things: Any) -> None:
    made = of_bent(clutter=Clutter(share, things))
    assert made.clutter.sum() == round(share * made.scan.n_points)
    assert (made.face[made.clutter] == -1).all()
    assert (made.face[~made.clutter] >= 0).all()
    assert np.isnan(made.true_points[made.clutter]).all()
    assert (made.shares[made.clutter] == 0).all()


def test_holes_hold_no_points() -> None:
    whole, made = of_bent(), of_bent(holes=Holes(5, 0.08))
    discs = Holes(5, 0.08).discs(BENT, BODY.faces, np.random.default_rng((0, 1)))
    normals = np.cross(
        BENT[BODY.faces[:, 1]] - BENT[BODY.faces[:, 0]],
        BENT[BODY.faces[:, 2]] - BENT[BODY.faces[:, 0]],
    )
    assert not discs.hold(made.scan.points, normals[made.face]).any()
    lost = discs.hold(whole.scan.points, normals[whole.face])
    assert lost.sum() == whole.scan.n_points - made.scan.n_points > 0


def test_scans_of_nothing_are_refused() -> None:
    usual = {"vertices": BENT, "faces": BODY.faces, "scanners": FOUR, "seed": 0}
    away = Crate(away=30.0, angle=np.pi / 4)
    bad: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"scanners": ()}, BadArgument, "scanners of a simulated scan"),
        ({"seed": -1}, BadArgument, "seed of a simulated scan"),
        ({"scanners": scanners(1, target=(0, 0, -10))}, BadScan, "measure nothing"),
        ({"region": HalfSpace((5, 5, 5), (1, 1, 1))}, BadScan, "measure nothing"),
        ({"faces": BODY.faces + 1}, BadMesh, "there are 369 vertices"),
        ({"vertices": np.full_like(BENT, np.nan)}, BadMesh, "vertex 0 is"),
        ({"clutter": Clutter(0.2, (away,))}, BadArgument, "hardly anything of the clutter"),
    ]
    for arguments, error, says in bad:
        with pytest.raises(error, match=says):
            scan(**usual | arguments)


def test_effects_that_make_no_sense_are_refused() -> None:
    with pytest.raises(BadArgument, match="growth of noise"):
        Noise(growth=-1.0)
    with pytest.raises(BadArgument, match="radius of holes"):
        Holes(radius=np.nan)
    with pytest.raises(BadArgument, match="a share from 0"):
        Clutter(1.0)
