"""What can go wrong, said once, with what exists instead and what would put it right."""

from collections.abc import Iterable


class WorkbenchError(Exception):
    """Base of every error that the workbench raises on purpose."""


def listed(names: Iterable[str]) -> str:
    """The names in order, for the end of a sentence: `betas, pose, trans`."""
    return ", ".join(sorted(names)) or "none"


class UnknownName(WorkbenchError):
    """A name that is not among those that exist: of a block, a body, a solver, an experiment."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        super().__init__(f"no {kind} is called {name!r}; there are {listed(known)}")


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


class BadResidual(WorkbenchError):
    """A residual that cannot be part of a problem."""


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


class NotSupported(WorkbenchError):
    """A solver was asked for what its algorithm does not have."""


class BadBounds(WorkbenchError):
    """Bounds that no point satisfies."""
