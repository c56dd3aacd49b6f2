"""No label of an axis is printed over another one."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

import workbench as wb
from tests.plots.test_convergence import solution
from workbench.bodies import SkinnedBody
from workbench.plots import house_style, plot_differences, plot_stitching, sheet
from workbench.plots.sheets import (
    convergence_sheet,
    direction_sheet,
    distances_sheet,
    shape_gallery_sheet,
)
from workbench.reports.card import shapes


def printed_over(figure: Figure) -> list[tuple[str, str]]:
    """Pairs of tick labels of one axis whose letters are in each other's place."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # lays it out
    renderer = canvas.get_renderer()
    found = []
    for ax in figure.get_axes():
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            boxes: list[tuple[str, Bbox]] = [
                (label.get_text(), label.get_window_extent(renderer))
                for tick in ticks
                for label in (tick.label1, tick.label2)
                if label.get_visible() and label.get_text() and low <= tick.get_loc() <= high
            ]
            found += [(a, b) for (a, p), (b, q) in combinations(boxes, 2) if p.overlaps(q)]
    return found


@pytest.fixture(scope="module")
def body() -> SkinnedBody:
    return wb.load_body("default")


def test_the_check_sees_what_it_should() -> None:
    figure, (ax,) = sheet(3, 2)
    ax.set_xticks([0.0, 0.1, 1.0], ["a long label", "another one", "c"])
    assert printed_over(figure) == [("a long label", "another one")]


@pytest.mark.parametrize("name", ["default", "small", "default-female"])
def test_names_of_shapes_stand_apart(name: str) -> None:
    model = wb.load_body(name)
    assert printed_over(shape_gallery_sheet(shapes(model), model.faces)) == []


def test_names_of_many_narrow_bodies_stand_apart(body: SkinnedBody) -> None:
    thin = body.template * (0.2, 1, 1)
    figure, (ax,) = sheet(8.0, 4.0)
    names = [f"a name so long {i}" for i in range(6)]
    plot_differences(thin, dict.fromkeys(names, thin), body.faces, ax=ax)
    assert printed_over(figure) == []
    places = ax.get_xticks()
    assert (np.diff(places) > 0).all()


def test_directions_distances_and_stages_stand_apart(body: SkinnedBody) -> None:
    V = body.template
    moved = {f"{sign}1 unit of everything": V + 0.1 * k for k, sign in enumerate("-0+")}
    assert printed_over(direction_sheet(moved, body.faces)) == []
    assert printed_over(distances_sheet(V, np.linspace(0, 1, len(V)), body.faces)) == []
    with house_style():
        figure, (ax,) = sheet(10.5, 4.6)
        stages = ("at rest", "every triangle by itself", "stitched together again", "by SMPL")
        plot_stitching({name: V[body.faces] for name in stages}, ax=ax)
    assert printed_over(figure) == []


@pytest.mark.parametrize("seconds", [(0.002, 0.04), (0.02, 0.03), (1e-3, 5.0), (0.4, 0.9)])
def test_times_stand_apart(seconds: tuple[float, float]) -> None:
    """Over less than two decades matplotlib labels 2 to 9 as well, one over the other."""
    costs = [1.0 / (k + 1) ** 4 for k in range(12)]
    runs = {}
    for name, end in zip("ab", seconds, strict=True):
        run = solution(costs)
        times = np.geomspace(seconds[0], end, len(costs))
        for iterate, at in zip(run.trace, times, strict=True):
            object.__setattr__(iterate, "seconds", float(at))
        runs[name] = run
    figure = convergence_sheet(runs)
    assert printed_over(figure) == []
    low, high = figure.get_axes()[1].get_xlim()
    shown = [x for x in figure.get_axes()[1].get_xticks() if low <= x <= high]
    assert shown, "a time axis without a number says nothing"
