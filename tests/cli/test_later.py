"""Commands are found by name, and their files are imported when they are run."""

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from workbench.cli import later
from workbench.cli.app import NAMES, app
from workbench.cli.later import Later, summary

ROOM = Path(later.__file__).parent
GROUP: Any = typer.main.get_command(app)
HELP = """
import sys
from workbench.cli import main
try: main()
except SystemExit: print(sorted({name.partition(".")[0] for name in sys.modules}))
"""


def test_help_imports_no_command() -> None:
    done = subprocess.run(
        [sys.executable, "-c", HELP, "--help"], capture_output=True, text=True, check=True
    )
    told, modules = done.stdout.rstrip().rsplit("\n", 1)
    assert all(f" {name} " in told for name in NAMES)
    assert not {"casadi", "numpy", "scipy", "matplotlib"} & set(ast.literal_eval(modules))


@pytest.mark.parametrize("name", NAMES)
def test_its_summary_and_options_are_those_of_the_command(name: str) -> None:
    command = GROUP.commands[name]
    assert isinstance(command, Later)
    assert summary(name.replace("-", "_")) == command.whole.help
    context = command.make_context(name, [], resilient_parsing=True)
    assert context.command is command.whole
    if name != "lecture":
        own, word = typer.Typer(add_completion=False), name.replace("-", "_")
        own.command()(getattr(import_module(f"workbench.cli.{word}"), word))
        options = [option.opts for option in typer.main.get_command(own).params]
        assert [one.opts for one in command.get_params(context)][: len(options)] == options


def test_every_file_with_a_command_is_named() -> None:
    """A function with the name of its file is a command if it has arguments or options."""
    words = {name.replace("-", "_") for name in NAMES}
    for file in sorted(ROOM.glob("*.py")):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.name == file.stem:
                assert ("typer." in ast.unparse(node.args)) <= (file.stem in words), file


def test_an_unknown_command_has_neighbours() -> None:
    found = CliRunner().invoke(app, ["diagnos"])
    assert found.exit_code == 2
    assert "diagnose" in found.output
