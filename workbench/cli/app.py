"""All commands by name. The file of each is imported when it is run: it takes a second or more."""

from typing import Annotated

import typer

from workbench.cli.later import Commands, Later
from workbench.environment import DISTRIBUTION, VERSION

NAMES = (
    "run",
    "fit",
    "diagnose",
    "design",
    "sample",
    "compare",
    "train",
    "rig",
    "register",
    "coregister",
    "body",
    "check-body",
    "motion",
    "export",
    "basins",
    "sliders",
    "live",
    "solvers",
    "new",
    "info",
    "convert",
    "lecture",
)

app = typer.Typer(
    cls=Commands, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False
)


def tell_version(wanted: bool) -> None:
    """Print the distribution's name and version, and exit."""
    if wanted:
        typer.echo(f"{DISTRIBUTION} {VERSION}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=tell_version,
            is_eager=True,
            help="Print the name and the version.",
        ),
    ] = False,
) -> None:
    """Fit a symbolic SMPL body model, and see what the fit cannot determine."""


def _later() -> None:
    """What Typer is given in place of a command: `Later` finds the command itself."""


for name in NAMES:
    app.command(name, cls=Later)(_later)
