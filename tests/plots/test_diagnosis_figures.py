"""The figures of a diagnosis: what stands on their axes, and that they show the numbers."""

import numpy as np
import pytest

from tests.diagnostics import cases
from workbench import Block, Problem, Residual, diagnose
from workbench.plots import (
    caption_sigmas,
    plot_sigmas,
    sheet,
)

pytestmark = pytest.mark.browser


def test_sigmas_shade_what_is_unknown() -> None:
    found = diagnose(*cases.joints_only())
    _, (ax,) = sheet(8, 4)
    plot_sigmas(found, ax=ax)
    blind = ~np.isfinite(found.identifiability.sigma)
    assert 0 < blind.sum() < blind.size
    for line in ax.lines:  # edges of blocks are lines across, with two points
        x = np.asarray(line.get_xdata(), dtype=float)
        if line.get_linestyle() == "None":
            assert not blind[x.astype(int)].any()
    edges = [patch.get_extents().transformed(ax.transData.inverted()) for patch in ax.patches]
    shaded = np.zeros(blind.size, dtype=bool)
    for box in edges:
        shaded[int(np.ceil(box.x0)) : int(np.floor(box.x1)) + 1] = True
    np.testing.assert_array_equal(shaded, blind)
    assert "shaded strips" in caption_sigmas(found)
    assert "triangles" not in caption_sigmas(found)


def test_sigmas_of_nothing_known_have_no_numbers() -> None:
    x = Block("x", (2,))
    found = diagnose(Problem([Residual("r", x.symbol[0] + x.symbol[1], 1.0)], "x"), {"x": [0, 0]})
    _, (ax,) = sheet(8, 4)
    plot_sigmas(found, ax=ax)
    assert not ax.get_yticks().size
    (legend,) = (text.get_text() for text in ax.get_legend().get_texts())
    assert legend == "unknown: no finite standard deviation"
