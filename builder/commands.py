"""COMMANDS.md: every command with its options, and the main names of the library.

`python -m builder.commands` writes it from the command line itself and from `workbench.__all__`.
"""

import textwrap
from pathlib import Path
from typing import Any

import typer

import workbench as wb
from builder.site.reference import FRONT_DOOR, PublicName, resolve
from workbench.cli.app import app

FILE = Path(__file__).parents[1] / "COMMANDS.md"
BEGINNING = """\
# Commands and main names

Written by `python -m builder.commands`; do not edit. `workbench COMMAND --help` explains every
option. What is in brackets may be left out; what stands after an option is its default or, in
capitals, what it takes. What a FILE.py may define is in [howto/problem.md](howto/problem.md), and
which files of data are read in [howto/fit.md](howto/fit.md) and [howto/scan.md](howto/scan.md).

Exit codes: 0 if all is well, 1 if `diagnose` or `body check` warns, draws cannot be used, an answer
is wrong or a part of the work failed, 2 if a command could not do what it was told, 130 after
Ctrl-C.
"""


def text() -> str:
    """All of COMMANDS.md."""
    parts = [BEGINNING, "## Commands\n"]
    parts += [section(name, command) for name, command in commands()]
    parts += ["## Main names of the library\n", "| name | what it is |\n| --- | --- |"]
    for name in sorted(wb.__all__, key=str.casefold):
        entry = PublicName(name, *resolve(FRONT_DOOR, name), public=True, exported=FRONT_DOOR)
        parts.append(f"| `wb.{name}` | {entry.summary.replace('|', chr(92) + '|')} |")
    return "\n".join(parts) + "\n"


def commands() -> list[tuple[str, Any]]:
    """Every command by the words that are typed, those of groups one by one."""
    found: list[tuple[str, Any]] = []
    group: Any = typer.main.get_command(app)
    for name, later in group.commands.items():
        inner = getattr(later.command, "commands", None)
        if inner is None:
            found.append((name, later.command))
        else:
            found += [(f"{name} {word}", command) for word, command in inner.items()]
    return found


def section(name: str, command: Any) -> str:
    """A command: the first paragraph of its help, and how it is typed."""
    help_ = " ".join(command.help.split("\n\n")[0].split())
    words = [usage(parameter) for parameter in command.params if not parameter.hidden]
    typed = textwrap.wrap(
        " ".join(word.replace(" ", "\0") for word in words),  # an option stays with its value
        100,
        initial_indent=f"workbench {name} ",
        subsequent_indent=" " * 4,
        break_long_words=False,
        break_on_hyphens=False,
    )
    shown = "\n".join(typed or [f"workbench {name}"]).replace("\0", " ")
    return f"{help_}\n\n```\n{shown}\n```\n"


def usage(parameter: Any) -> str:
    """An argument or an option as it is typed, in brackets if it may be left out."""
    name = parameter.metavar or parameter.name.upper().replace("_", "-")
    if parameter.param_type_name == "argument":
        typed = name if parameter.default is None else str(parameter.default)
        typed += "..." if parameter.nargs == -1 and not typed.endswith("...") else ""
    elif parameter.is_flag:
        off = parameter.default and parameter.secondary_opts
        typed = parameter.secondary_opts[0] if off else parameter.opts[0]
    elif parameter.multiple:
        default = parameter.default or [name]
        typed = " ".join(f"{parameter.opts[0]} {value}" for value in default) + " ..."
    else:
        default = name if parameter.default is None else parameter.default
        typed = f"{parameter.opts[0]} {default}"
    return typed if parameter.required else f"[{typed}]"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
    print(f"wrote {FILE.name}")
