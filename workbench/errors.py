"""What can go wrong, said once, with what exists instead and what would put it right."""

from collections.abc import Iterable


class WorkbenchError(Exception):
    """Base of every error that the workbench raises on purpose."""


def listed(names: Iterable[str]) -> str:
    """The names in order, for the end of a sentence: `betas, pose, trans`."""
    return ", ".join(sorted(names)) or "none"


class UnknownName(WorkbenchError):
    """A name that is not among those that exist: of a block, a body, a solver, an experiment.

    `hint` is said after the names, or instead of them: `0 to 99`; `more` after the sentence.
    """

    def __init__(
        self, kind: str, name: str, known: Iterable[str] = (), *, hint: str = "", more: str = ""
    ) -> None:
        names = tuple(known)
        there = ", ".join((listed(names), hint) if names and hint else (hint or listed(names),))
        said = f"no {kind} is called {name!r}; there are {there}"
        super().__init__(f"{said} ({more})" if more else said)


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

    def __init__(self, name: str, shape: tuple[int, ...], given: Iterable[str]) -> None:
        super().__init__(
            f"block {name!r} {shape} was given no value; add it to the start values, "
            f"which hold {listed(given)}"
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

    def __init__(self, what: str, found: str, wanted: str = "real numbers") -> None:
        super().__init__(f"{what} must be an array of {wanted}, not {found}")


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


class Unsolved(WorkbenchError):
    """An exercise that still stands as it was handed out."""

    def __init__(self, exercise: str) -> None:
        super().__init__(
            f"exercise {exercise!r} is not solved yet: write your answer in place of this line"
        )
