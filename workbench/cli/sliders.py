"""`workbench sliders`: a body whose pose and shape move in a browser."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from workbench.bodies.catalogue import BODIES, load_body
from workbench.cli.output import make_folder, print_page
from workbench.reports.sliders import write_sliders


def sliders(
    name: Annotated[
        str, typer.Argument(help=f"An embedded body ({', '.join(BODIES)}), or a file of your own.")
    ] = "default",
    out: Annotated[Path, typer.Option(help="Folder that the page is written to.")] = Path("runs"),
) -> None:
    """Write a page with sliders for pose and shape, and switches for the parts of its model."""
    model = load_body(name)
    make_folder(out)
    page = write_sliders(model, out / f"sliders-{Path(name).stem}.html")
    print_page(Console(), "page", page)
