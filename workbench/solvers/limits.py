"""How far a run may go, and the exception that ends it."""

from contextlib import ContextDecorator
from types import TracebackType
from typing import Protocol

import numpy as np

from workbench.errors import TooLarge
from workbench.problem.storage import INSTEAD
from workbench.solvers.abilities import Abilities
from workbench.solvers.solution import Status


class Options(Protocol):
    """What every solver's options include: what it can do, and how far a run may go.

    See `LevenbergMarquardt` for the limits.
    """

    @property
    def abilities(self) -> Abilities:
        """What the algorithm needs and supports."""

    @property
    def max_iterations(self) -> int:
        """The largest number of steps."""

    @property
    def max_evaluations(self) -> int:
        """The largest number of evaluations, those of constraints not counted."""

    @property
    def max_seconds(self) -> float:
        """Wall time in s, which is looked at before every evaluation."""

    @property
    def gradient_tolerance(self) -> float:
        """The `Problem.optimality` up to which a point counts as converged."""


class Stop(Exception):
    """The end of a run, raised where it is noticed."""

    def __init__(self, status: Status, message: str = "") -> None:
        super().__init__(message or status.value)
        self.status, self.message = status, message or status.value


def stop_asked(answer: object) -> Stop | None:
    """The Stop that the answer of a callback means: True ends a run, and nothing else does."""
    asked = isinstance(answer, bool | np.bool_) and bool(answer)
    return Stop(Status.STOPPED, "stopped by the callback") if asked else None


def stop_of(error: BaseException | None) -> Stop | None:
    """The Stop that an exception means for a run; None for an error that the run passes on."""
    if isinstance(error, MemoryError):
        message = f"memory ran out in the linear algebra: {error}; {INSTEAD}"
        return Stop(Status.TOO_LARGE, message)
    return error if isinstance(error, Stop) else None


class Guarded(ContextDecorator):
    """A context for calls of the user's functions: an exception becomes a Stop that quotes it."""

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        if isinstance(error, Exception) and not isinstance(error, Stop):
            raise _quoting(error) from error


GUARDED = Guarded()


def _quoting(error: Exception) -> Stop:
    if isinstance(error, TooLarge):
        return Stop(Status.TOO_LARGE, str(error))
    if isinstance(error, MemoryError):
        return Stop(Status.TOO_LARGE, f"memory ran out: {error}; {INSTEAD}")
    return Stop(Status.RAISED, f"the residual raised {type(error).__name__}: {error}")


def unwarned() -> np.errstate:
    """A context without NumPy's warnings of overflow and invalid numbers.

    A run checks whether numbers are finite and reports it by its status; a warning says less, and
    is an exception for those who turn warnings into errors.
    """
    return np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore")
