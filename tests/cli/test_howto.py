"""The how-to pages: their code prints what they say, and their commands work as written."""

import re
import shlex
from pathlib import Path

import pytest

import workbench as wb
from tests.cli.conftest import Run
from workbench.experiments import find

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "howto").glob("*.md"))
EACH = pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
BLOCK = re.compile(r"```python\n(.*?)```(?:\n\n```\n(.*?)```)?", re.S)
COMMANDS = re.compile(r"^```\n(workbench .*?)```", re.S | re.M)


@EACH
def test_the_code_prints_what_the_page_says(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {"__name__": page.stem}
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    assert len(blocks) >= 2
    for code, shown in blocks:
        exec(compile(code, page.name, "exec", dont_inherit=True), names)
        assert capsys.readouterr().out == shown
    assert any(shown for _, shown in blocks)


def commands(page: Path) -> list[list[str]]:
    """What the first block of commands tells to type: `new`, and then what takes the file."""
    (typed,) = COMMANDS.findall(page.read_text(encoding="utf-8"))
    found = [shlex.split(line)[1:] for line in typed.splitlines()]
    assert [command[0] for command in found] == ["new", "run", "diagnose"]
    return found


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=() if p.stem == "solver" else pytest.mark.thorough) for p in PAGES],
    ids=lambda path: path.stem,
)
def test_the_commands_take_the_file(page: Path, workbench: Run) -> None:
    for command in commands(page):
        code, out, err = workbench(*command)
        assert code == 0, out + err


@EACH
def test_the_file_that_is_written_is_solved_and_has_no_warnings(
    page: Path, workbench: Run, tmp_path: Path
) -> None:
    new, *others = commands(page)
    assert workbench(*new)[0] == 0
    (path,) = tmp_path.glob("*.py")
    assert all(path.name in command for command in others)
    setup = find(str(path)).setup()
    solution = wb.solve(setup.problem, setup.start)
    assert solution.status is wb.Status.CONVERGED
    values = setup.start | solution.values
    assert not wb.diagnose(setup.problem, values, priors=setup.priors).warnings
    assert wb.sample(setup.problem, values, setup.problem.free.spelled()[:1]).usable


@EACH
def test_the_page_is_found_and_its_links_lead_somewhere(page: Path) -> None:
    link = f"howto/{page.name}"
    for name in ("README.md", "CONTRIBUTING.md"):
        assert link in (ROOT / name).read_text(encoding="utf-8"), name
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def test_a_file_that_is_no_solver_or_several_ends_in_a_sentence(
    workbench: Run, tmp_path: Path
) -> None:
    (tmp_path / "two.py").write_text("import workbench as wb\na = b = wb.GaussNewton()\n")
    (tmp_path / "none.py").write_text("x = 3\n")
    for file, said in (
        ("two.py", "defines several solvers: a and b; say `solver = ...` for one"),
        ("none.py", "none.py defines no solver; it needs `solver = ...`"),
        ("missing.py", "there is no file missing.py"),
    ):
        code, _, err = workbench("run", "nist-misra1a", "--solver", file)
        assert code == 2
        assert said in err
    assert not (tmp_path / "runs" / "nist-misra1a").exists()
