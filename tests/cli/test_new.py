"""Files to begin with: names, refusals, and every command that is printed with one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from workbench.cli.new import SCAFFOLDS, TEMPLATES, write_scaffold
from workbench.errors import BadArgument, BadFile


def test_templates_are_the_kinds_of_scaffolds() -> None:
    there = {path.name for path in TEMPLATES.iterdir() if not path.name.startswith("__")}
    assert {name.removesuffix(".py") for name in there} == {*SCAFFOLDS}


def test_scaffolds_take_the_name_and_public_names_are_enough(tmp_path: Path) -> None:
    for kind in SCAFFOLDS:
        path = write_scaffold(kind, "my_own", tmp_path / "deep" / kind)
        files = sorted(path.glob("*.py")) if path.is_dir() else [path]
        for file in files:
            text = file.read_text(encoding="utf-8")
            assert "NAME" not in text
            assert "lec00" not in text
            compile(text, file.name, "exec", dont_inherit=True)
        if kind != "lecture":
            imported = [line for line in files[0].read_text().splitlines() if "workbench" in line]
            modules = {line.split()[1] for line in imported if line.startswith(("import", "from"))}
            assert modules <= {"workbench", "workbench.solvers"}, kind


def test_scaffold_overwrites_nothing(tmp_path: Path) -> None:
    for kind in ("problem", "lecture"):
        path = write_scaffold(kind, "tea", tmp_path)
        file = path / "checks.py" if path.is_dir() else path
        file.write_text("mine")
        with pytest.raises(BadFile, match="exists already and was left as it is"):
            write_scaffold(kind, "tea", tmp_path)
        assert file.read_text() == "mine"


def test_scaffold_refuses_bad_names(tmp_path: Path) -> None:
    for name, said in (
        ("My", "begins with a small letter"),
        ("2fast", "begins with a small letter"),
        ("a/b", "without folder and without .py"),
        ("tea.py", "without folder and without .py"),
        ("", "begins with a small letter"),
        ("läufer", "begins with a small letter"),
        ("lambda", "not a keyword of Python"),
        ("numpy", "would hide"),
        ("workbench", "would hide"),
        ("x" * 41, "at most 40 characters"),
    ):
        with pytest.raises(BadArgument, match=said):
            write_scaffold("problem", name, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.thorough
@pytest.mark.parametrize("kind", SCAFFOLDS)
def test_commands_of_a_scaffold_work(kind: str, tmp_path: Path) -> None:
    """As typed, in a folder of one's own: run, diagnosed, compared and sampled."""
    typed(tmp_path, "new", kind, "my_own")
    path = next(p.name for p in tmp_path.iterdir() if "my_own" in p.name)
    for command in SCAFFOLDS[kind][1]:
        words = command.replace("FILE", path).split()
        code = 1 if words[:2] == ["lecture", "check"] else 0  # nothing is answered yet
        said = typed(tmp_path, *words, code=code)
        if words[0] == "compare":
            assert "any clock" in said


def typed(folder: Path, *arguments: str, code: int = 0) -> str:
    paths = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "workbench", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": paths, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr
