"""What a command finds as it starts: streams that may be closed, full, or unable to write a
character, and a folder that may be gone.
"""

import os
import sys
from contextlib import suppress
from io import TextIOWrapper
from traceback import walk_tb
from typing import TextIO

PRINTERS = ("rich", "typer", "click")


def prepare() -> None:
    """Open what is closed, and let a letter that cannot be written be no reason to stop.

    A stream that is closed leaves its number to the next file that is opened, and what is
    printed would end in that file.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the smallest number that is not in use
    if sys.stdin is None:
        sys.stdin = open(os.devnull, encoding="utf-8")  # noqa: SIM115  # as long as the process
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")


def nowhere() -> bool:
    """Whether the current folder was deleted: Python itself, and many libraries, stumble then."""
    try:
        os.getcwd()
    except OSError:
        return True
    return False


def failure(stream: TextIO) -> OSError | None:
    """The error by which text printed to the stream could not be written; None if it was written.

    After an error, whatever else is printed to the stream is discarded.
    """
    try:
        stream.flush()
    except OSError as error:
        with suppress(OSError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
        return error
    return None


def unprinted(error: Exception | None) -> OSError | None:
    """The given error, if it means that output could not be printed; None otherwise.

    Such an error names no file, and was raised in a library that prints.
    """
    if not isinstance(error, OSError) or error.filename is not None:
        return None
    frames = [frame for frame, _ in walk_tb(error.__traceback__)]
    inside = str(frames[-1].f_globals.get("__name__", "")) if frames else ""
    return error if inside.partition(".")[0] in PRINTERS else None


def tell(sentence: str) -> None:
    """Print to the standard error; if that fails as well, only the exit code says what happened."""
    with suppress(OSError):
        print(sentence, file=sys.stderr, flush=True)
    failure(sys.stderr)


def explain(error: Exception) -> bool:
    """Print the sentence of an error of ours, and return True.

    Return False for any other error, which is a mistake in the workbench.
    """
    from rich.console import Console
    from rich.markup import escape

    from workbench.errors import WorkbenchError

    if not isinstance(error, WorkbenchError):
        return False
    with suppress(OSError):
        Console(stderr=True).print(
            f"[bold red]error:[/] {escape(str(error))}", highlight=False, soft_wrap=True
        )
    failure(sys.stderr)
    return True
