"""`workbench sliders`: a body whose pose and shape move in a browser."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.bodies.catalogue import BODIES, load_skinned
from workbench.cli.run import make_folder
from workbench.reports.sliders import write_sliders


def sliders(
    name: Annotated[
        str, typer.Argument(help=f"An embedded body ({', '.join(BODIES)}), or a file of your own.")
    ] = "default",
    out: Annotated[Path, typer.Option(help="Folder that the page is written into.")] = Path("runs"),
) -> None:
    """Write a page with sliders for theta and beta, and switches for the parts of SMPL."""
    model = load_skinned(name)
    make_folder(out)
    page = write_sliders(model, out / f"sliders-{Path(name).stem}.html")
    Console().print(f"page: [bold]{escape(str(page))}[/]", soft_wrap=True)
