"""Executors: independent jobs are run by this process or by several."""

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Protocol, TypeVar

from joblib import Parallel, delayed

from workbench.errors import BadArgument
from workbench.processes import end_with
from workbench.threads import limited_threads
from workbench.training.progress import SILENT, Report

Job = TypeVar("Job")
Result = TypeVar("Result")


class Executor(Protocol):
    """Runs independent jobs, as the built-in `map` does in this process.

    The results come in the order of the jobs, and are the same wherever the jobs ran.
    """

    def __call__(self, work: Callable[[Job], Result], jobs: Iterable[Job], /) -> Iterator[Result]:
        """The result of each job."""


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
            results: Iterator[Result] = parallel(
                delayed(partial(_limited, work))(job) for job in jobs
            )
        return results


def by_backend(work: Callable[[Job], Result], jobs: Iterable[Job], /) -> Iterator[Result]:
    """An executor by what `joblib.parallel_config` has chosen, such as a Dask cluster: the result
    of each job.
    """
    parallel = Parallel(n_jobs=-1, return_as="generator")
    results: Iterator[Result] = parallel(delayed(partial(_limited, work))(job) for job in jobs)
    return results


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


def _limited(work: Callable[[Job], Result], job: Job) -> Result:
    with limited_threads():
        return work(job)
