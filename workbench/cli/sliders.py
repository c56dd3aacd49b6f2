"""`workbench sliders`: a body whose pose and shape move in a browser."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from workbench.bodies.catalogue import BODIES, load_body
from workbench.cli.output import make_folder, print_page
from workbench.environment import expanded
from workbench.reports.sliders import pose_and_betas, settings_of, write_sliders


def sliders(
    name: Annotated[
        str, typer.Argument(help=f"An embedded body ({', '.join(BODIES)}), or a file of your own.")
    ] = "default",
    place: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="Open with the pose and betas of a fit: the folder of a run, of a registration "
            "or of a clip, or an .npz.",
        ),
    ] = None,
    frame: Annotated[
        int, typer.Option(help="Which frame of --from, where the fit has several.")
    ] = 0,
    out: Annotated[Path, typer.Option(help="Folder that the page is written to.")] = Path("runs"),
) -> None:
    """Write a page with sliders for pose and shape, and switches for the parts of its model."""
    model = load_body(name)
    path = out / f"sliders-{Path(name).stem}.html"
    if place is None:
        make_folder(out)
        page = write_sliders(model, path)
    else:
        fit = expanded(place)
        start = settings_of(*pose_and_betas(fit, model, frame), model)
        make_folder(out)
        page = write_sliders(model, path, start, str(place))
    print_page(Console(), "page", page)
