"""Whose fault an error is: the line of a user's file, or an argument."""

import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from workbench.errors import BadArgument, BadFile, WorkbenchError


@contextmanager
def blaming(
    source: str, what: str = "", arguments: Mapping[str, Any] | None = None
) -> Iterator[None]:
    """What a user's Python file `source` raises inside is a BadFile that names its line.

    Without one, what `what` raises with `arguments` of the user's is a BadArgument; errors
    that are ours already, and those that nobody's arguments explain, pass.
    """
    try:
        yield
    except (Exception, SystemExit) as error:
        if source.endswith(".py"):
            raise BadFile(f"{_place(source, error)}: {_reason(error)}") from error
        if isinstance(error, WorkbenchError) or not arguments:
            raise
        given = ", ".join(f"{name}={value!r}" for name, value in arguments.items())
        raise BadArgument(f"{what} cannot be built with {given}: {_reason(error)}") from error


def _place(source: str, error: BaseException) -> str:
    """`line.py line 3`: where the file was when it happened, as deep inside as it is the file's."""
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == source]
    if isinstance(error, SyntaxError) and error.filename == source:
        lines.append(error.lineno)
    name = Path(source).name
    return f"{name} line {lines[-1]}" if lines and lines[-1] else name


def _reason(error: BaseException) -> str:
    if isinstance(error, WorkbenchError):
        return str(error)
    if isinstance(error, SystemExit):
        return f"it ends the program (sys.exit({error.code})) where it is read; take that out"
    said = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def caused_by(error: BaseException, kind: type[BaseException]) -> bool:
    """Whether an error is of a kind, or was raised for one: C code that is interrupted while it
    calls back raises a SystemError for the interrupt.
    """
    known: BaseException | None = error
    while known is not None and not isinstance(known, kind):
        known = known.__cause__
    return known is not None
