"""Figures of skinning and blend shapes: drawn from numbers made up, and said in words."""

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.axes import Axes

import workbench as wb
from workbench.lectures.material.by_angle import caption_by_angle, plot_by_angle
from workbench.lectures.material.variance import (
    caption_left_over,
    caption_variances,
    plot_left_over,
    plot_variances,
)
from workbench.plots import (
    caption_differences,
    house_style,
    plot_differences,
    png,
    sheet,
)
from workbench.studies.blend_shapes import figures as drawn
from workbench.studies.blend_shapes.page import predictor_page, predictor_table, table_text
from workbench.studies.blend_shapes.predictors import (
    INTERPOLATION,
    LINEAR,
    LINEAR_IN,
    NORMALISED,
    Accuracy,
    Result,
)
from workbench.studies.blend_shapes.questions import FACTORS, TURNS, ByExamples, ByPenalty
from workbench.studies.blend_shapes.study import PredictorPlan, PredictorStudy

pytestmark = pytest.mark.thorough

BODY = wb.load_body("small")
ANGLES = np.linspace(0, np.pi, 7)
RESULTS = (
    Result("DQB + rotation elements", 763_209, Accuracy(0.14, 0.64, 20.6, 1.5)),
    Result("LBS + theta", 254_403, Accuracy(0.78, 2.31, 57.8, 1.0)),
    Result(LINEAR, 0, Accuracy(1.84, 4.39, 50.0, 0.3)),
    Result("linear in theta, no bones", 258_090, Accuracy(68.4, 119.0, 1128.9, 0.5)),
)
REACH = {
    name: np.linspace(0, 10 + i, len(FACTORS))
    for i, name in enumerate(
        [*LINEAR_IN, f"{NORMALISED} of examples", f"{INTERPOLATION} of examples"]
    )
}
STUDY = PredictorStudy(
    PredictorPlan(),
    "real poses: every good frame",
    519,
    RESULTS,
    (
        ByExamples(25, Accuracy(1.4, 1.5, 9.0, 0.4), Accuracy(1.2, 1.3, 8.0, 0.3)),
        ByExamples(200, Accuracy(1.1, 1.2, 7.0, 0.8), Accuracy(0.5, 0.6, 6.0, 0.6)),
    ),
    REACH,
    {name: 1 + np.abs(np.sin(TURNS / 2)) for name in LINEAR_IN},
    (
        ByPenalty(1e-3, 0.4, 1.9, 0.54),
        ByPenalty(1.0, 0.1, 2.2, 0.5),
        ByPenalty(10.0, 0.04, 2.9, 0.57),
    ),
    (ByPenalty(1e-5, 0.2, 2.3, 0.57), ByPenalty(1e-3, 0.02, 2.8, 0.79)),
)


def drawn_on(draw: Callable[[Axes], Axes]) -> Axes:
    with house_style():
        figure, (ax,) = sheet(6, 4)
        found = draw(ax)
    assert len(png(figure)) > 5000
    assert found is ax
    return ax


@pytest.mark.parametrize("most", [5.0])
def test_differences_are_coloured_in_millimetres(most: float | None) -> None:
    shifted = {"shifted": BODY.template + [0.01, 0, 0], "same": BODY.template}
    ax = drawn_on(lambda ax: plot_differences(BODY.template, shifted, BODY.faces, ax=ax, most=most))
    assert [label.get_text() for label in ax.get_xticklabels()] == ["SMPL", "shifted", "same"]
    bar = ax.get_figure().axes[1]  # type: ignore[union-attr]
    assert bar.get_ylabel() == "distance from SMPL (mm)"
    assert bar.get_ylim()[1] == pytest.approx(most or 10)
    said = caption_differences(BODY.template, shifted)
    assert "shifted 10.0 mm on average, at most 10 mm; same 0.0 mm" in said


def test_curves_by_angle_have_units_and_the_law() -> None:
    found = {"linear": np.cos(ANGLES / 2), "dual": np.ones(7)}
    law = "|cos(a/2)|", np.cos(ANGLES / 2)
    ax = drawn_on(lambda ax: plot_by_angle(ANGLES, found, "radius (share)", ax=ax, law=law))
    assert ax.get_xlabel() == "angle (degrees)"
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["linear", "dual", "|cos(a/2)|"]
    said = caption_by_angle(ANGLES[:4], {k: v[:4] for k, v in found.items()}, "radius")
    assert said == "Radius; at 90 degrees: linear 0.707, dual 1."


def test_variance_and_what_is_left() -> None:
    shares, left = np.array([0.7, 0.2, 0.05]), np.array([[0.04, 0.02], [0.02, 0.01], [0.0, 0.0]])
    drawn_on(lambda ax: plot_variances(shares, ax=ax))
    drawn_on(lambda ax: plot_left_over(left, ax=ax))
    assert "first direction 70%, the first two 90%, all 3 95.0%" in caption_variances(shares)
    assert "mean person is 30.0 mm off, one direction leaves 15.0 mm" in caption_left_over(left)


def test_predictors_are_bars_in_order() -> None:
    ax = drawn_on(lambda ax: drawn.plot_predictors(RESULTS, ax=ax))
    assert [bar.get_width() for bar in ax.patches] == [r.accuracy.mean for r in RESULTS]
    colours = [bar.get_facecolor() for bar in ax.patches]
    assert colours[2] != colours[0] == colours[1]
    said = drawn.caption_predictors(RESULTS, STUDY.test, 519)
    assert said.startswith("The distance of posed vertices on 519 real poses")
    assert "is 1.84 mm off on average; DQB + rotation elements is the best with 0.14 mm" in said


def test_page_has_table_figures_and_captions() -> None:
    page = predictor_page(STUDY)
    assert page.count("<img") == page.count("<figcaption") == 6
    for text in ("763,209", "−3617%", "519 real poses", "The teacher is synthetic", "seed 0"):
        assert text in page
    table = predictor_table(STUDY)
    assert [row[1] for row in table.rows] == [r.name for r in RESULTS]
    assert "92%" in table_text(STUDY)
    assert all(len(line) < 100 for line in table_text(STUDY).splitlines())
