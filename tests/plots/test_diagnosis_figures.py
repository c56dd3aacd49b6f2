"""The figures of a diagnosis: what stands on their axes, and that they show the numbers."""

import numpy as np
import pytest

from tests.bodies_made_up import smpl_like_body
from tests.diagnostics import cases
from workbench import Block, Problem, Residual, diagnose, load_body
from workbench.plots import (
    caption_sigmas,
    caption_taylor,
    plot_data_share,
    plot_sigmas,
    plot_sparsity,
    plot_taylor,
    sheet,
)
from workbench.plots.body import close_up, plot_direction

pytestmark = pytest.mark.browser


def test_sparsity_names_joints_above_the_pattern() -> None:
    found = diagnose(*cases.joints_only())
    _, (ax,) = sheet(8, 5)
    plot_sparsity(found, ax=ax)
    (above,) = ax.child_axes
    labels = [label.get_text() for label in above.get_xticklabels()]
    assert labels == list(smpl_like_body().joint_names)
    middles = above.get_xticks()
    np.testing.assert_allclose(middles, 1.5 + 3 * np.arange(24))


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


def test_data_share_goes_from_one_to_zero() -> None:
    problem, values = cases.uneven()
    found = diagnose(problem, values)
    _, (ax,) = sheet(8, 3)
    plot_data_share(found, ax=ax)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 1.0)
    assert "5.0 of 5" in ax.get_title("left")


def test_taylor_error_goes_like_the_square() -> None:
    found = diagnose(*cases.scale_against_depth())
    _, (ax,) = sheet(6, 4)
    plot_taylor(found, ax=ax)
    h, e = ax.lines[0].get_data()
    assert np.log(e[0] / e[2]) / np.log(h[0] / h[2]) == pytest.approx(2, abs=0.2)
    assert "as it must" in caption_taylor(found)
    assert "sigmas" in ax.get_ylabel()


@pytest.mark.thorough
def test_direction_of_a_part_is_enlarged() -> None:
    body = load_body("small")
    here = body.vertices()
    hand = here[:, 0] > here[:, 0].max() - 0.1
    moved = {name: here + step * hand[:, None] for name, step in (("-", -0.05), ("here", 0.0))}
    moved["+"] = here + [[0.0, 0.05, 0.0]] * hand[:, None]
    times, part = close_up(moved, body.faces)
    assert times > 3
    assert 0 < len(part) < len(body.faces) / 4
    assert hand[body.faces[part]].any()
    _, (ax,) = sheet(8, 4)
    plot_direction(moved, body.faces, ax=ax)
    assert len(ax.collections) == 4  # the whole body, and the hand three times
    assert f"{times:.2g} times as large" in ax.get_xlabel()
    assert not ax.get_ylabel()
    turned = {"-": here[:, [2, 1, 0]], "here": here, "+": here}
    assert close_up(turned, body.faces)[0] == 1.0
