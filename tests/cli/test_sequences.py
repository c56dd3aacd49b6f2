"""Every verb takes a sequence of frames as it takes a single one."""

import json
from pathlib import Path

from tests.cli.conftest import Run

SHORT = ("--set", "frames=2", "--set", "missing=0.2")


def test_a_sequence_is_solved_and_diagnosed(workbench: Run) -> None:
    code, said, _ = workbench("run", "body-video", *SHORT, "--no-compare")
    assert code == 0
    assert "joint to synthetic truth, rms" in said
    assert Path("runs/body-video/index.html").is_file()
    code, said, _ = workbench("diagnose", "body-video", *SHORT)
    assert code == 0
    assert "pose[1, " in said
    summary = json.loads(Path("runs/body-video-diagnosis/summary.json").read_text())
    assert summary


def test_the_shape_of_a_sequence_is_sampled(workbench: Run) -> None:
    options = ("--block", "betas[0:2]", "--steps", "60", "--walkers", "16")
    code, said, _ = workbench("sample", "body-video", *SHORT, *options)
    assert code in (0, 1)  # so few draws need not be usable
    assert "betas[0]" in said


def test_solvers_are_compared_on_a_sequence(workbench: Run) -> None:
    solvers = ("--solver", "levenberg-marquardt", "--solver", "gauss-newton")
    code, said, _ = workbench("compare", "body-video", *solvers)
    assert code == 0
    assert "levenberg-marquardt" in said
    assert "1/1" in said
