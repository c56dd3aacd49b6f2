"""`workbench solvers`, as a user types it."""

import os
import subprocess
import sys

from workbench import SOLVERS
from workbench.solvers.nlopt_algorithms import ALGORITHMS


def said(*arguments: str, columns: int = 200) -> list[list[str]]:
    done = subprocess.run(
        [sys.executable, "-c", "from workbench.cli import main; main()", "solvers", *arguments],
        env=os.environ | {"COLUMNS": str(columns)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [line.split() for line in done.stdout.splitlines()]


def test_every_solver_is_listed_with_what_it_can() -> None:
    rows = {words[0]: words for words in said() if words}
    assert list(SOLVERS) == [name for name in rows if name in SOLVERS]
    assert rows["ipopt-exact"][1:5] == ["Hessian", "yes", "=", "<"]
    assert rows["gauss-newton"][1:5] == ["Jacobian", "no", "-", "downhill"]
    assert rows["nlopt-mlsl"][2] == "needed"
    assert "teaching" in rows["steepest-descent"]


def test_nlopts_own_are_listed_by_their_names() -> None:
    rows = {words[0]: words for words in said("--nlopt") if words}
    assert rows.keys() >= ALGORITHMS.keys()
    assert rows["GN_ISRES"][1:8] == ["cost", "needed", "=", "<", "everywhere,", "at", "random"]


def test_a_narrow_terminal_breaks_no_words() -> None:
    lines = said(columns=80)
    assert ["newton", "Hessian", "no", "-", "downhill"] in lines
    assert sum(words[:1] == ["newton"] for words in lines) == 2
    assert any("Marquardt" in words for words in lines)
