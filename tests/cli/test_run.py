"""`workbench run` and `workbench body card`: what they list, write and keep."""

import json
import re
import signal
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import workbench as wb
from tests.cli.conftest import Run
from tests.cli.own_files import LINE
from workbench.cli.console import rich_table
from workbench.cli.run import _rank_line
from workbench.reports.page import Table
from workbench.solvers import SOLVERS


@pytest.mark.thorough
def test_run_writes_a_whole_report(workbench: Run) -> None:
    code, out, err = workbench("run", "--no-compare", "--verbose")
    assert code == 0, err
    assert "CONVERGED" in out
    assert "reprojection, cam01" in out
    assert re.search(r"^iteration +0  cost \d", out, re.M), out
    assert "The priors, pose prior and shape prior, make up " in out
    assert "without the priors: 184 x 85" in out
    folder = Path("runs/balance")
    for name in ("index.html", "values.npz", "solution.npz", "body.glb", "summary.json"):
        assert (folder / name).is_file(), name
    with np.load(folder / "values.npz", allow_pickle=False) as numbers:
        assert numbers["projected:cam01"].shape == (23, 2)
    assert wb.Solution.load(folder / "solution.npz").converged
    assert json.loads((folder / "summary.json").read_text())["status"] == "CONVERGED"


def test_directions_are_printed_without_their_entries() -> None:
    body = wb.load_body("small")
    pose, betas, trans = (block.symbol for block in body.blocks())
    place = wb.Block("place", (24, 3), "m")
    joints = wb.residuals.landmarks(body.joint_points(pose, betas, trans), place.symbol, sigma=0.5)
    upright = wb.Residual("upright", pose[2, :].T, sigma=2, unit="rad")
    problem = wb.Problem([joints, upright], free=["pose"], blocks=[place])
    bent = body.start() | {"pose": 0.3 * np.random.default_rng(0).standard_normal((24, 3))}
    diagnosis = wb.diagnose(problem, bent | {"place": body.joints(**bent)})
    assert any(d.joints and " rad of " in d.name for d in diagnosis.weak_directions)
    said = _rank_line("Jacobian", diagnosis)
    assert "among them " in said
    assert " rad of " not in said


def test_tables_fit_80_columns_whole() -> None:
    table = Table(
        ("solver", "status", "cost"),
        (("levenberg-marquardt", "CONVERGED, NOT LOWEST " * 4, "125.59428"),) * 2,
        (2,),
    )
    console = Console(width=80, file=StringIO())
    console.print(rich_table(table))
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert max(map(len, lines)) <= 80
    assert sum("125.59428" in line for line in lines) == 2
    assert not any("…" in line for line in lines)


def test_run_lists_experiments_and_suites(workbench: Run) -> None:
    code, out, _ = workbench("run", "--list")
    assert code == 0
    for name in ("balance", "balance-monocular", "known-correspondences", "registration"):
        assert name in out
    assert "suites" in out
    assert "nist-misra1a" not in out
    assert len(out.splitlines()) < 20
    assert "known-correspondences" in workbench("run", "balance", "--list")[1]
    out = workbench("run", "nist", "--list")[1]
    assert len(out.splitlines()) == 12
    assert "nist-misra1a" in out
    code, out, err = workbench("run", "nits", "--list")
    assert (code, out) == (2, "")
    assert "no suite is called 'nits'" in err
    assert "nist" in err


def test_run_solves_a_file_and_keeps_its_folder(workbench: Run) -> None:
    for folder in ("a", "b"):
        Path(folder).mkdir()
        Path(folder, "line.py").write_text(LINE)
    code, out, err = workbench("run", "a/line.py", "--no-compare")
    assert code == 0, err
    assert "CONVERGED" in out
    assert "The setup names no residual as a prior." in out
    assert Path("runs/line/index.html").is_file()
    assert not Path("runs/line/body.glb").exists()
    found = wb.Solution.load(Path("runs/line/solution.npz")).values["a"]
    np.testing.assert_allclose(found, [11 / 12, 2.25], rtol=1e-9)  # of least squares
    code, _, err = workbench("run", "b/line.py")
    assert code == 2
    assert "--out" in err


class Interrupting:
    """A solver during which somebody presses Ctrl-C."""

    def solve(self, *_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGINT)


@pytest.mark.thorough
def test_interrupted_comparison_keeps_the_report(
    workbench: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(SOLVERS, "gauss-newton", Interrupting())  # type: ignore[arg-type]
    Path("line.py").write_text(LINE)
    code, out, err = workbench("run", "line.py")
    assert code == 130
    assert err == "interrupted; the report holds what was found until then\n"
    said = " ".join(out.split())
    assert "cut short from the keyboard; not run: gauss-newton, nlopt-lbfgs." in said
    assert Path("runs/line/index.html").is_file()


@pytest.mark.parametrize(
    ("number", "code", "said"),
    [
        ("SIGINT", 130, "interrupted; every file that was written is whole"),
        ("SIGTERM", 143, "terminated; every file that was written is whole"),
    ],
)
def test_signal_ends_run_with_a_sentence(workbench: Run, number: str, code: int, said: str) -> None:
    Path("x.py").write_text(f"import signal\nsignal.raise_signal(signal.{number})\n")
    assert workbench("run", "x.py") == (code, "", said + "\n")
    assert not list(Path().glob("runs/*"))


@pytest.mark.parametrize(("number", "word"), [("SIGINT", "interrupted"), ("SIGTERM", "terminated")])
def test_signal_says_what_is_on_disk(
    workbench: Run, monkeypatch: pytest.MonkeyPatch, number: str, word: str
) -> None:
    def stored_some(*_: object, **__: object) -> None:
        signal.raise_signal(getattr(signal, number))

    monkeypatch.setattr("workbench.comparison.compare", stored_some)
    code, _, err = workbench("compare", "landmarks", "--out", "kept")
    assert code == {"SIGINT": 130, "SIGTERM": 143}[number]
    assert err.startswith(f"{word} while")
    assert "what was finished is stored in kept, and the same command continues" in err
