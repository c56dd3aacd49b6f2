"""Commands whose files are imported when they are run.

The name of a command is that of its file in this room, with `-` for `_`, and of the function in it.
A file that holds several commands names them in `COMMANDS`, and tells in `HELP` what they are for.
"""

import ast
from collections.abc import Callable
from functools import cached_property, wraps
from importlib import import_module
from pathlib import Path
from typing import Any, ParamSpec

import typer
from typer.core import TyperCommand, TyperGroup

from workbench.cli.leaving import INTERRUPTED, Interrupted, Terminated, held
from workbench.interrupts import caused_by

P = ParamSpec("P")


class Later(TyperCommand):
    """A command of which only the name is known until it is run, or asked for its options."""

    @cached_property
    def whole(self) -> Any:
        """The command itself. Signals wait until its file has been imported."""
        with held():
            file = import_module(f"{__package__}.{_word(self)}")
        several = getattr(file, "COMMANDS", None)
        if several is None:
            own = typer.Typer(add_completion=False)
            own.command(self.name)(interruptible(getattr(file, _word(self))))
        else:
            own = typer.Typer(help=file.HELP, no_args_is_help=True, add_completion=False)
            for name, command in several.items():
                own.command(name)(interruptible(command))
        return typer.main.get_command(own)

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """The context of the command itself."""
        return self.whole.make_context(*arguments, **options)

    def get_params(self, ctx: Any) -> list[Any]:
        """The arguments and options of the command itself."""
        return list(self.whole.get_params(ctx))


class Commands(TyperGroup):
    """A group of such commands, whose summary is read from their files without importing these."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help of the group, with what each command is for."""
        for command in self.commands.values():
            command.help = summary(_word(command))
        super().format_help(ctx, formatter)


def interruptible(command: Callable[P, None]) -> Callable[P, None]:
    """A command that raises Interrupted for an interrupt from the keyboard, wherever it occurs."""

    @wraps(command)
    def run_it(*arguments: P.args, **options: P.kwargs) -> None:
        try:
            command(*arguments, **options)
        except (KeyboardInterrupt, SystemError) as error:
            if caused_by(error, KeyboardInterrupt):
                raise Interrupted(INTERRUPTED) from error
            if caused_by(error, Terminated):
                raise Terminated from error
            raise

    return run_it


def _word(command: Any) -> str:
    return str(command.name).replace("-", "_")


def summary(word: str) -> str:
    """The docstring of the function with the name of its file, or the constant `HELP` there."""
    source = Path(__file__).with_name(f"{word}.py").read_text(encoding="utf-8")
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef) and node.name == word:
            return ast.get_docstring(node) or ""
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "HELP":
            return str(ast.literal_eval(node.value))
    raise LookupError(f"{word}.py has neither a function {word} nor HELP")
