"""`workbench check-body`: what the file of a body model is, and what is wrong with it."""

from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.bodies.catalogue import BODIES, load_body
from workbench.bodies.checking.check_file import FileCheck, check_body_file, check_contents
from workbench.bodies.files.saving import arrays_of
from workbench.cli.output import rich_table, say
from workbench.reports.page import Table

WARNED = 1  # the exit code if there are warnings
HEAD = ("key", "shape and type", "what becomes of it")


def check_body(
    file: Annotated[
        str,
        typer.Argument(
            help="The file of a model (.npz or .pkl of SMPL, SMPL-H, SMPL-X, MANO, FLAME, STAR, or "
            "one that the workbench wrote), or the name of an embedded body."
        ),
    ],
) -> None:
    """Say what a model file is, which of its keys are used and kept, and what is wrong with it.

    Each warning says what to do. The exit code is 0 if there are none, 1 if there are, and 2 if the
    file cannot be read.
    """
    console = Console()
    if file in BODIES:
        found = check_contents(dict(arrays_of(load_body(file))), file)
    else:
        found = check_body_file(file)
    _print(console, found)
    if found.warnings:
        raise typer.Exit(WARNED)


def _print(console: Console, found: FileCheck) -> None:
    widest = max(map(len, found.facts))
    say(console, f"[bold]{escape(found.path)}[/]")
    for name, text in found.facts.items():
        say(console, f"  {escape(f'{name:{widest}}')}  {escape(text)}")
    console.print()
    console.print(rich_table(Table(HEAD, found.keys, numbers=())))
    console.print()
    for finding, line in zip(found.findings or [None], found.lines(), strict=True):
        warned = finding is not None and finding.warning
        say(console, f"[bold yellow]{escape(line)}[/]" if warned else escape(line))
