"""The pattern and the spectrum of a Jacobian."""

from itertools import pairwise

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import SMPL_NAMES, smpl_like_body
from workbench import Block, Diagnosis, Problem, Residual, diagnose, residuals
from workbench.plots import (
    caption_singular_values,
    caption_sparsity,
    plot_singular_values,
    plot_sparsity,
    png,
    sheet,
)
from workbench.plots.diagnosis import (
    MOST_LINES,
    PIXELS,
    singular_values_sheet,
    sparsity_sheet,
    squeezed,
    unseen,
)
from workbench.plots.palette import VERMILLION

pytestmark = pytest.mark.browser


def linear(matrix: np.ndarray, terms: tuple[int, ...]) -> Diagnosis:
    """Of residuals A x, cut into terms of so many rows."""
    x = Block("x", (matrix.shape[1],)).symbol
    edges = np.cumsum([0, *terms])
    parts = [
        Residual(f"term {i}", cs.sparsify(cs.DM(matrix[a:b])) @ x, 1.0)
        for i, (a, b) in enumerate(pairwise(edges))
    ]
    return diagnose(Problem(parts, ("x",)), {"x": np.zeros(matrix.shape[1])})


def joints_only() -> Diagnosis:
    """A body whose joints alone are observed: 32 null directions."""
    body = smpl_like_body()
    pose, betas, trans = body.blocks()
    points = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
    term = residuals.landmarks(points, Block("seen", (24, 3), "m").symbol, sigma=0.01)
    at = body.start() | {"seen": np.zeros((24, 3))}
    at["pose"] = np.random.default_rng(0).normal(scale=0.3, size=(24, 3))
    return diagnose(Problem([term], ("pose", "trans")), at)


def test_small_pattern_is_drawn_as_it_is() -> None:
    A = np.array([[1.0, 0, 2], [0, 1, 0], [0, 0, 3], [4, 0, 0], [0, 5, 0]])
    diagnosis = linear(A, (3, 2))
    _, (ax,) = sheet(6, 4)
    plot_sparsity(diagnosis, ax=ax)
    drawn = np.asarray(ax.get_images()[0].get_array())
    assert len(drawn) == PIXELS
    middles = (np.arange(5) + 0.5) * PIXELS / 5
    np.testing.assert_array_equal(drawn[middles.astype(int)], A != 0)
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
    assert png(sparsity_sheet(diagnosis)).startswith(b"\x89PNG")


def test_singular_values_are_drawn_beside_the_rank() -> None:
    diagnosis = linear(np.diag([100.0, 1.0, 1e-3, 0.0]), (4,))
    assert diagnosis.rank == 3
    figure = singular_values_sheet(diagnosis)
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


def test_full_rank_shows_the_condition() -> None:
    diagnosis = linear(np.diag([100.0, 1.0]), (2,))
    _, (ax,) = sheet(6, 4)
    plot_singular_values(diagnosis, ax=ax)
    assert ax.get_title("left") == "rank 2 of 2, condition 100"
    assert "condition number is 100" in caption_singular_values(diagnosis)


@pytest.mark.thorough
def test_thirty_two_null_directions_fit_beside_the_spectrum() -> None:
    diagnosis = joints_only()
    assert len(diagnosis.null_directions) == 32
    words = unseen(diagnosis)
    assert words[0] == "32 null directions"
    assert "15 single entries of pose" in words
    assert "   left_hip / left_knee" in words
    assert len(words) <= MOST_LINES
    named = {name.strip() for line in words for name in line.split("/")}
    assert len(named & set(SMPL_NAMES)) > 10
    figure = singular_values_sheet(diagnosis)
    figure.draw_without_rendering()
    (ax,) = figure.get_axes()
    beside = ax.texts[-1].get_window_extent()
    assert beside.x1 <= figure.bbox.x1
    assert beside.y0 >= figure.bbox.y0


@pytest.mark.thorough
def test_any_spectrum_can_be_drawn() -> None:
    for matrix in (np.ones((3, 1)), np.ones((1, 4))):
        diagnosis = linear(matrix, (len(matrix),))
        for make in (singular_values_sheet, sparsity_sheet):
            make(diagnosis).draw_without_rendering()
        assert caption_singular_values(diagnosis)


def test_jacobian_of_zeros_can_be_drawn() -> None:
    x = Block("x", (3,)).symbol
    diagnosis = diagnose(Problem([Residual("squares", x**2, 1.0)], ("x",)), {"x": np.zeros(3)})
    assert diagnosis.rank == 0
    assert png(singular_values_sheet(diagnosis)).startswith(b"\x89PNG")
    assert "0 of 3" in caption_singular_values(diagnosis)
