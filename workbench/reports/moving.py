"""What a page shows of a body that moves: a strip of frames per camera, and what frames share."""

from workbench import plots
from workbench.blocks import Values
from workbench.fitting.setup import Setup
from workbench.fitting.videos import autocorrelation, errors_of, worth_of
from workbench.reports.figures import Shown, plotted

MOST = 4  # cameras whose strips are drawn


def moving_figures(setup: Setup, values: Values) -> list[Shown]:
    """A strip of frames for each camera, and how errors are correlated; none for a single frame."""
    moving = setup.moving
    if moving is None:
        return []
    found = [
        plotted(9.6, 2.7, plots.plot_strip, plots.caption_strip, moving, values, i)
        for i in range(min(len(moving.views), MOST))
    ]
    if moving.data and len(moving.views[0].observed) > 2:
        r = autocorrelation(*errors_of(setup.problem, values, moving.data))
        worth = worth_of(setup.problem, values, moving.data)
        draw, say = plots.plot_autocorrelation, plots.caption_autocorrelation
        found.append(plotted(6.4, 3.0, draw, say, r, worth))
    return found
