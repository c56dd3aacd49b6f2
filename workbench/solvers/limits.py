"""How far a run may go, and the end of one."""

from collections.abc import Callable
from typing import Protocol, TypeVar

from workbench.solvers.solution import Status

T = TypeVar("T")


class Limits(Protocol):
    """What every solver's options include."""

    @property
    def max_iterations(self) -> int:
        """Steps."""

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


def guarded(function: Callable[[], T]) -> T:
    """What a function of the user's gives; what it raises is a Stop that quotes it."""
    try:
        return function()
    except (Stop, KeyboardInterrupt):
        raise
    except Exception as error:
        raise Stop(Status.RAISED, f"the residual raised {type(error).__name__}: {error}") from error
