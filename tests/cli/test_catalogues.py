"""`--help`, `workbench solvers` and `workbench info`: what there is, and how quickly."""

import ast
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from tests.cli.conftest import Run
from workbench import SOLVERS
from workbench.cli.app import VERBS, app
from workbench.solvers.nlopt import ALGORITHMS

HELP = """
import sys
from workbench.cli import main
try: main()
except SystemExit: print(sorted({name.partition(".")[0] for name in sys.modules}))
"""


def typed(program: str, *arguments: str, **environment: str) -> str:
    """What a process of its own prints."""
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_help_imports_no_numerical_library() -> None:
    told, modules = typed(HELP, "--help").rstrip().rsplit("\n", 1)
    assert all(f" {name} " in told for name in VERBS)
    assert not {"casadi", "numpy", "scipy", "matplotlib"} & set(ast.literal_eval(modules))


def test_helps_fit_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    group: Any = typer.main.get_command(app)
    for name, command in group.commands.items():
        inner = getattr(command.command, "commands", {})
        for words in [[name], *([name, word] for word in inner)]:
            told = CliRunner().invoke(app, [*words, "--help"]).output.splitlines()
            most = {"fit": 70, "motion": 48, "convert": 48}.get(name, 40)  # they read many formats
            assert len(told) <= most, (words, len(told))
            assert "\\[" not in "".join(told), words
            assert max(map(len, told)) <= 80
            assert not [line for line in told if line.endswith("...") and "Usage" not in line]


def test_tables_of_verbs_are_whole_at_80_columns(
    workbench: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for typed_ in ("solvers", "solvers --nlopt", "run --list", "body check small", "lecture list"):
        code, out, err = workbench(*typed_.split())
        assert code == 0, err
        assert "…" not in out, typed_


def test_solvers_lists_every_solver_with_what_it_can(workbench: Run) -> None:
    rows = [line.split() for line in workbench("solvers")[1].splitlines()]
    named: dict[str, list[str]] = {}
    for words in filter(None, rows):  # of the second table, what the first has not
        named[words[0]] = named.get(words[0], []) + words
    assert list(SOLVERS) == [name for name in named if name in SOLVERS]
    assert named["ipopt-exact"][1:5] == ["Hessian", "yes", "=", "<"]
    assert {"Jacobian", "no", "-", "downhill"} <= set(named["gauss-newton"])
    assert named["nlopt-mlsl"][2] == "needed"
    assert "teaching" in named["steepest-descent"]
    rows = [line.split() for line in workbench("solvers", "--nlopt")[1].splitlines()]
    named = {words[0]: words for words in reversed(rows) if words}
    assert named.keys() >= ALGORITHMS.keys()
    assert named["GN_ISRES"][1:5] == ["cost", "needed", "=", "<"]


@pytest.mark.thorough
def test_info_says_which_arithmetic_is_active_and_why(tmp_path: Path) -> None:
    said = typed(
        "from workbench.cli import main; main()",
        "info",
        WORKBENCH_COMPILE="0",
        WORKBENCH_CACHE=str(tmp_path / "kept"),
        WORKBENCH_THREADS="1",
    )
    said = " ".join(said.split())
    assert "NumPy: switched off by WORKBENCH_COMPILE=0" in said
    assert "0 libraries" in said
    assert "1 in a run" in said
    for package in ("casadi 3.", "numpy ", "scipy ", "nlopt ", "emcee ", "python 3."):
        assert package in said
