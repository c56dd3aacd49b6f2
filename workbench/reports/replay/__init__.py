"""Replays: what a run, a diagnosis or a posterior found, moving in a page of its own numbers.

A replay is data and a player: Python writes the numbers (`Recording`: arrays of the body once,
iterates, directions, draws, series of states, what was observed), and `scripts/` (plain JavaScript
and WebGL 2) computes the bodies. Where a browser has no WebGL 2 the replay hides itself, and the
figures of the page say the same. `live_server` is the same page with a server behind it.
"""

from workbench.reports.replay.recording import Recording
from workbench.reports.replay.runs import (
    recorded_diagnosis,
    recorded_posterior,
    recorded_run,
    recorded_solution,
    recorded_start,
)
from workbench.reports.replay.sequences import (
    recorded_frames,
    recorded_motion,
    recorded_registration,
)

__all__ = [
    "Recording",
    "recorded_diagnosis",
    "recorded_frames",
    "recorded_motion",
    "recorded_posterior",
    "recorded_registration",
    "recorded_run",
    "recorded_solution",
    "recorded_start",
]
