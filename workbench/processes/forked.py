"""Work in copies of this process, which have all that it has, also what cannot be pickled."""

import os
import signal
from collections.abc import Callable, Generator
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar

from workbench.errors import WorkbenchError
from workbench.processes.orphans import end_with

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

Result = TypeVar("Result")
FORKING = hasattr(os, "fork")


class ProcessDied(WorkbenchError):
    """A process ended before it had returned a result."""


def forked(work: Callable[[int], Result], jobs: int, workers: int) -> Generator[tuple[int, Result]]:
    """The results of `work(0)` to `work(jobs - 1)` with their numbers, as they come.

    `workers` copies of this process do the work, so that `work` need not be pickled; its results
    are. With one worker, or where a system cannot copy processes, it is done here, in order. What
    `work` raises is raised here. Copies end when the iterator is closed. Raises ProcessDied.
    """
    if workers < 2 or jobs < 2 or not FORKING:
        for k in range(jobs):
            yield k, work(k)
        return
    from multiprocessing import connection, get_context  # which cannot be imported in a browser

    context, left = get_context("fork"), list(range(jobs))[::-1]
    at, processes = dict[connection.Connection, int](), []
    try:
        for _ in range(min(workers, jobs)):
            ours, theirs = context.Pipe()
            process = context.Process(
                target=_serve, args=(work, theirs, ours, os.getpid()), daemon=True
            )
            process.start()
            theirs.close()
            processes.append(process)
            at[ours] = left.pop()
            ours.send(at[ours])
        while at:
            for ready in connection.wait(list(at)):
                assert isinstance(ready, connection.Connection)
                k = at.pop(ready)
                try:
                    failed, found = ready.recv()
                except (EOFError, ConnectionError) as error:
                    raise ProcessDied(f"the process that did job {k} has died") from error
                if failed:
                    raise found
                if left:
                    at[ready] = left.pop()
                    ready.send(at[ready])
                yield k, found
    finally:
        for process in processes:
            process.kill()
            process.join()


def _serve(
    work: Callable[[int], Any], channel: "Connection", other: "Connection", parent: int
) -> None:
    """Do what is asked for until nobody asks any more; only the parent hears Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    other.close()
    end_with(parent)
    with suppress(EOFError, ConnectionError):
        while True:
            k = channel.recv()
            try:
                answer = False, work(k)
            except Exception as error:
                answer = True, error
            channel.send(answer)
