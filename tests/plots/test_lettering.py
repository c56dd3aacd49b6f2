"""Names as users write them, in a font that does not hold every letter."""

import matplotlib
import numpy as np

from workbench.plots import png, sheet, smallest, svg
from workbench.plots.style import house_style, plain


def test_dollars_are_no_mathematics() -> None:
    figure, (ax,) = sheet(3, 2)
    ax.set_title(plain(r"$\frac{$ 左"))
    ax.plot(np.arange(3))
    assert png(figure)
    assert svg(figure)


def test_the_users_own_style_is_left_alone() -> None:
    before = dict(matplotlib.rcParams)
    with house_style():
        assert matplotlib.rcParams["legend.frameon"] is False
    assert dict(matplotlib.rcParams) == before


def test_the_same_figure_is_the_same_bytes() -> None:
    def drawn() -> bytes:
        figure, (ax,) = sheet(3, 2)
        ax.plot(np.arange(3))
        return svg(figure)

    assert drawn() == drawn()


def test_lines_are_kept_as_lines_and_paint_as_pixels() -> None:
    figure, (ax,) = sheet(3, 2)
    (line,) = ax.plot(np.arange(3))
    assert smallest(figure) == (svg(figure), "image/svg+xml")
    line.set_rasterized(True)
    assert smallest(figure)[1] == "image/png"
