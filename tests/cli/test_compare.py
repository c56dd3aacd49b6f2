"""`workbench compare`, as a user types it."""

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
        "compare", "line.py", "nist-misra1a", "--solver", "mine.py", "--solver",
        "levenberg-marquardt", "--seeds", "2", "--max-seconds", "5", "--out", "found",
    )  # fmt: skip
    done = workbench(*command, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "solving: 0 of 6" in done.stdout
    assert "from 3 of 3 starts each" in done.stdout
    page = (tmp_path / "found" / "index.html").read_text(encoding="utf-8")
    assert "A line through three points." in page
    assert "mine" in page
    again = workbench(*command, cwd=tmp_path)
    assert "solving: 6 of 6" in again.stdout
    assert "solving: 0 of 6" not in again.stdout


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
