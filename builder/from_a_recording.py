"""What is learned from a recording of motion: the command line that its builders share."""

import argparse
from pathlib import Path

from workbench.priors.recordings import PoseRecording, read_recording


def asked(description: str | None) -> tuple[PoseRecording, PoseRecording, Path]:
    """What to learn from, the clips that are held out, and the folder to write to."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("mocap", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    return *read_recording(arguments.mocap).split(), arguments.out
