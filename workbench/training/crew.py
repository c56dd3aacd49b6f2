"""Who carries out many tasks that know nothing of each other: this process, or several."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Protocol, TypeVar

from joblib import Parallel, delayed

from workbench.errors import BadArgument
from workbench.threads import limited_threads

Task = TypeVar("Task")
Result = TypeVar("Result")
Say = Callable[[int, int], None]  # how many are done, of how many


class Crew(Protocol):
    """Does the work on every task; what comes back is in order, and the same whoever did it."""

    def __call__(self, work: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]:
        """One result for each task."""


def alone(work: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]:
    """In this process, one after the other, as they are asked for."""
    with limited_threads():
        yield from map(work, tasks)


@dataclass(frozen=True)
class Processes:
    """So many processes. A few tasks are in memory at a time."""

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise BadArgument(f"a crew has 1 process or more, not {self.count}")

    def __call__(self, work: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]:
        """Of one process: this one."""
        if self.count == 1:
            yield from alone(work, tasks)
            return
        parallel = Parallel(n_jobs=self.count, return_as="generator")
        yield from parallel(delayed(partial(_limited, work))(task) for task in tasks)


def _limited(work: Callable[[Task], Result], task: Task) -> Result:
    with limited_threads():
        return work(task)


def untold(done: int, of: int) -> None:
    """Nobody is told."""


@dataclass(frozen=True)
class Hands:
    """Who does the work, and who is told how far it is."""

    crew: Crew = alone
    say: Say = untold


ONE = Hands()
