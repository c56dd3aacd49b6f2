"""View: a camera with the landmarks that it observed, and how far each of them is trusted."""

import workbench as wb
from workbench.experiments import find

setup = find("balance").setup()
for seen in setup.views:
    view: wb.View = seen
    trusted = int((view.confidence > 0.2).sum())
    print(view.name, view.size, "px,", trusted, "of", len(view.observed), view.landmarks)
