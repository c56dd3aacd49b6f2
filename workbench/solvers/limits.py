"""How far a run may go, what is counted for that, and the exception that ends it."""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, fields
from types import TracebackType

import numpy as np

from workbench.blocks import Values
from workbench.blocks.checks import from_zero
from workbench.errors import BadArgument, TooLarge
from workbench.problem import Problem
from workbench.problem.storage import INSTEAD
from workbench.solvers.abilities import Abilities
from workbench.solvers.solution import Callback, Solution, Status, limited


@dataclass(frozen=True)
class Limits(ABC):
    """How far a run may go: the options that all solvers have, each with defaults of its own.

    Attributes:
        max_iterations: the largest number of steps.
        max_evaluations: the largest number of evaluations of the residual, its gradient, its
            Jacobian and its Hessian together; those of constraints are not counted.
        max_seconds: wall time in seconds. It is looked at before every evaluation, so that one step
            of linear algebra may exceed it. To judge the end takes time and evaluations beyond.
        gradient_tolerance: a point whose `Problem.optimality` (a cosine, without unit) is at most
            this has converged. A larger one ends earlier and farther from the minimum.

    Raises BadArgument for a negative limit, or one that is no number.
    """

    _: KW_ONLY
    max_iterations: int = 1_000
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    def __post_init__(self) -> None:
        names = [field.name for field in fields(Limits) if field.name != "max_seconds"]
        from_zero(type(self).__name__, **{name: getattr(self, name) for name in names})
        if not self.max_seconds >= 0:
            raise BadArgument(f"max_seconds must be 0 or above, not {self.max_seconds!r}")

    @property
    @abstractmethod
    def abilities(self) -> Abilities:
        """What the algorithm needs and supports."""

    @abstractmethod
    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`."""


class Stop(Exception):
    """The end of a run, raised where it is noticed."""

    def __init__(self, status: Status, message: str = "") -> None:
        super().__init__(message or status.value)
        self.status, self.message = status, message or status.value


def stop_asked(answer: object) -> Stop | None:
    """The Stop by which a callback ends a run, if its answer is True; None for any other."""
    if isinstance(answer, bool | np.bool_) and answer:
        return Stop(Status.STOPPED, "stopped by the callback")
    return None


def stop_of(error: BaseException | None) -> Stop | None:
    """The Stop that an exception means for a run; None for an error that the run passes on."""
    if isinstance(error, TooLarge):
        return Stop(Status.TOO_LARGE, str(error))
    if isinstance(error, MemoryError):
        return Stop(Status.TOO_LARGE, f"memory ran out: {error}; {INSTEAD}")
    return error if isinstance(error, Stop) else None


class Guarded:
    """A context for calls of the user's functions: an exception becomes a Stop that quotes it."""

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        if isinstance(error, Exception) and not isinstance(error, Stop):
            message = f"the residual raised {type(error).__name__}: {error}"
            raise stop_of(error) or Stop(Status.RAISED, message) from error


GUARDED = Guarded()


def unwarned() -> np.errstate:
    """A context without NumPy's warnings of overflow and invalid numbers.

    A run checks whether numbers are finite and reports it by its status; a warning says less, and
    is an exception for those who turn warnings into errors.
    """
    return np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore")


class Meter:
    """The number of evaluations of each kind, and a clock, which starts when this is made.

    Attributes:
        counts: the number of evaluations by kind.
    """

    def __init__(self, kinds: Iterable[str], max_evaluations: int, max_seconds: float) -> None:
        self.counts = dict.fromkeys(kinds, 0)
        self._max_evaluations, self._max_seconds = max_evaluations, max_seconds
        self._began, self._pauses = time.perf_counter(), 0.0

    @property
    def seconds(self) -> float:
        """The time on the clock, in s."""
        return time.perf_counter() - self._began - self._pauses

    def check_evaluations(self) -> None:
        """Raise Stop if all evaluations are used up; those of constraints are not limited."""
        if limited(self.counts) >= self._max_evaluations:
            raise Stop(Status.MAX_EVALUATIONS)

    def check_seconds(self) -> None:
        """Raise Stop if the time is used up."""
        if self.seconds > self._max_seconds:
            raise Stop(Status.MAX_SECONDS)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """A context in which the clock stands still."""
        before = time.perf_counter()
        yield
        self._pauses += time.perf_counter() - before
