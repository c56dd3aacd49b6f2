"""How a training is carried out: jobs in this process or in several, progress, log entries."""

import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from joblib import Parallel, delayed

from workbench.errors import BadArgument, WorkbenchError
from workbench.processes import end_with
from workbench.threads import limited_threads

ROUNDING = 1e-9  # of the cost: what a block may add by rounding


class NotLowered(WorkbenchError):
    """A block of training raised the cost, or did not solve what it claims to solve."""


@dataclass(frozen=True)
class LogEntry:
    """One block that has run.

    Attributes:
        block: its name in `BLOCKS`.
        before: the costs by term when it began.
        after: the costs by term when it ended.
        facts: what the block says about itself, such as how many products it took.
        seconds: how long it took.
    """

    block: str
    before: dict[str, float]
    after: dict[str, float]
    facts: dict[str, float]
    seconds: float

    def check_lowered(self) -> None:
        """Raise NotLowered if the block raised the cost by more than rounding does."""
        was, total = sum(self.before.values()), sum(self.after.values())
        if not total <= was + ROUNDING * (1 + was):
            raise NotLowered(f"block {self.block!r} raised the cost from {was:.9g} to {total:.9g}")


@dataclass(frozen=True, eq=False)
class Progress:
    """How far a training is when a block has ended.

    Attributes:
        number: the number of this block, from 1.
        of: how many blocks the plan has.
        entry: what the block did.
        seconds_left: an estimate of the time until the last block ends.
    """

    number: int
    of: int
    entry: LogEntry
    seconds_left: float

    @staticmethod
    def since(began: float, already: int, number: int, of: int, entry: LogEntry) -> "Progress":
        """Where a run is that began after `already` blocks, `began` by `time.perf_counter`."""
        each = (time.perf_counter() - began) / (number - already)
        return Progress(number, of, entry, each * (of - number))


class Report:
    """Follows the progress of a training; this one shows nothing."""

    def block(self, progress: Progress) -> None:
        """Called when a block has ended."""

    def part(self, doing: str, done: int, of: int) -> None:
        """Called within something long, when `done` of `of` parts are finished."""


SILENT = Report()


Job = TypeVar("Job")
Result = TypeVar("Result")


# Runs independent jobs, as the built-in `map` does in this process; results come in their order.
Executor = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]


@dataclass(frozen=True)
class Processes:
    """An executor with `count` processes; only a few jobs are in memory at a time.

    Only this process hears Ctrl-C, and ends the others; if it is killed, they end by themselves.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise BadArgument(f"an executor has 1 process or more, not {self.count}")

    def __call__(self, work: Callable[[Job], Result], jobs: Iterable[Job], /) -> Iterator[Result]:
        """The result of each job; a single process is this one."""
        if self.count == 1:
            return map(work, jobs)
        parallel = Parallel(
            n_jobs=self.count,
            return_as="generator",
            initializer=_start_process,
            initargs=(os.getpid(),),
        )
        with _interrupts_blocked():
            return _parallel_results(parallel, work, jobs)


def by_backend(work: Callable[[Job], Result], jobs: Iterable[Job], /) -> Iterator[Result]:
    """An executor by what `joblib.parallel_config` has chosen, such as a Dask cluster: the result
    of each job.
    """
    return _parallel_results(Parallel(n_jobs=-1, return_as="generator"), work, jobs)


@dataclass(frozen=True)
class Execution:
    """How long work is carried out.

    Attributes:
        executor: runs the jobs.
        report: follows the progress.
        task: the name of the work in the report.
    """

    executor: Executor = map
    report: Report = SILENT
    task: str = ""

    def finished(self, done: int, of: int) -> None:
        """Report that `done` of `of` parts are finished."""
        self.report.part(self.task, done, of)


SERIAL = Execution()


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Processes that are started inside begin with Ctrl-C blocked.

    A terminal sends Ctrl-C to all processes at once, also to those that are still importing. In
    this process it waits until the block is over.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker  # which cannot be imported in a browser

    resource_tracker.ensure_running()  # which would unblock it, when joblib starts it later
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_process(parent: int) -> None:
    """Prepare a new process: it ignores Ctrl-C from here on, and ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    end_with(parent)


def _parallel_results(
    parallel: Parallel, work: Callable[[Job], Result], jobs: Iterable[Job]
) -> Iterator[Result]:
    limited = delayed(partial(_with_limited_threads, work))
    results: Iterator[Result] = parallel(limited(job) for job in jobs)
    return results


def _with_limited_threads(work: Callable[[Job], Result], job: Job) -> Result:
    with limited_threads():
        return work(job)
