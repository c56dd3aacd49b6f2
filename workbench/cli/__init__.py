"""The command line: parsing, progress and printing; no mathematics."""

import sys
from io import TextIOWrapper
from typing import NoReturn

from workbench.cli.leaving import Interrupted, Terminated, be_done, held, mind_termination


def main() -> None:
    """Run a command. Errors of ours are a sentence and exit code 2, an interrupt is 130."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a name that it cannot write is no reason to stop
    try:
        mind_termination()
        with held():
            from workbench.cli.app import app  # takes a second: not before interrupts are minded
        app()
    except Interrupted as leaving:
        _leave(str(leaving), 130)
    except KeyboardInterrupt:
        _leave("interrupted; nothing was written", 130)
    except SystemExit as leaving:  # Typer's, also of an interrupt while it reads the arguments
        if leaving.code == 130:
            _leave("interrupted; nothing was written", 130)
        raise
    except Terminated:
        be_done()
        _leave("terminated; nothing was written", 143)
    except Exception as error:
        _explain(error)
        sys.exit(2)


def _leave(sentence: str, code: int) -> NoReturn:
    print(sentence, file=sys.stderr)
    sys.exit(code)


def _explain(error: Exception) -> None:
    """A sentence for an error of ours; whatever else there is, is a mistake in the workbench."""
    from rich.console import Console
    from rich.markup import escape

    from workbench.errors import WorkbenchError

    if not isinstance(error, WorkbenchError):
        raise error
    Console(stderr=True).print(
        f"[bold red]error:[/] {escape(str(error))}", highlight=False, soft_wrap=True
    )
