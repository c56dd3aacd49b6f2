"""`workbench design` on small files of a user's own, and on a body."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Run

LINE = """
import casadi as cs, numpy as np, workbench as wb
x = wb.Block("x", (3,), "m")
def at(t, name):
    return wb.Residual(name, cs.DM(np.vander(np.atleast_1d(t), 3)) @ x.symbol, 0.1, "m")
problem = wb.Problem([at(np.linspace(0, 1, 5), "fit")], ["x"], blocks=[x])
start = {"x": np.zeros(3)}
candidates = {f"at {t:g}": at(t, "more") for t in (-1, 0, 0.5, 1, 2, 3)}
"""


@pytest.fixture
def line(tmp_path: Path) -> Path:
    (tmp_path / "line.py").write_text(LINE, encoding="utf-8")
    return tmp_path


def test_design_ranks_the_candidates_of_a_file(workbench: Run, line: Path) -> None:
    code, said, _ = workbench("design", "line.py", "--choose", "2", "--sd-of", "x[0]")
    assert code == 0
    folder = line / "runs" / "line-design"
    data = json.loads((folder / "design.json").read_text())
    assert data["ranking"][0]["name"] == "at 3"
    assert "at 3" in data["chosen"]
    assert data["unit"] == "m"
    assert data["after"] < data["before"]
    assert "all 15 combinations of 2 candidates were compared" in said
    assert (folder / "design.txt").read_text().startswith("WHAT TO MEASURE NEXT: 2 of 6")
    page = (folder / "index.html").read_text()
    assert "What to measure next in line" in page
    assert page.count("<figure") == 2
    A = np.vander(np.linspace(0, 1, 5), 3) / 0.1
    assert data["before"] == pytest.approx(np.sqrt(np.linalg.inv(A.T @ A)[0, 0]))


def test_design_averages_over_points(workbench: Run, line: Path) -> None:
    code, said, _ = workbench("design", "line.py", "--points", "3", "--over", "x[0]")
    assert code == 0
    assert "averaged over 3 points" in said


@pytest.mark.thorough
def test_design_refuses_what_makes_no_question(workbench: Run, line: Path) -> None:
    for arguments, said in (
        (["--candidates", "poses"], "there are cameras, markers,"),
        (["--candidates", "cameras"], "are of a problem that fits a body in one frame"),
        (["--criterion", "f"], "no criterion is called 'f'"),
        (["--choose", "7"], "1 to 6 of the candidates can be chosen, not 7"),
        (["--sd-of", "poze"], "no free block is called 'poze'"),
        (["--sd-of", "x[0]", "--over", "x[0]"], "--over goes with --criterion"),
        (["--over", "y"], "no free block is called 'y'"),
        (["--points", "0"], "--points is 1 or more"),
    ):
        code, _, err = workbench("design", "line.py", *arguments)
        assert code == 2
        assert said in " ".join(err.split())
    for candidates, said in (
        ("own", "names no candidates of its own"),
        ("views", "no camera of this problem is held"),
    ):
        code, _, err = workbench("design", "known-correspondences", "--candidates", candidates)
        assert code == 2
        assert said in " ".join(err.split())


def test_design_refuses_candidates_that_are_no_residuals(workbench: Run, line: Path) -> None:
    (line / "wrong.py").write_text(LINE + "candidates = [1]\n", encoding="utf-8")
    code, _, err = workbench("design", "wrong.py")
    assert code == 2
    assert "`candidates` of a setup must be a dict of residuals by name" in " ".join(err.split())
