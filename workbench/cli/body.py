"""`workbench body`: what a body is made of, and how it looks."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.bodies.catalogue import BODIES, load_body
from workbench.cli.run import make_folder
from workbench.homes import expanded
from workbench.reports import card_text, write_card


def body(
    name: Annotated[
        str, typer.Argument(help=f"An embedded body ({', '.join(BODIES)}), or a file of your own.")
    ] = "default",
    out: Annotated[Path, typer.Option(help="Folder that the card is written into.")] = Path("runs"),
) -> None:
    """Print a body's model card and draw it: front, side, and shapes at plus and minus 2 sd."""
    console = Console()
    model = load_body(name)
    console.print(escape(card_text(model)), highlight=False, soft_wrap=True)
    make_folder(out)
    source = "" if name in BODIES else str(expanded(name).resolve())
    page = write_card(model, out / f"body-{Path(name).stem}", source)
    console.print(f"card: [bold]{escape(str(page))}[/]", soft_wrap=True)
