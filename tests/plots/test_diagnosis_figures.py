"""Figures of a diagnosis, a design and a posterior show the numbers."""

from functools import partial
from itertools import pairwise

import casadi as cs
import numpy as np
import pytest
from matplotlib.axes import Axes

import workbench as wb
from tests.diagnostics import cases
from tests.sampling.densities import gaussian
from workbench import Block, Diagnosis, Problem, Residual, diagnose, laplace
from workbench.diagnostics import MeasurementDesign
from workbench.plots import (
    caption_measurement_ranking,
    caption_sigmas,
    caption_singular_values,
    caption_sparsity,
    plot_measurement_ranking,
    plot_sigmas,
    plot_singular_values,
    plot_sparsity,
    png,
    sheet,
)
from workbench.plots.diagnosis import PIXELS, squeezed
from workbench.plots.palette import VERMILLION
from workbench.plots.posterior import traces_sheet
from workbench.plots.style import figure_of

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


def found(known: int, count: int) -> MeasurementDesign:
    rng = np.random.default_rng(0)
    x = wb.Block("x", (3,), "m")

    def rows(name: str, A: np.ndarray) -> wb.Residual:
        return wb.Residual(name, cs.DM(A) @ x.symbol, 1.0, blocks=(x,))

    problem = wb.Problem([rows("known", rng.normal(size=(known, 3)))], ["x"], blocks=[x])
    several = {f"candidate {i}": rows("c", rng.normal(size=(1, 3))) for i in range(count)}
    return wb.design(problem, several, {"x": np.zeros(3)}, choose=2)


def axes() -> Axes:
    return sheet(6, 4)[1][0]


def test_ranking_draws_every_candidate() -> None:
    design = found(4, 5)
    ax = plot_measurement_ranking(design, ax=axes())
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert labels == [one.name for one in design.ranking]
    drawn = {line.get_label(): np.sort(line.get_xdata()) for line in ax.get_lines()}
    np.testing.assert_allclose(
        drawn["chosen"],
        np.sort([one.sd for one in design.ranking if one.name in design.chosen]),
    )
    assert len(drawn["not chosen"]) == 3
    assert drawn["before"][0] == design.before.sd
    assert "by D-optimality" in caption_measurement_ranking(design)


@pytest.fixture(scope="module")
def posterior() -> object:
    return laplace(gaussian(np.eye(8)), {"x": np.zeros(8)}, draws=400)


def test_traces_have_an_axis_for_each_entry(posterior: object) -> None:
    figure = traces_sheet(posterior, [0, 3, 5])  # type: ignore[arg-type]
    assert [ax.get_ylabel() for ax in figure.axes] == [f"x\n[{i}] (1)" for i in (0, 3, 5)]
    assert figure.axes[-1].get_xlabel() == "step of each walker"


def linear(matrix: np.ndarray, terms: tuple[int, ...]) -> Diagnosis:
    """Of residuals A x, cut into terms of so many rows."""
    x = Block("x", (matrix.shape[1],)).symbol
    edges = np.cumsum([0, *terms])
    parts = [
        Residual(f"term {i}", cs.sparsify(cs.DM(matrix[a:b])) @ x, 1.0)
        for i, (a, b) in enumerate(pairwise(edges))
    ]
    return diagnose(Problem(parts, ("x",)), {"x": np.zeros(matrix.shape[1])})


def test_small_pattern_is_drawn_as_it_is() -> None:
    A = np.array([[1.0, 0, 2], [0, 1, 0], [0, 0, 3], [4, 0, 0], [0, 5, 0]])
    diagnosis = linear(A, (3, 2))
    _, (ax,) = sheet(6, 4)
    plot_sparsity(diagnosis, ax=ax)
    image = np.asarray(ax.get_images()[0].get_array())
    assert len(image) == PIXELS
    middles = (np.arange(5) + 0.5) * PIXELS / 5
    np.testing.assert_array_equal(image[middles.astype(int)], A != 0)
    assert [t.get_text() for t in ax.get_yticklabels()] == ["term 0: 3", "term 1: 2"]
    assert [t.get_text() for t in ax.get_xticklabels()] == ["x\n3"]
    assert "5 × 3" in ax.get_title("left")
    assert "share" not in caption_sparsity(diagnosis)


def test_large_pattern_is_squeezed_and_says_so() -> None:
    pattern = np.zeros((36_816, 85), dtype=bool)
    pattern[20_001, 7] = True
    small = squeezed(pattern, 700)
    assert small.shape == (700, 85)
    assert np.argwhere(small).tolist() == [[20_001 * 700 // 36_816, 7]]
    diagnosis = linear(np.eye(3)[np.arange(2003) % 3], (2000, 3))
    assert "Several rows share a line" in caption_sparsity(diagnosis)
    assert "taller than to scale" in caption_sparsity(diagnosis)
    assert png(figure_of(partial(plot_sparsity, diagnosis), 8, 5.4)).startswith(b"\x89PNG")


def test_singular_values_are_drawn_beside_the_rank() -> None:
    diagnosis = linear(np.diag([100.0, 1.0, 1e-3, 0.0]), (4,))
    assert diagnosis.rank == 3
    figure = figure_of(partial(plot_singular_values, diagnosis), 8, 4.2)
    (ax,) = figure.get_axes()
    seen, hidden = ax.get_lines()[:2]
    np.testing.assert_array_equal(seen.get_xdata(), [1, 2, 3])
    np.testing.assert_allclose(seen.get_ydata(), [100.0, 1.0, 1e-3])
    np.testing.assert_array_equal(hidden.get_xdata(), [4])
    assert 0 < hidden.get_ydata()[0] < diagnosis.tolerance
    assert hidden.get_markerfacecolor() == "none"
    assert hidden.get_color() == VERMILLION
    assert "rank 3 of 4" in ax.get_title("left")
    assert "3 of 4 directions" in caption_singular_values(diagnosis)
    assert ax.get_xlabel()
    assert ax.get_ylabel()


def test_jacobian_of_zeros_can_be_drawn() -> None:
    x = Block("x", (3,)).symbol
    diagnosis = diagnose(Problem([Residual("squares", x**2, 1.0)], ("x",)), {"x": np.zeros(3)})
    assert diagnosis.rank == 0
    assert png(figure_of(partial(plot_singular_values, diagnosis), 8, 4.2)).startswith(b"\x89PNG")
    assert "0 of 3" in caption_singular_values(diagnosis)
