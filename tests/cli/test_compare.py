"""`workbench compare`: own problems and solvers, counting, interrupts."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.own_files import LINE, SOLVER


@pytest.mark.thorough
def test_compare_takes_own_problems_and_own_solvers(workbench: Run) -> None:
    Path("line.py").write_text(LINE)
    Path("mine.py").write_text(SOLVER)
    solvers = ("--solver", "mine.py", "--solver", "levenberg-marquardt")
    options = (*solvers, "--seeds", "2", "--max-seconds", "60", "--out", "found")
    code, out, err = workbench("compare", "line.py", "nist-misra1a", *options)
    assert code == 0, err
    assert "solving: 0 of 6" in out
    assert "each returned a point within the target τ = 1e-5 from all 3 starts." in out
    assert "Jacobian n + 1" in out
    page = Path("found/index.html").read_text(encoding="utf-8")
    assert "A line through three points." in page
    assert "mine" in page


SLOW = (
    LINE
    + """
from workbench.experiments import Setup
def setup(seed: int = 0):
    return Setup(problem, start, "A line")
"""
)
NAPPER = SOLVER.replace("return", "import time; time.sleep(0.3); return")
HEARD = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from workbench.cli import main
main()
"""


@pytest.mark.thorough
def test_interrupted_compare_keeps_what_was_finished(tmp_path: Path) -> None:
    (tmp_path / "line.py").write_text(SLOW)
    (tmp_path / "mine.py").write_text(NAPPER)
    options = ("--seeds", "40", "--workers", "2", "--out", "found")
    program = subprocess.Popen(
        [sys.executable, "-c", HEARD, "compare", "line.py", "--solver", "mine.py", *options],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while len(list(tmp_path.glob("found/runs/run-*.npz"))) < 2:
        assert program.poll() is None
        time.sleep(0.05)
    program.send_signal(signal.SIGINT)
    _, said = program.communicate(timeout=60)
    assert program.returncode == 130
    assert "interrupted while solving" in said
    assert "the same command continues from there" in " ".join(said.split())
    assert "Traceback" not in said
    assert 2 <= len(list(tmp_path.glob("found/runs/run-*.npz"))) < 40
    assert not (tmp_path / "found" / "index.html").exists()
