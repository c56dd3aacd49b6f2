"""Replays: what a run, a diagnosis or a posterior found, moving in a page of its own numbers."""

from workbench.replay.recording import (
    Recording,
    recorded_diagnosis,
    recorded_posterior,
    recorded_run,
    recorded_start,
)

__all__ = [
    "Recording",
    "recorded_diagnosis",
    "recorded_posterior",
    "recorded_run",
    "recorded_start",
]
