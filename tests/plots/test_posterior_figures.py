"""Figures of a posterior show what they say."""

import numpy as np
import pytest

from tests.sampling.densities import gaussian
from workbench import laplace
from workbench.plots.posterior import traces_sheet


@pytest.fixture(scope="module")
def posterior() -> object:
    return laplace(gaussian(np.eye(8)), {"x": np.zeros(8)}, draws=400)


def test_traces_have_an_axis_for_each_entry(posterior: object) -> None:
    figure = traces_sheet(posterior, [0, 3, 5])  # type: ignore[arg-type]
    assert [ax.get_ylabel() for ax in figure.axes] == [f"x\n[{i}] (1)" for i in (0, 3, 5)]
    assert figure.axes[-1].get_xlabel() == "step of each walker"
