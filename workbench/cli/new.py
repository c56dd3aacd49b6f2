"""`workbench new`: a commented file to begin with, which runs as it is written."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.output import print_page, say
from workbench.scaffolds import SCAFFOLDS, write_scaffold

KINDS = "; ".join(f"{kind}: {scaffold.what}" for kind, scaffold in SCAFFOLDS.items())


def new(
    kind: Annotated[str, typer.Argument(help=f"One of {', '.join(SCAFFOLDS)}. {KINDS}.")],
    name: Annotated[
        str, typer.Argument(help="Its name: small letters, digits and underscores, without .py.")
    ],
    folder: Annotated[
        Path, typer.Option(help="Folder to write into; it is made if it does not exist.")
    ] = Path(),
) -> None:
    """Write a commented file of your own that works as it is: NAME.py, or a lecture's folder.

    Nothing is overwritten. The commands to try it with are printed.
    """
    console = Console()
    path = write_scaffold(kind, name, folder)
    print_page(console, kind, path)
    for command in SCAFFOLDS[kind].tries:
        said = f"workbench {command}".replace("FILE", str(path))
        say(console, f"[dim]try[/] {escape(said)}")
