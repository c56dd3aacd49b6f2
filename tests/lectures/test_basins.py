"""From which starts a registration ends at the truth: maps, their reach and their figures."""

import numpy as np
import pytest
import trimesh

from workbench.errors import BadArgument, UnknownName
from workbench.geometry.rigid import Similarity
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.surface_tree import SurfaceTree
from workbench.lectures.material.basins import (
    BasinMap,
    basin_map,
    caption_basins,
    grid,
    plot_basins,
)
from workbench.plots import png, sheet
from workbench.registration import Alignment, Icp, IcpIterate, Stopped, random_surface_points

RNG = np.random.default_rng(5)
POINTS = RNG.normal(size=(60, 3))
PLACE = Similarity(matrix_from_vector([0.5, -1.0, 0.2]), np.array([1.0, 2.0, -3.0]))


def ended(motion: Similarity) -> Alignment:
    """A registration that stays where it began."""
    return Alignment(motion, Stopped.SETTLED, (IcpIterate(motion, 0.0, 0.0, 1.0, 0.0),))


def test_basin_map_measures_turns_and_distances() -> None:
    told: list[tuple[int, int]] = []
    found = basin_map(ended, POINTS, PLACE, ("z",), 45, progress=lambda *at: told.append(at))
    assert found.angles[:, 0].tolist() == [-135, -90, -45, 0, 45, 90, 135, 180]
    np.testing.assert_allclose(found.turned, np.abs(found.angles[:, 0]), atol=1e-5)
    right = PLACE(POINTS) - PLACE(POINTS).mean(axis=0)
    radius = np.linalg.norm(right[:, :2], axis=1).mean()  # the turn is about the mean
    expected = 2 * np.sin(np.radians(np.abs(found.angles[:, 0])) / 2) * radius
    np.testing.assert_allclose(found.off, expected, atol=1e-12)
    assert found.found.tolist() == [angle == 0 for angle in found.angles[:, 0]]
    assert found.reach == 0
    assert told == [(k, 8) for k in range(1, 9)]


def test_starts_about_two_axes_compose() -> None:
    starts: list[Similarity] = []

    def align(start: Similarity) -> Alignment:
        starts.append(start)
        return ended(start)

    found = basin_map(align, POINTS, PLACE, ("x", "y"), 90.0)
    assert found.angles.shape == (16, 2)
    for start, (x, y) in zip(starts, np.radians(found.angles), strict=True):
        R = matrix_from_vector([0, y, 0]) @ matrix_from_vector([x, 0, 0]) @ PLACE.R
        np.testing.assert_allclose(start.R, R, atol=1e-14)
        middle = PLACE(POINTS).mean(axis=0)
        np.testing.assert_allclose(start(POINTS).mean(axis=0), middle, atol=1e-12)


def test_reach_ends_at_the_first_lost_start() -> None:
    for angles, lost, reach in [
        ((-60, -30, 0, 30, 60, 90), (), 90),
        ((-60, -30, 0, 30, 60, 90), (-60,), 30),
        ((-30, 0, 30), (30,), 0),
        ((-30, 0, 30), (0,), np.nan),
    ]:
        S = len(angles)
        off = np.isin(angles, lost).astype(float)
        ends = np.zeros(S), off, np.full(S, 7), (Stopped.SETTLED,) * S
        found = BasinMap(("y",), np.array(angles, dtype=float)[:, None], *ends)
        np.testing.assert_equal(found.reach, reach)


def test_grid_has_no_start_twice() -> None:
    for step, count in [(180.0, 2), (120.0, 3), (100.0, 3), (30.0, 12)]:
        angles = grid(["y"], step)[:, 0]
        assert len(angles) == len({angle % 360 for angle in angles}) == count
        assert 0 in angles
        assert np.all(np.diff(angles) == step)


def test_bad_grids_are_refused() -> None:
    with pytest.raises(UnknownName, match="no axis is called 'w'; there are x, y, z"):
        grid(["w"], 30.0)
    for axes, step, said in [
        (["y", "y"], 30.0, "several different ones, not 'y and y'"),
        ([], 30.0, "one axis or several"),
        (["y"], 0.0, "above 0 and at most 180 degrees"),
        (["y"], 181.0, "above 0 and at most 180 degrees"),
        (["y"], np.nan, "above 0 and at most 180 degrees"),
    ]:
        with pytest.raises(BadArgument, match=said):
            grid(axes, step)


@pytest.mark.thorough
def test_ellipsoid_has_known_basins() -> None:
    """Known basins: an ellipsoid looks the same after a half-turn about each of its axes."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    vertices, still = (
        np.asarray(ball.vertices) * [0.3, 0.5, 0.8],
        Similarity(np.eye(3), np.zeros(3)),
    )
    surface = SurfaceTree(vertices, ball.faces)
    points, _ = random_surface_points(vertices, ball.faces, 200, RNG)
    found = basin_map(lambda start: Icp().align(points, surface, start), points, still, ("y",))
    angles = np.abs(found.angles[:, 0])
    np.testing.assert_array_equal(found.found[angles != 90], angles[angles != 90] < 90)
    np.testing.assert_allclose(found.turned[angles > 90], 180, atol=0.01)


def made_up(*axes: str, within: float = 60.0) -> BasinMap:
    """Starts up to an angle end at the truth, the others half a turn away."""
    angles = grid(axes, 30.0)
    found = np.abs(angles).max(axis=1) <= within
    S = len(angles)
    ends = np.where(found, 0.1, 180.0), np.where(found, 1e-4, 0.4)
    return BasinMap(axes, angles, *ends, np.full(S, 9), (Stopped.SETTLED,) * S)


def test_basins_fill_starts_that_end_at_the_truth() -> None:
    figure, (ax,) = sheet(6, 4)
    assert plot_basins([made_up("y"), made_up("z", within=30)], ax=ax) is ax
    assert png(figure).startswith(b"\x89PNG")
    line, filled, empty, *others = ax.get_lines()
    assert line.get_xdata().tolist() == list(range(-150, 181, 30))
    assert filled.get_xdata().tolist() == [-60, -30, 0, 30, 60]
    assert set(empty.get_ydata()) == {180.0}
    assert empty.get_markerfacecolor() == "white"
    assert others[1].get_xdata().tolist() == [-30, 0, 30]
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["about y", "about z"]
    assert "degrees" in ax.get_xlabel()
    assert "degrees" in ax.get_ylabel()


def test_caption_says_how_far_a_basin_reaches() -> None:
    nowhere = made_up("z", within=-1)
    said = caption_basins([made_up("y"), nowhere])
    assert "truth for angles up to 60 degrees about y; for no range of angles about z." in said
    assert "within 20 mm on average" in said


def test_basins_refuse_maps_of_other_axes() -> None:
    _, (ax,) = sheet(4, 3)
    for maps in ([], [made_up("x", "y")]):
        with pytest.raises(BadArgument, match="maps of one axis"):
            plot_basins(maps, ax=ax)
        with pytest.raises(BadArgument, match="maps of one axis"):
            caption_basins(maps)
