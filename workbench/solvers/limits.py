"""How far a run may go, and the end of one."""

from typing import Protocol

from workbench.solvers.solution import Status


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
        """Wall time."""

    @property
    def gradient_tolerance(self) -> float:
        """Of Problem.optimality: at or below it a point counts as converged."""


class Stop(Exception):
    """The end of a run, from wherever it is noticed."""

    def __init__(self, status: Status, message: str = "") -> None:
        super().__init__(message or status.value)
        self.status, self.message = status, message or status.value
