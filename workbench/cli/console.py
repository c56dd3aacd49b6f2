"""What a command prints: notes, tables, pages written, progress by parts, a waiting line."""

from collections.abc import Collection, Iterable
from contextlib import AbstractContextManager
from math import inf, isfinite
from pathlib import Path
from textwrap import wrap
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table as RichTable

from workbench.errors import BadArgument, BadFile, listed, some_of
from workbench.geometry.guesses import UP_TO_Y
from workbench.reports.folder import make_folder, refuse_foreign
from workbench.reports.page import Table

Up = Annotated[
    str | None,
    typer.Option(help=f"Axis that points up ({', '.join(UP_TO_Y)}); else it is guessed."),
]


def at_least_one(option: typer.CallbackParam, value: int) -> int:
    """The value of an option, of which there must be one or more. Raises BadArgument."""
    if value < 1:
        raise BadArgument(f"{option.opts[0]} takes 1 or more, not {value}")
    return value


def above_zero(option: typer.CallbackParam, value: float | None) -> float | None:
    """The value of an option, which has to be positive and finite. Raises BadArgument."""
    if value is not None and not 0 < value < inf:
        raise BadArgument(f"{option.opts[0]} takes a number above 0, not {value:g}")
    return value


def comma_separated(option: str, text: str) -> list[float]:
    """The finite numbers in a text with commas between them. Raises BadArgument."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = [inf]
    if not all(map(isfinite, numbers)):
        raise BadArgument(f"{option} takes finite numbers such as 1,-0.5,2; not {text!r}")
    return numbers


def folder_to_write(out: Path, name: str, source: str) -> Path:
    """The folder `name` in `out`, which a command checks before it begins its work.

    Raises BadFile if it holds anything but a report on `source`, and if `out` cannot be made.
    """
    make_folder(out)
    refuse_foreign(out / name, source)
    return out / name


def files_inside(console: Console, folder: Path, kinds: Collection[str], what: str) -> list[Path]:
    """The files of some kinds in a folder, by name; says which others are there.

    Raises BadFile if there are none. In sentences the files are `what`.
    """
    files: list[Path] = []
    others: list[str] = []
    for file in sorted(file for file in folder.iterdir() if file.is_file()):
        if file.suffix.lower() in kinds and not file.name.startswith("."):
            files.append(file)
        else:
            others.append(file.name)
    if not files:
        raise BadFile(
            f"the folder {folder} holds no {what}, which are files with {listed(kinds)}; "
            "howto/formats.md lists them"
        )
    if others:
        say_notes(console, [f"skipped, because they are no {what}: {some_of(others)}"])
    return files


def rich_table(table: Table) -> RichTable:
    """A table of a report in the form for a terminal; numbers are never broken or shortened.

    Nor are the names in the first column; headings above numbers are broken where these are narrow.
    """
    shown = RichTable(box=None, header_style="bold", pad_edge=False)
    for i, head in enumerate(table.head):
        number = i in table.numbers
        widest = max(len(text) for text in (*head.split(" "), *(row[i] for row in table.rows)))
        title = "\n".join(wrap(head, max(1, widest))) if number else head
        shown.add_column(title, justify="right" if number else "left", no_wrap=number or not i)
    for row in table.rows:
        shown.add_row(*map(escape, row))
    return shown


def say(console: Console, text: str) -> None:
    """Print text with markup, numbers in the colour of the text around them.

    Long lines are left for the terminal to break.
    """
    console.print(text, highlight=False, soft_wrap=True)


def say_notes(console: Console, notes: Iterable[str]) -> None:
    """Print notes on a file that was read or a result, dim."""
    for note in notes:
        say(console, f"[dim]note: {escape(note)}[/]")


def print_page(console: Console, kind: str, page: Path | str) -> None:
    """Say where something of a kind (report, card, body) was written, or what to type."""
    console.print(f"{kind}: [bold]{escape(str(page))}[/]", soft_wrap=True)


def warn_without_effect(console: Console, option: str, because: str) -> None:
    """Say that an option changes nothing; the command goes on."""
    say(console, f"[bold yellow]{option} changes nothing:[/] {escape(because)}")


def warn_unused(
    console: Console, ctx: typer.Context, options: Collection[str], because: str
) -> None:
    """Say that those of the options that were typed, be it with their defaults, change nothing."""
    for parameter in ctx.command.params:
        source = ctx.get_parameter_source(parameter.name or "")
        for option in parameter.opts if source and source.name == "COMMANDLINE" else ():
            if option in options:
                warn_without_effect(console, option, because)


def warn_of(console: Console, doubts: Iterable[str], of: str = "") -> None:
    """Print what speaks against a fit, each doubt a line, after the name of what was fitted."""
    for doubt in doubts:
        say(console, f"[bold yellow]warning:[/] {escape(of)}{escape(doubt)}")


class Bars:
    """Progress: bars where somebody watches, a line for each tenth elsewhere."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=console,
        )
        self._tasks: dict[str, int] = {}
        self._tenths: dict[str, int] = {}
        self.last = "starting"  # what is going on, and how much of it is done, for a sentence

    def __enter__(self) -> "Bars":
        if self._console.is_terminal:
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._console.is_terminal:
            self._bars.stop()

    def __call__(self, what: str, done: int, of: int) -> None:
        """Show that `done` of `of` parts are finished."""
        self.last = f"{what} ({done} of {of} done)"
        if self._console.is_terminal:
            if what not in self._tasks:
                self._tasks[what] = self._bars.add_task(what, total=of)
            self._bars.update(self._tasks[what], completed=done)  # type: ignore[arg-type]
        elif self._tenths.get(what) != 10 * done // max(1, of):
            self._tenths[what] = 10 * done // max(1, of)
            self._console.print(f"{what}: {done} of {of}", highlight=False)


def waiting(text: str) -> AbstractContextManager[object]:
    """Show a line on stderr as long as the context lasts."""
    return Console(stderr=True).status(text)
