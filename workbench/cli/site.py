"""`workbench site`: everything that there is to read, as one static site."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.site import write_site


def site(folder: Annotated[Path, typer.Argument(help="Where to write; it is made.")]) -> None:
    """Write the whole site: course, examples, reference and documents. Needs the extra `course`.

    Every lecture and every example is run. `workbench lecture site` writes the course alone.
    """
    console = Console()
    page = write_site(folder, lambda said: console.print(f"[dim]{escape(said)}[/]"))
    console.print(f"site: [bold]{escape(str(page))}[/]", soft_wrap=True)
