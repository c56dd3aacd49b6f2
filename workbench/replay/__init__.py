"""Replays: what a run, a diagnosis or a posterior found, moving in a page of its own numbers.

A replay is data and a player: Python writes the numbers (`Recording`: arrays of the body once,
iterates, directions, draws, series of states, what was observed), and `scripts/` (plain JavaScript
and WebGL 2) computes the bodies. Where a browser has no WebGL 2 the replay hides itself, and the
figures of the page say the same. `live_server` is the same page with a server behind it.
"""

from workbench.replay.comparisons import recorded_ends
from workbench.replay.frames import recorded_frames, recorded_motion
from workbench.replay.recording import (
    recorded_diagnosis,
    recorded_posterior,
    recorded_run,
    recorded_solution,
    recorded_start,
)
from workbench.replay.registrations import recorded_registration
from workbench.replay.shown_body import Recording

__all__ = [
    "Recording",
    "recorded_diagnosis",
    "recorded_ends",
    "recorded_frames",
    "recorded_motion",
    "recorded_posterior",
    "recorded_registration",
    "recorded_run",
    "recorded_solution",
    "recorded_start",
]
