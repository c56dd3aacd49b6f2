"""`workbench sample` on a small file of a user's own."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from workbench.cli.app import app

LINE = """
import casadi as cs, numpy as np, workbench as wb
x = wb.Block("x", (3,))
A = np.vander(np.linspace(0, 1, 9), 3)
fit = wb.Residual("fit", cs.DM(A) @ x.symbol - 1, 0.1)
problem = wb.Problem([fit], ["x"], blocks=[x])
start = {"x": np.zeros(3)}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "line.py").write_text(LINE, encoding="utf-8")
    return tmp_path


def invoke(*arguments: str) -> object:
    return CliRunner().invoke(app, ["sample", "line.py", *arguments])


def test_a_usable_block_exits_with_zero_and_goes_on(here: Path) -> None:
    options = ("--steps", "1600", "--walkers", "16")
    first = invoke(*options)
    assert first.exit_code == 0, first.output  # type: ignore[attr-defined]
    assert "usable:" in first.output  # type: ignore[attr-defined]
    folder = here / "runs" / "line-posterior"
    data = json.loads((folder / "summary.json").read_text())
    assert data["parts"]["all"]["usable"]
    draws = np.load(folder / "all.npz")["draws"]
    assert draws.shape[0] == 4
    assert (here / "runs" / "line-draws" / "all.h5").is_file()
    page = (folder / "index.html").read_text()
    assert "usable" in page
    assert "x[0]" in page
    again = invoke(*options)  # read from the checkpoint
    assert again.exit_code == 0, again.output  # type: ignore[attr-defined]
    np.testing.assert_array_equal(np.load(folder / "all.npz")["draws"], draws)
    other = invoke("--steps", "1600", "--walkers", "16", "--seed", "1")
    assert "draws of another run" in str(other.exception)  # type: ignore[attr-defined]
    assert invoke("--steps", "40", "--walkers", "16", "--fresh").exit_code == 1  # type: ignore[attr-defined]


def test_a_short_run_exits_with_one_and_gives_no_intervals(here: Path) -> None:
    result = invoke("--steps", "60", "--walkers", "16", "--block", "x[0],x[2]")
    assert result.exit_code == 1, result.output  # type: ignore[attr-defined]
    assert "NOT CONVERGED" in result.output  # type: ignore[attr-defined]
    assert "95 %" not in result.output  # type: ignore[attr-defined]
    assert "95 %" not in (here / "runs" / "line-posterior" / "index.html").read_text()


def test_a_block_that_rests_on_others_says_so_and_is_not_usable(here: Path) -> None:
    options = ("--steps", "1600", "--walkers", "16", "--block", "x[0]")
    alone = invoke(*options, "--conditional")
    assert alone.exit_code == 1, alone.output  # type: ignore[attr-defined]
    said = alone.output  # type: ignore[attr-defined]
    assert "NOT USABLE: conditional" in said
    assert "usable: " not in said.replace("NOT USABLE: ", "").replace("by itself: usable: ", "")
    assert "Held fixed: 2 of the 3 numbers of x (2 numbers)" in said
    assert "ratio" in next(line for line in said.splitlines() if line.startswith("entry"))
    assert "Held fixed: 2 of" in (here / "runs" / "line-posterior" / "posterior.txt").read_text()
    row = next(
        line
        for line in said.splitlines()
        if line.startswith("x[0] ") and " sd" not in line and "numbers of" not in line
    )
    assert row.endswith("conditional")
    joined = invoke(*options, "--fresh")
    assert joined.exit_code == 0, joined.output  # type: ignore[attr-defined]
    assert "Held fixed: nothing" in joined.output  # type: ignore[attr-defined]
    assert "sampled too" in joined.output  # type: ignore[attr-defined]
    table = joined.output.index("all other free numbers")  # type: ignore[attr-defined]
    assert table < joined.output.index("autocorrelation times")  # type: ignore[attr-defined]


def test_unknown_names_are_answered(here: Path) -> None:
    for arguments, said in (
        (("--block", "y"), "no free block is called 'y'"),
        (("--move", "random"), "de-snooker"),
        (("--directions", "9"), "1 to 3 directions"),
    ):
        result = invoke(*arguments)
        assert said in str(result.exception)  # type: ignore[attr-defined]
