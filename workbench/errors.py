"""The errors of the workbench: what was wrong, what exists instead, and what to do."""

import traceback
from collections.abc import Collection, Iterable, Sequence
from itertools import islice

MOST_SHOWN = 60  # characters of a value in a message
LONGEST_MESSAGE = 300  # characters of a message that another library made


class WorkbenchError(Exception):
    """Base of every error that the workbench raises on purpose."""


def listed(names: Iterable[str]) -> str:
    """The names in order, for the end of a sentence: `betas, pose, trans`."""
    return ", ".join(sorted(names)) or "none"


def shown(value: object, most: int = MOST_SHOWN, levels: int = 2) -> str:
    """A value of a file or of a caller for the end of a sentence, in `most` characters or so.

    The effort does not depend on the size of the value: of lists it reads a few items and two
    levels, of text the beginning; long whole numbers are not written in decimals (which Python
    refuses), and everything else is named by its type. The result is printable on any terminal.
    """
    if isinstance(value, str | bytes):
        text = repr(value[:most])
        return text if len(value) <= most else f"{text[:-1]}...{text[-1]}"
    if isinstance(value, int) and not isinstance(value, bool) and value.bit_length() > 3 * most:
        return f"a whole number of {value.bit_length():,} bits"
    if value is None or isinstance(value, bool | int | float | complex):
        return f"{value}"
    if isinstance(value, list | tuple):
        return _items(value, most, levels)
    size = f" of {len(value):,} entries" if isinstance(value, dict) else ""
    return f"a {type(value).__name__}{size}"


def _items(several: list[object] | tuple[object, ...], most: int, levels: int) -> str:
    left, right = "[]" if isinstance(several, list) else "()"
    if several and not levels:
        return f"{left}...{right}"
    parts: list[str] = []
    for value in islice(several, most // 6):
        parts.append(shown(value, most // 2, levels - 1))
        if sum(map(len, parts)) > most:
            break
    more = ["..."] if len(parts) < len(several) else []
    comma = "," if len(several) == 1 and left == "(" else ""
    return f"{left}{', '.join(parts + more)}{comma}{right}"


def message_of(error: object) -> str:
    """What an error says; also of one of a user's own whose text cannot be made."""
    try:
        return str(error)
    except Exception as why:
        return f"its message cannot be made: {type(why).__name__} in __str__"


def cut(text: object, most: int = LONGEST_MESSAGE) -> str:
    """A text, or what an error says, cut to `most` characters and printable on any terminal."""
    full = message_of(text) or type(text).__name__
    short = full if len(full) <= most else f"{full[:most]}..."
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in short)


def line_of(error: BaseException, file: str) -> int | None:
    """The innermost line of a Python file that was executed, or is wrong, when an error arose."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return error.lineno
    frames = traceback.extract_tb(error.__traceback__)
    return next((frame.lineno for frame in reversed(frames) if frame.filename == file), None)


def some(names: Iterable[str]) -> str:
    """The first of several names, each cut short, and how many more there are."""
    every = list(names)
    parts: list[str] = []
    for name in every:
        if sum(len(part) + 2 for part in parts) > LONGEST_MESSAGE:
            parts.append(f"and {len(every) - len(parts):,} more")
            break
        parts.append(cut(name, MOST_SHOWN))
    return ", ".join(parts) or "none"


def joined(names: Sequence[str]) -> str:
    """One name or more as a sentence enumerates them: `a, b and c`."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def some_of(names: Sequence[str], most: int = 5) -> str:
    """The first of several names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


class UnknownName(WorkbenchError):
    """A name of a block, a body, a solver or an experiment that does not exist.

    `hint` follows the known names, or takes their place: `0 to 99`; `more` follows the sentence.
    """

    def __init__(
        self, kind: str, name: str, known: Iterable[str] = (), *, hint: str = "", more: str = ""
    ) -> None:
        names = tuple(known)
        choices = ", ".join((listed(names), hint) if names and hint else (hint or listed(names),))
        sentence = f"no {kind} is called {name!r}; there are {choices}"
        super().__init__(f"{sentence} ({more})" if more else sentence)


def check_known(kind: str, name: str, known: Collection[str]) -> None:
    """Raise UnknownName unless the name is one of those that are known."""
    if name not in known:
        raise UnknownName(kind, name, known)


class UnreadBlock(UnknownName):
    """A block that exists, but that no residual and no constraint of a problem reads."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        WorkbenchError.__init__(
            self,
            f"no residual and no constraint reads the block {name!r}, so nothing can find it; "
            f"they read {listed(known)}. Do not free or bound it, or add a residual that reads it",
        )


class MissingValue(WorkbenchError):
    """A block that the problem reads was given no numbers."""

    def __init__(self, name: str, shape: tuple[int, ...], available: Iterable[str]) -> None:
        super().__init__(
            f"block {name!r} {shape} was given no value; add it to the start values, "
            f"which hold {listed(available)}"
        )


class ShapeMismatch(WorkbenchError):
    """An array of the wrong shape."""

    def __init__(self, name: str, *, expected: tuple[int, ...], got: tuple[int, ...]) -> None:
        super().__init__(f"block {name!r} has shape {expected}, but was given {got}")


class NonFiniteValue(WorkbenchError):
    """NaN or infinity among numbers that must be finite."""

    def __init__(self, name: str, where: str, value: float) -> None:
        super().__init__(
            f"block {name!r} holds {value} at {where}; give a finite number there, "
            "or give a missing observation confidence 0"
        )


class NotNumbers(WorkbenchError):
    """Text, None, rows of different lengths or complex numbers where real numbers belong."""

    def __init__(self, what: str, got: str, expected: str = "real numbers") -> None:
        super().__init__(f"{what} must be an array of {expected}, not {got}")


class TwoSymbolsOneName(WorkbenchError):
    """Two different blocks of one problem share a name."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"two different symbols are called {name!r}; make each block once and share it, "
            "or give one of them a prefix"
        )


class DuplicateResidual(WorkbenchError):
    """Two residuals of one problem share a name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"two residuals are called {name!r}; give one of them a name of its own")


class BadBlock(WorkbenchError):
    """A block whose shape or labels make no sense."""


class BadResidual(WorkbenchError):
    """A residual that cannot be part of a problem."""


class BadConstraint(WorkbenchError):
    """A constraint that cannot be part of a problem."""


class BadBody(WorkbenchError):
    """A body whose arrays do not fit together."""


class BadMesh(WorkbenchError):
    """Vertices and faces that do not fit together."""


class BadCamera(WorkbenchError):
    """A calibration that the camera model does not cover."""


class BadFile(WorkbenchError):
    """A file that cannot be read, or a place that cannot be written."""


class UnsafePickle(BadFile):
    """A pickle that asks for more than arrays; nothing it names was imported or run."""


class BadArgument(WorkbenchError):
    """An argument that a function or a command cannot take."""


class BadSetup(WorkbenchError):
    """An experiment's setup whose parts do not fit together."""


class NotSupported(WorkbenchError):
    """A solver was asked for what its algorithm does not have."""


class BadBounds(WorkbenchError):
    """Bounds that no point satisfies."""


class TooLarge(WorkbenchError):
    """What was asked for does not fit into the memory that is free."""


class NotFinite(WorkbenchError):
    """A Jacobian that holds NaN or infinity has no rank."""


class Unsolved(WorkbenchError):
    """An exercise that still stands as it was handed out."""

    def __init__(self, exercise: str) -> None:
        super().__init__(
            f"exercise {exercise!r} is not solved yet: write your answer in place of this line"
        )
