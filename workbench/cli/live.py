"""`workbench live`: a start set by hand, and solvers whose iterates stream into the page."""

import webbrowser
from typing import Annotated

import typer
from rich.console import Console

from workbench.cli.run import Name, Setting, settings
from workbench.errors import BadArgument
from workbench.experiments import find
from workbench.reports.replays import live_server


def live(
    name: Name = "balance",
    setting: Setting = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Of the page; 0 takes a free one.")
    ] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Move a body by hand, press a solver, and watch its iterates come in; until Ctrl-C."""
    console = Console()
    experiment = find(name, settings(setting))
    console.print(f"[dim]building {experiment.name}[/]", highlight=False)
    setup = experiment.setup()
    try:
        server = live_server(experiment.name, setup, port)
    except OSError as error:
        raise BadArgument(
            f"port {port} cannot be used ({error.strerror}); leave --port out to take a free one"
        ) from error
    console.print(f"open {server.address}", soft_wrap=True, highlight=False)
    console.print("[dim]Ctrl-C ends it[/]")
    if browser:
        webbrowser.open(server.address)
    try:
        server.serve()
    except KeyboardInterrupt:
        console.print("[dim]ended[/]")
