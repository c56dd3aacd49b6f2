"""Values in words, for a line of a table: rounded, and cut where they are long."""

from dataclasses import dataclass
from typing import Any

import numpy as np

LONGEST = 300  # characters of a value
LONGEST_TEXT = 1000  # characters of any other text from the process of a student's file


@dataclass(frozen=True)
class Described:
    """Stands for a value that is no number, array, text, list, tuple or dict of these.

    Attributes:
        kind: what the value is, such as `a set`.
        words: the value in words.
    """

    kind: str
    words: str

    def __repr__(self) -> str:
        return f"<{self.kind}: {self.words}>"


def described(value: Any, words: str = "") -> Described:
    """A value that cannot be sent, in words; for a function they say that it has to be called."""
    return Described(kind(value), words or ("call it" if callable(value) else in_words(value)))


def in_words(value: Any) -> str:
    """Numbers to six digits; anything else as its repr, or as its type if that raises an error."""
    if isinstance(value, Described):
        return value.words
    if isinstance(value, bool | np.bool_ | str):
        return cut(repr(value) if isinstance(value, str) else str(bool(value)))
    try:
        array = np.asarray(value)
        if array.dtype.kind != "c":
            array = np.asarray(array, dtype=float)
    except Exception:
        return cut(_repr(value))
    if array.ndim == 0:
        return f"{array:.6g}"
    return cut(np.array2string(array, precision=6, suppress_small=True, threshold=40))


def kind(value: Any) -> str:
    """What a value is: `an array of shape (3, 3)`, `a str`."""
    if isinstance(value, Described):
        return value.kind
    if value is None:
        return "None"
    shape = np.shape(value) if isinstance(value, np.ndarray) else None
    if shape is not None:
        return f"an array of shape {shape}" if shape else "a number"
    if isinstance(value, bool | int | float | np.number):
        return "a number"
    if isinstance(value, list | tuple | dict):
        return f"a {type(value).__name__} of length {len(value)}"
    if hasattr(value, "is_symbolic"):
        return f"a CasADi {type(value).__name__} of shape {value.shape}"
    return f"a {type(value).__name__}"


def cut(text: str, longest: int = LONGEST) -> str:
    """The text, or the beginning of one that is too long."""
    return text if len(text) <= longest else text[:longest] + " ..."


def legible(text: str) -> str:
    """A foreign text in a form that may be printed: cut, with control characters spelled out.

    A terminal obeys control characters: with a few of them a text could clear the screen and
    print results of its own.
    """
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode("ascii")
        for c in cut(text, LONGEST_TEXT)
    )


def _repr(value: Any) -> str:
    try:
        return repr(value)
    except Exception:
        return kind(value)
