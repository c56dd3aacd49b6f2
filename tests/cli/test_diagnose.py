"""`workbench diagnose` on small files of a user's own."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from workbench.cli.app import app

LINE = """
import casadi as cs, numpy as np, workbench as wb
x = wb.Block("x", ({n},))
A = np.vander(np.linspace(0, 1, 9), 3)[:, :{columns}]
fit = wb.Residual("fit", cs.DM(A) @ x.symbol[:{columns}] - 1, 0.1)
hold = wb.Residual("hold", x.symbol[{columns}:] if {n} > {columns} else x.symbol[:1], 1e3)
problem = wb.Problem([fit, hold], ["x"], blocks=[x])
start = {{"x": np.zeros({n})}}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(here: Path, name: str, n: int, columns: int) -> str:
    (here / name).write_text(LINE.format(n=n, columns=columns), encoding="utf-8")
    return name


def test_a_sound_problem_exits_with_zero(here: Path) -> None:
    result = CliRunner().invoke(app, ["diagnose", written(here, "sound.py", 3, 3)])
    assert result.exit_code == 0, result.output
    assert "no warnings" in result.output or "note:" in result.output
    data = json.loads((here / "runs" / "sound-diagnosis" / "diagnosis.json").read_text())
    assert data["rank"] == 3


def test_warnings_exit_with_one_and_are_said(here: Path) -> None:
    text = LINE.format(n=3, columns=3).replace("[:, :3]", "[:, [0, 1, 1]]")  # two alike
    (here / "blind.py").write_text(text, encoding="utf-8")
    result = CliRunner().invoke(app, ["diagnose", "blind.py", "--at-start"])
    assert result.exit_code == 1, result.output
    assert "warning:" in result.output
    assert "x[1] and x[2]" in result.output
    assert (here / "runs" / "blind-diagnosis" / "index.html").is_file()


def test_against_another(here: Path) -> None:
    first, second = written(here, "a.py", 3, 3), written(here, "b.py", 3, 3)
    result = CliRunner().invoke(app, ["diagnose", first, "--against", second])
    assert result.exit_code == 0, result.output
    assert "COMPARISON" in (here / "runs" / "a-diagnosis" / "diagnosis.txt").read_text()


def test_unknown_names_are_answered(here: Path) -> None:
    result = CliRunner().invoke(app, ["diagnose", "nobody"])
    assert "no experiment is called 'nobody'" in str(result.exception)


def test_data_alone_leaves_the_priors_of_a_file_out(here: Path) -> None:
    text = LINE.format(n=3, columns=2) + "priors = 'hold'\n"
    (here / "held.py").write_text(text, encoding="utf-8")
    ranks = {}
    for options in ((), ("--data-alone",)):
        result = CliRunner().invoke(app, ["diagnose", "held.py", *options])
        assert "changes nothing" not in result.output
        data = json.loads((here / "runs" / "held-diagnosis" / "diagnosis.json").read_text())
        ranks[options] = data["rank"]
    assert ranks == {(): 3, ("--data-alone",): 2}
    result = CliRunner().invoke(app, ["run", "held.py", "--no-compare"])
    assert "The prior, hold, makes up" in result.output
    assert "without the priors: 9 x 3" in result.output


def test_data_alone_says_that_there_are_no_priors(here: Path) -> None:
    name = written(here, "plain.py", 3, 2)
    result = CliRunner().invoke(app, ["diagnose", name, "--data-alone"])
    said = " ".join(result.output.split())
    assert "--data-alone changes nothing: plain names no residual as a prior; name those of" in said
    assert "fit, hold that are, in `priors` of the file or its Setup" in said
    result = CliRunner().invoke(app, ["run", name, "--no-compare"])
    assert "The setup names no residual as a prior." in result.output


def test_data_alone_of_priors_alone_is_refused(here: Path) -> None:
    text = LINE.format(n=3, columns=2) + "priors = ['fit', 'hold']\n"
    (here / "all.py").write_text(text, encoding="utf-8")
    result = CliRunner().invoke(app, ["diagnose", "all.py", "--data-alone"])
    assert "every residual of all is a prior" in str(result.exception)


def test_a_solver_is_not_asked_at_the_start(here: Path) -> None:
    name = written(here, "line.py", 3, 3)
    result = CliRunner().invoke(app, ["diagnose", name, "--at-start", "--solver", "dogleg"])
    assert "--solver changes nothing: with --at-start nothing is solved" in result.output
    result = CliRunner().invoke(app, ["diagnose", name, "--at-start", "--solver", "dogleg-leg"])
    assert "no solver is called 'dogleg-leg'" in str(result.exception)


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


def test_gauges_that_a_file_declares_are_named(here: Path) -> None:
    (here / "flat.py").write_text(GAUGE, encoding="utf-8")
    result = CliRunner().invoke(app, ["diagnose", "flat.py", "--at-start"])
    assert "a lift of x" in result.output
    (here / "flat.py").write_text(GAUGE + "gauges = ['a lift']\n", encoding="utf-8")
    result = CliRunner().invoke(app, ["diagnose", "flat.py", "--at-start"])
    assert "`gauges` are a tuple of Gauge" in str(result.exception)
