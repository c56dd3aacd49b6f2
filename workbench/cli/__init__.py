"""The command line: parsing, progress and printing; no mathematics."""

import sys

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.body import body
from workbench.cli.fit import fit
from workbench.cli.info import info
from workbench.cli.run import run
from workbench.errors import WorkbenchError

app = typer.Typer(
    help="A symbolic SMPL body model: fit it, and see what the fit cannot know.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command()(run)
app.command()(fit)
app.command()(body)
app.command()(info)


def main() -> None:
    """Run a command; an error of ours is a sentence and exit code 2, not a traceback."""
    try:
        app()
    except WorkbenchError as error:
        Console(stderr=True).print(
            f"[bold red]error:[/] {escape(str(error))}", highlight=False, soft_wrap=True
        )
        sys.exit(2)
    except KeyboardInterrupt:
        Console(stderr=True).print("interrupted; nothing was written")
        sys.exit(130)
