"""`workbench compare`, as a user types it."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.cli.test_cli import POLYNOMIAL, workbench

SOLVER = '''
"""Gauss and Newton's, by hand."""
import workbench as wb
class Mine:
    def solve(self, problem, start, *, callback=None):
        return wb.GaussNewton().solve(problem, start, callback=callback)
solver = Mine()
'''


def test_own_problem_and_own_solver_from_the_command_to_the_page(tmp_path: Path) -> None:
    (tmp_path / "line.py").write_text(POLYNOMIAL)
    (tmp_path / "mine.py").write_text(SOLVER)
    command = (
        "compare",
        "line.py",
        "nist-misra1a",
        "--solver",
        "mine.py",
        "--solver",
        "levenberg-marquardt",
        "--seeds",
        "2",
        "--max-seconds",
        "5",
        "--out",
        "found",
    )
    done = workbench(*command, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "solving: 0 of 6" in done.stdout
    assert "each returned a point within the target τ = 1e-5 from all 3 starts." in done.stdout
    assert "Jacobian 1 + 1.5 n" in done.stdout
    assert "they rank no solver" in done.stdout
    page = (tmp_path / "found" / "index.html").read_text(encoding="utf-8")
    assert "A line through three points." in page
    assert "mine" in page


ASKING = """
import casadi as cs
import numpy as np
import workbench as wb
from workbench.solvers import Evaluations

def told(problem, x):
    values = problem.free.unpack(np.asarray(x).ravel())
    return wb.Solution(values, 0.0, 0.0, wb.Status.CONVERGED, "", "", Evaluations(), 0.0, ())

class Newton:
    def solve(self, problem, start, *, callback=None):
        x, fixed = problem.split(start)
        for _ in range(9):
            r, J = problem.derivative(x, fixed)
            x = x - np.linalg.lstsq(np.array(J), np.array(r).ravel(), rcond=None)[0]
        return told(problem, x)

class Embedded:
    def solve(self, problem, start, *, callback=None):
        x, fixed = problem.split(start)
        s = cs.MX.sym("x", len(x))
        quiet = {"ipopt.print_level": 0, "print_time": 0}
        ipopt = cs.nlpsol("s", "ipopt", {"x": s, "f": problem.adjoint(s, fixed)[0]}, quiet)
        return told(problem, ipopt(x0=x)["x"])

newton, embedded = Newton(), Embedded()
"""


def test_a_file_that_asks_the_graphs_is_counted_or_told_why_not(tmp_path: Path) -> None:
    (tmp_path / "asking.py").write_text(ASKING)
    done = workbench("compare", "nist-misra1a", "--solver", "asking.py", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines: dict[str, list[str]] = {}
    for line in filter(None, map(str.split, done.stdout.splitlines())):
        lines.setdefault(line[0], line)  # the first table; seconds come later
    newton, embedded = lines["asking:newton"], lines["asking:embedded"]
    assert newton[1:3] == embedded[1:3] == ["1/1", "1/1"]
    assert float(newton[3]) % 4.0 == 0  # Jacobians alone, n = 2: 1 + 1.5 n
    assert embedded[3] == "unknown"
    assert "asking:embedded: not everything was counted in 1 of 1 runs" in done.stdout


def test_a_lone_run_is_not_called_the_lowest(tmp_path: Path) -> None:
    (tmp_path / "line.py").write_text(POLYNOMIAL)
    done = workbench("compare", "line.py", "--solver", "gauss-newton", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "1/1" not in done.stdout
    assert "There is nothing to compare" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("balance", "--solver", "newtons"), "no solver is called 'newtons'"),
        (("balance", "--out", "mine"), "mine exists and holds no comparison"),
        (("balance", "--dask", "tcp://127.0.0.1:1"), "no Dask scheduler answers at"),
    ],
)
def test_mistakes_get_a_sentence(tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "diary.txt").write_text("mine")
    done = workbench("compare", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr


SLOW = (
    POLYNOMIAL
    + """
from workbench.experiments import Setup
def setup(seed: int = 0):
    return Setup(problem, start, "A line")
"""
)
NAPPER = SOLVER.replace("return", "import time; time.sleep(0.3); return")


HEARD = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"


def test_an_interrupt_keeps_what_was_finished(tmp_path: Path) -> None:
    (tmp_path / "line.py").write_text(SLOW)
    (tmp_path / "mine.py").write_text(NAPPER)
    program = subprocess.Popen(
        [
            sys.executable,
            "-c",
            f"{HEARD}; from workbench.cli import main; main()",
            "compare",
            "line.py",
            "--solver",
            "mine.py",
            "--seeds",
            "40",
            "--workers",
            "2",
            "--out",
            "found",
        ],
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
