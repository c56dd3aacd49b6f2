"""`workbench body`: what a body is made of, and how it looks."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.bodies.catalogue import BODIES, load_body
from workbench.cli.output import folder_to_write, print_page, say
from workbench.cli.run import Out
from workbench.environment import expanded
from workbench.reports import card_text, write_card


def body(
    name: Annotated[
        str, typer.Argument(help=f"An embedded body ({', '.join(BODIES)}), or a file of your own.")
    ] = "default",
    out: Out = Path("runs"),
) -> None:
    """Print a body's model card, and draw it from two sides and in several shapes."""
    console = Console()
    model = load_body(name)
    say(console, escape(card_text(model)))
    source = "" if name in BODIES else str(expanded(name).resolve())
    folder = folder_to_write(out, f"body-{Path(name).stem}", source)
    print_page(console, "card", write_card(model, folder, source))
