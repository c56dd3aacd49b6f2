"""Who carries out many tasks that know nothing of each other: this process, or several."""

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import resource_tracker
from typing import Protocol, TypeVar

from joblib import Parallel, delayed

from workbench.errors import BadArgument
from workbench.orphans import end_with
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
    """So many processes. A few tasks are in memory at a time.

    Ctrl-C is heard by this process alone, which ends the others; if it is killed, they end by
    themselves.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise BadArgument(f"a crew has 1 process or more, not {self.count}")

    def __call__(self, work: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]:
        """Of one process: this one."""
        if self.count == 1:
            yield from alone(work, tasks)
            return
        parallel = Parallel(
            n_jobs=self.count, return_as="generator",
            initializer=_begin, initargs=(os.getpid(),),
        )  # fmt: skip
        with _deaf():
            results = parallel(delayed(partial(_limited, work))(task) for task in tasks)
        yield from results


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes that are started inside begin with Ctrl-C blocked, for a terminal sends it to all
    of them at once, also while they are still importing. Here it waits until the block is over.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # which would unblock it, when joblib starts it later
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(parent: int) -> None:
    """What a process does before its first task."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    end_with(parent)


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
