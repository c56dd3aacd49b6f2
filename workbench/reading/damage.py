"""Damaged files: what goes wrong when they are read, as one sentence."""

import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from workbench.errors import BadFile, cut

LONGEST_REASON = 400  # characters: what a file says may be as long as it likes
DAMAGE: tuple[type[Exception], ...] = (
    # zipfile: no archive, a member that is cut off, packed in a way that zipfile does not
    # implement (NotImplementedError), or that has a password (RuntimeError)
    *(zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, RuntimeError),
    *(struct.error, KeyError, IndexError),
    # numpy's parser of headers calls ast.literal_eval, tokenize and np.dtype on what it finds;
    # ValueError includes text that cannot be decoded, RuntimeError expressions that are too deep
    *(ValueError, SyntaxError, tokenize.TokenError, TypeError, AttributeError),
    *(OverflowError, MemoryError),
    Warning,  # of either, where the caller turns warnings into errors
)


@contextmanager
def taken_for(path: str | Path, what: str, do: str) -> Iterator[None]:
    """Turn BadFile with a reason into BadFile with a sentence: `PATH is no WHAT (REASON); DO`.

    Where there is no such file, that is the sentence.
    """
    try:
        yield
    except BadFile as error:
        if isinstance(error.__cause__, FileNotFoundError):
            raise BadFile(f"there is no file {path}") from error
        raise BadFile(f"{path} is no {what} ({cut(error, LONGEST_REASON)}); {do}") from error


@contextmanager
def damage(name: str = "") -> Iterator[None]:
    """Turn whatever NumPy and zipfile raise for a damaged file into BadFile with the reason.

    `name` is the array that was being read.
    """
    try:
        yield
    except BadFile as error:
        raise BadFile(f"{name} {error}" if name else str(error)) from error.__cause__
    except DAMAGE as error:
        message = getattr(error, "strerror", None) or str(error) or type(error).__name__
        reason = cut(message, LONGEST_REASON)
        raise BadFile(f"{name}: {reason}" if name else reason) from error


def refuse_what_is_no_file(path: Path) -> None:
    """Raise BadFile for a pipe, which might never send anything, a folder or an endless device."""
    with damage():
        there, whole = path.exists(), path.is_file()
    if there and not whole:
        raise BadFile("it is no file but a folder, a pipe or a device")
