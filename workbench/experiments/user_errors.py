"""Errors in a user's own file or arguments, reported with the line or the argument."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from workbench.errors import BadArgument, BadFile, WorkbenchError, line_of, message_of

IN_CASADI = re.compile(r"^\S*casadi\S*:\d+: (Assertion .* failed:\s*)?")  # where in its source
UNLIKE = re.compile(r"Dimension mismatch for (.+), x is (\d+)x(\d+), while y is (\d+)x(\d+)")
COLUMNS = (
    "in expressions points are columns, so that the symbol of a block of shape (N, 3) is 3 x N, as "
    "that of joints or vertices is"
)
NO_NUMBERS = {
    "Points": "Points are no numbers: take their .symbol",
    "Block": "a Block is no number: take its .symbol",
}


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
    said = error.msg if isinstance(error, SyntaxError) else message_of(error)
    for kind, instead in NO_NUMBERS.items():
        if isinstance(error, TypeError) and f"'{kind}'" in said:
            return f"{said}; {instead}"
    if place := IN_CASADI.match(said):
        return _shapes(said[place.end() :])
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def _shapes(said: str) -> str:
    """What CasADi says, and what to do if it is about matrices that do not fit."""
    if found := UNLIKE.search(said):
        operation, *sizes = found.groups()
        a, b, c, d = map(int, sizes)
        turned = (a, b) == (d, c)
        said = f"{operation} needs matrices of one shape, but x is {a} x {b} and y is {c} x {d}" + (
            "; one of them is transposed: take a .T away, or put one in" if turned else ""
        )
    return f"{said.rstrip('.')}; {COLUMNS}" if "dimension" in said or "shape" in said else said
