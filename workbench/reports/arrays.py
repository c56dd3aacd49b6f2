"""The numbers of a run as one `.npz`: what was found, and what is drawn."""

import numpy as np

from workbench.arrays import Array
from workbench.experiments.running import Outcome


def arrays(outcome: Outcome) -> dict[str, Array]:
    """Every block under its own name, and per view `projected:`, `observed:` (M, 2) px and
    `confidence:` (M,), exactly as drawn; `surface` (N, 3) m where there is a body.
    """
    found: dict[str, Array] = {}
    if outcome.surface is not None:
        found["surface"] = outcome.surface
    for overlay in outcome.overlays:
        found[f"projected:{overlay.view.name}"] = overlay.projected
        found[f"observed:{overlay.view.name}"] = overlay.view.observed
        found[f"confidence:{overlay.view.name}"] = overlay.view.confidence
    return found | {name: np.asarray(value) for name, value in outcome.values.items()}
