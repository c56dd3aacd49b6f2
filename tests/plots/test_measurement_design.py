"""The figures of a design show the candidates, the choice, and what stays undetermined."""

import casadi as cs
import numpy as np
from matplotlib.axes import Axes

import workbench as wb
from workbench.diagnostics import MeasurementDesign
from workbench.plots import (
    caption_measurement_ranking,
    plot_measurement_ranking,
    sheet,
)


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
        drawn["chosen"], np.sort([one.sd for one in design.ranking if one.name in design.chosen])
    )
    assert len(drawn["not chosen"]) == 3
    assert drawn["before"][0] == design.before.sd
    assert "by D-optimality" in caption_measurement_ranking(design)
