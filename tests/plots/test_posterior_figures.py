"""Figures of a posterior show what they say."""

import numpy as np
import pytest

from tests.sampling.densities import gaussian
from workbench import laplace
from workbench.plots.posterior import silhouette, traces_sheet


@pytest.fixture(scope="module")
def posterior() -> object:
    return laplace(gaussian(np.eye(8)), {"x": np.zeros(8)}, draws=400)


def test_silhouette_covers_its_pixels_only() -> None:
    square = np.array([[2.0, 3.0], [7.0, 3.0], [7.0, 9.0], [2.0, 9.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    covered = silhouette(square, faces, np.zeros(2), 0.1, (120, 100))
    assert covered[31:89, 21:69].all()
    covered[29:92, 19:72] = False
    assert not covered.any()


def test_silhouette_leaves_out_what_is_not_finite() -> None:
    corners = np.array([[-5.0, -5.0], [np.nan, 0.0], [0.0, 500.0]])
    assert not silhouette(corners, np.array([[0, 1, 2]]), np.zeros(2), 1.0, (10, 10)).any()


def test_traces_have_an_axis_for_each_entry(posterior: object) -> None:
    figure = traces_sheet(posterior, [0, 3, 5])  # type: ignore[arg-type]
    assert [ax.get_ylabel() for ax in figure.axes] == [f"x\n[{i}] (1)" for i in (0, 3, 5)]
    assert figure.axes[-1].get_xlabel() == "step of each walker"
