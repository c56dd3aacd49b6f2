"""All commands. Importing this takes a second, because it imports everything that they need."""

from collections.abc import Callable
from functools import wraps
from typing import Annotated, ParamSpec

import typer

from workbench.cli import lecture
from workbench.cli.basins import basins
from workbench.cli.blendshapes import blendshapes
from workbench.cli.body import body
from workbench.cli.check_body import check_body
from workbench.cli.compare import compare
from workbench.cli.convert import convert_motion
from workbench.cli.coregister import coregister
from workbench.cli.design import design
from workbench.cli.diagnose import diagnose
from workbench.cli.export import export
from workbench.cli.fit import fit
from workbench.cli.info import info
from workbench.cli.leaving import Interrupted, Terminated
from workbench.cli.live import live
from workbench.cli.loop import loop
from workbench.cli.motion import motion
from workbench.cli.new import new
from workbench.cli.register import register
from workbench.cli.rig import rig
from workbench.cli.run import run
from workbench.cli.sample import sample
from workbench.cli.sliders import sliders
from workbench.cli.solvers import solvers
from workbench.cli.together import together
from workbench.cli.train import train
from workbench.cli.triangles import triangles
from workbench.installation import DISTRIBUTION, VERSION
from workbench.interrupts import caused_by

P = ParamSpec("P")

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


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


def interruptible(command: Callable[P, None]) -> Callable[P, None]:
    """A command that raises Interrupted for an interrupt from the keyboard, wherever it occurs."""

    @wraps(command)
    def run_it(*arguments: P.args, **options: P.kwargs) -> None:
        try:
            command(*arguments, **options)
        except (KeyboardInterrupt, SystemError) as error:
            if caused_by(error, KeyboardInterrupt):
                raise Interrupted("interrupted; nothing was written") from error
            if caused_by(error, Terminated):
                raise Terminated from error
            raise

    return run_it


for command in (
    run,
    fit,
    diagnose,
    design,
    sample,
    compare,
    train,
    rig,
    register,
    coregister,
    body,
    check_body,
    motion,
    export,
    basins,
    sliders,
    live,
    blendshapes,
    together,
    loop,
    triangles,
    solvers,
    new,
    info,
):
    app.command()(interruptible(command))

app.command("convert")(interruptible(convert_motion))

lectures = typer.Typer(help=lecture.HELP, no_args_is_help=True)
for name, verb in lecture.COMMANDS.items():
    lectures.command(name)(interruptible(verb))
app.add_typer(lectures, name="lecture")
