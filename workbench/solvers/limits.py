"""How far a run may go, and the end of one."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

import numpy as np

from workbench.errors import TooLarge
from workbench.problem.memory import INSTEAD
from workbench.solvers.solution import Status


class Limits(Protocol):
    """What every solver's options include."""

    @property
    def max_iterations(self) -> int:
        """The largest number of steps."""

    @property
    def max_evaluations(self) -> int:
        """Of the residual, its gradient, its Jacobian and its Hessian, together."""

    @property
    def max_seconds(self) -> float:
        """Wall time. It is looked at before every evaluation: what a solver does between two of
        them, one step of linear algebra at most, is not interrupted.
        """

    @property
    def gradient_tolerance(self) -> float:
        """Of Problem.optimality: at or below it a point counts as converged."""


class Stop(Exception):
    """The end of a run, from wherever it is noticed."""

    def __init__(self, status: Status, message: str = "") -> None:
        super().__init__(message or status.value)
        self.status, self.message = status, message or status.value


def stop_of(error: BaseException | None) -> Stop | None:
    """The end that an exception means for a run; None for what is not the run's."""
    if isinstance(error, MemoryError):
        told = f"memory ran out in the linear algebra: {error}; {INSTEAD}"
        return Stop(Status.TOO_LARGE, told)
    return error if isinstance(error, Stop) else None


@contextmanager
def guarded() -> Iterator[None]:
    """Inside, a function of the user's is called; what it raises becomes a Stop that quotes it."""
    try:
        yield
    except (Stop, KeyboardInterrupt):
        raise
    except TooLarge as error:
        raise Stop(Status.TOO_LARGE, str(error)) from error
    except MemoryError as error:
        raise Stop(Status.TOO_LARGE, f"memory ran out: {error}; {INSTEAD}") from error
    except Exception as error:
        raise Stop(Status.RAISED, f"the residual raised {type(error).__name__}: {error}") from error


def unwarned() -> np.errstate:
    """A context for numbers that may be too large: a run looks whether what came is finite, and
    tells by its status; a warning beside that says less, and would be an exception for some.
    """
    return np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore")
