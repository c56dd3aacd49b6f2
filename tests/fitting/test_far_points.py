"""Scans with points far away are read as if these were not there, or refused."""

from pathlib import Path

import numpy as np
import pytest

from workbench import load_body
from workbench.fitting.scans.files import read_scan
from workbench.fitting.scans.scan import BadScan
from workbench.fitting.scans.surface import means_of_cells, outline


def person(times: int = 5) -> np.ndarray:
    points = np.repeat(load_body("small").vertices(), times, axis=0)
    return points + np.random.default_rng(0).normal(scale=0.005, size=points.shape)


@pytest.mark.parametrize("far", [1e3, 9e8, 1e300, np.inf])
def test_scan_size_ignores_points_far_away(tmp_path: Path, far: float) -> None:
    points = person()
    others = np.delete(points, 3, axis=0)
    points[3] = far
    np.save(tmp_path / "scan.npy", points)
    scan = read_scan(tmp_path / "scan.npy", unit="m", up="y").scan
    np.testing.assert_allclose(np.sort(scan.points, axis=0), np.sort(others, axis=0), atol=1e-12)


def test_cells_leave_out_points_that_no_index_could_hold() -> None:
    points = person()
    points[3] = 1e300
    means, cell, counts = means_of_cells(points, 50)
    assert len(cell) == len(points) - 1
    assert counts.sum() == len(points) - 1
    assert np.abs(means).max() < 2
    one_place = np.zeros((200, 3))
    assert len(outline(one_place)) == 200


def test_scan_that_is_mostly_one_place_is_refused(tmp_path: Path) -> None:
    points = person(1)
    rng = np.random.default_rng(1)
    points[:150] = 600 * rng.normal(size=(150, 3))
    np.save(tmp_path / "scan.npy", points)
    with pytest.raises(BadScan, match="remove what is far away"):
        read_scan(tmp_path / "scan.npy")
