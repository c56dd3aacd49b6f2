"""Errors in a user's own file or arguments, reported with the line or the argument."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from workbench.errors import BadArgument, BadFile, WorkbenchError, line_of


@contextmanager
def user_errors(
    source: str, what: str = "", arguments: Mapping[str, Any] | None = None
) -> Iterator[None]:
    """Turn exceptions raised in this context into errors that say what the user can correct.

    If `source` is a user's Python file, any exception becomes a BadFile that names the line.
    Otherwise an exception of `what`, which was given the user's `arguments`, becomes a
    BadArgument. A WorkbenchError, and any exception where there are no arguments, is raised as
    it is.
    """
    try:
        yield
    except (Exception, SystemExit) as error:
        if source.endswith(".py"):
            line = line_of(error, source)
            place = f"{Path(source).name} line {line}" if line else Path(source).name
            raise BadFile(f"{place}: {_reason(error)}") from error
        if isinstance(error, WorkbenchError) or not arguments:
            raise
        given = ", ".join(f"{name}={value!r}" for name, value in arguments.items())
        raise BadArgument(f"{what} cannot be built with {given}: {_reason(error)}") from error


def _reason(error: BaseException) -> str:
    if isinstance(error, WorkbenchError):
        return str(error)
    if isinstance(error, SystemExit):
        return f"it ends the program (sys.exit({error.code})) where it is read; take that out"
    said = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}: {said}" if said else type(error).__name__
