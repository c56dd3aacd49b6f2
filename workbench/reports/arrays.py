"""The numbers of a run as one `.npz`: what was found, and what is drawn."""

import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.experiments.experiment import Outcome


def arrays(outcome: Outcome) -> dict[str, NDArray[np.float64]]:
    """Every block under its own name, and per view `projected:`, `observed:` (M, 2) px and
    `confidence:` (M,), exactly as drawn; `surface` (N, 3) m where there is a body.
    """
    found: dict[str, NDArray[np.float64]] = {}
    if outcome.surface is not None:
        found["surface"] = outcome.surface
    for overlay in outcome.overlays:
        found[f"projected:{overlay.name}"] = overlay.projected
        found[f"observed:{overlay.name}"] = overlay.observed
        found[f"confidence:{overlay.name}"] = overlay.confidence
    return found | {name: np.asarray(value) for name, value in outcome.values.items()}


def write_arrays(path: Path, named: Mapping[str, NDArray[np.float64]]) -> None:
    """What `np.savez_compressed` writes, for any names: its own takes them as keyword arguments,
    and so has no room for one that is called `file`.
    """
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in named.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
