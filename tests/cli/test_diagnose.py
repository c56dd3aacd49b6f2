"""`workbench diagnose`, `sample` and `design` on small files of a user's own."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Run
from tests.cli.own_files import PARABOLA


def diagnosis(name: str) -> dict:
    """What `diagnose` wrote about a file."""
    data: dict = json.loads(Path(f"runs/{name}-diagnosis/diagnosis.json").read_text())
    return data


def test_diagnose_exits_with_1_and_names_what_is_not_known(workbench: Run) -> None:
    text = PARABOLA.format(n=3, columns=3).replace("[:, :3]", "[:, [0, 1, 1]]")  # two alike
    Path("blind.py").write_text(text)
    code, out, _ = workbench("diagnose", "blind.py", "--at-start")
    assert code == 1
    assert "warning:" in out
    assert "x[1] and x[2]" in out
    assert Path("runs/blind-diagnosis/index.html").is_file()


@pytest.mark.thorough
def test_data_alone_leaves_the_priors_of_a_file_out(workbench: Run) -> None:
    Path("held.py").write_text(PARABOLA.format(n=3, columns=2) + "priors = 'hold'\n")
    out = workbench("diagnose", "held.py", "--at-start", "--data-alone")[1]
    assert "changes nothing" not in out
    assert diagnosis("held")["rank"] == 2  # 3 with the prior
    Path("all.py").write_text(PARABOLA.format(n=3, columns=2) + "priors = ['fit', 'hold']\n")
    _, _, err = workbench("diagnose", "all.py", "--data-alone")
    assert "every residual of all is a prior" in err


GAUGE = """
import casadi as cs
import numpy as np
import workbench as wb
from workbench.diagnostics import Gauge

x = wb.Block("x", (6,), "m")  # three points in the plane
ends = [(0, 1), (1, 2), (2, 0)]
apart = [cs.norm_2(x.symbol[[2 * i, 2 * i + 1]] - x.symbol[[2 * j, 2 * j + 1]]) for i, j in ends]
problem = wb.Problem([wb.Residual("distances", cs.vertcat(*apart), 0.01, "m")], ["x"], blocks=[x])
start = {"x": np.array([0.0, 0.0, 1.0, 0.2, 0.3, 0.9])}
gauges = Gauge("a lift", lambda values: {"x": np.array([0.0, 1.0] * 3)})
"""


@pytest.mark.thorough
def test_diagnose_names_gauges_that_a_file_declares(workbench: Run) -> None:
    Path("flat.py").write_text(GAUGE)
    assert "a lift of x" in workbench("diagnose", "flat.py", "--at-start")[1]
    Path("flat.py").write_text(GAUGE + "gauges = ['a lift']\n")
    assert "`gauges` are a tuple of Gauge" in workbench("diagnose", "flat.py", "--at-start")[2]


LONG = ("--steps", "1600", "--walkers", "16")


@pytest.mark.thorough
def test_sample_goes_on_from_its_checkpoint(workbench: Run) -> None:
    Path("line.py").write_text(PARABOLA.format(n=3, columns=3))
    code, out, _ = workbench("sample", "line.py", *LONG)
    assert code == 0, out
    assert "usable:" in out
    folder = Path("runs/line-posterior")
    assert json.loads((folder / "summary.json").read_text())["parts"]["all"]["usable"]
    with np.load(folder / "all.npz") as file:
        draws = file["draws"]
    assert draws.shape[0] == 4
    assert Path("runs/line-draws/all.npz").is_file()
    page = (folder / "index.html").read_text()
    assert "usable" in page
    assert "x[0]" in page
    assert workbench("sample", "line.py", *LONG)[0] == 0
    with np.load(folder / "all.npz") as file:
        np.testing.assert_array_equal(file["draws"], draws)
    assert "draws of another run" in workbench("sample", "line.py", *LONG, "--seed", "1")[2]
    assert workbench("sample", "line.py", "--steps", "40", "--walkers", "16", "--fresh")[0] == 1


def test_short_sample_exits_with_1_and_gives_no_intervals(workbench: Run) -> None:
    Path("line.py").write_text(PARABOLA.format(n=3, columns=3))
    short = ("--steps", "60", "--walkers", "16", "--block", "x[0],x[2]")
    code, out, _ = workbench("sample", "line.py", *short)
    assert code == 1
    assert "NOT CONVERGED" in out
    assert "95 % interval" not in out
    assert "95 % interval" not in Path("runs/line-posterior/index.html").read_text()


def test_sample_refuses_unknown_names(workbench: Run) -> None:
    Path("line.py").write_text(PARABOLA.format(n=3, columns=3))
    code, _, err = workbench("sample", "line.py", "--block", "y")
    assert code == 2
    assert "no free block is called 'y'" in err


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
    assert page.count("<figure") == 1
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
        (["--points", "0"], "--points"),
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
