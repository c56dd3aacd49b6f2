"""Processes that can be killed wherever they are, and the messages exchanged with them.

loky cannot end one worker that takes too long. pebble can, but it leaves the processes running that
the worker has started, cannot be used in a daemonic process, as the workers of Dask are, and
unpickles whatever the worker sends, which is not safe where a student's file runs there.
"""

import ctypes
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from workbench.environment import in_browser
from workbench.errors import WorkbenchError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

Result = TypeVar("Result")
FORKING = hasattr(os, "fork")
PARENT_VARIABLE = "WORKBENCH_PARENT"  # in the environment of a process: who started it
WATCH_INTERVAL = 0.5  # s between two looks at the parent
PR_SET_PDEATHSIG = 1  # of Linux's prctl: the signal that a process gets when its parent has died
LENGTH_FORMAT = struct.Struct("!Q")
PIECE_BYTES = 2**16  # bytes that are read at a time


class NoProcesses(WorkbenchError):
    """A process cannot be started, because this one runs in a browser."""


class ProcessDied(WorkbenchError):
    """A process ended before it had returned a result."""


class TooLong(Exception):
    """A message is longer than the receiver accepts."""


class Channel:
    """One end of a connection that sends and receives whole messages."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection

    @classmethod
    def inherited(cls, handle: int) -> Self:
        """The end that this process was given at its start; its own children do not get it."""
        connection = socket.socket(fileno=handle)
        connection.set_inheritable(False)
        return cls(connection)

    def send(self, message: bytes, seconds: float | None = None) -> None:
        """Send a message. Raises OSError, and TimeoutError if nobody reads it in time."""
        self._connection.settimeout(seconds)
        self._connection.sendall(LENGTH_FORMAT.pack(len(message)) + message)

    def receive(self, seconds: float | None = None, longest: int | None = None) -> bytes | None:
        """Wait for the next message; None if the process at the other end has gone.

        Raises TimeoutError if the whole message has not arrived in time, and TooLong if it has more
        than `longest` bytes.
        """
        until = None if seconds is None else time.monotonic() + seconds
        header = self._read(LENGTH_FORMAT.size, until)
        if header is None:
            return None
        (length,) = LENGTH_FORMAT.unpack(header)
        if longest is not None and length > longest:
            raise TooLong(f"a message of {length:,} bytes; at most {longest:,} are accepted")
        return self._read(length, until)

    def close(self) -> None:
        """Close this end; the process at the other end is told that nothing more will come."""
        self._connection.close()

    def _read(self, count: int, until: float | None) -> bytes | None:
        got = bytearray()
        while len(got) < count:
            self._connection.settimeout(
                None if until is None else max(until - time.monotonic(), 1e-3)
            )
            try:
                more = self._connection.recv(min(count - len(got), PIECE_BYTES))
            except ConnectionError:  # the other process died before it had read everything
                return None
            if not more:
                return None
            got += more
        return bytes(got)


class Started:
    """A Python process in a process group of its own, which reads and prints nothing.

    The last of its arguments is the handle of a socket; `connection` is the other end. The process
    ends by itself after this one if it calls `end_with_parent`. `environment` is added to
    the variables of this process, or to `inherited` instead. Raises NoProcesses in a browser.

    Attributes:
        pid: the number of the process.
        connection: this process's end of the socket.
    """

    def __init__(
        self,
        arguments: Sequence[str],
        environment: Mapping[str, str],
        folder: Path | None = None,
        inherited: Mapping[str, str] | None = None,
    ) -> None:
        if in_browser():
            raise NoProcesses(
                "this needs a process of its own, and none can be started in a browser; use an "
                "installation of Python"
            )
        self.connection, theirs = socket.socketpair()
        posix = os.name == "posix"
        with theirs:
            theirs.set_inheritable(True)  # for Windows, which does not know `pass_fds`
            self._popen = subprocess.Popen(
                [sys.executable, *arguments, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                cwd=folder,
                env={
                    **(os.environ if inherited is None else inherited),
                    **environment,
                    PARENT_VARIABLE: str(os.getpid()),
                },
                start_new_session=True,
                close_fds=posix,
                pass_fds=(theirs.fileno(),) if posix else (),
            )
        self.pid = self._popen.pid

    def wait(self, seconds: float) -> int | None:
        """Wait for the exit code, negative if a signal ended it; None if the process still runs."""
        with suppress(subprocess.TimeoutExpired):
            return self._popen.wait(timeout=seconds)
        return None

    def end(self) -> int:
        """Kill the process and all that it started, and return its exit code."""
        kill_group(self.pid)
        self._popen.kill()  # on Windows, where there are no groups
        return self._popen.wait()


def kill_group(pid: int) -> None:
    """Kill the process group that a process leads, even if this process has already ended."""
    with suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(pid, signal.SIGKILL)


def signal_name(code: int) -> str:
    """Name the signal that ended a process with a negative exit code: `SIGKILL`, `signal 37`."""
    names = {number.value: number.name for number in signal.Signals}
    return names.get(-code, f"signal {-code}")


def absolute_paths() -> list[str]:
    """Where this process finds modules, for a process that may run in another folder."""
    return [path or os.getcwd() for path in sys.path]


def end_with_parent() -> None:
    """End this process when the one that made its environment is gone.

    On Linux the system does this, even if code in C never lets another thread run. The system takes
    the thread that started the process for its parent, so that thread has to live longer than the
    process.
    """
    parent = os.environ.pop(PARENT_VARIABLE, "")
    if not parent.isdecimal():
        return
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    end_with(int(parent))


def end_with(parent: int) -> None:
    """End this process when its parent, which has this number, is gone. A thread watches it."""
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:  # an orphan is given to another process, but not on Windows
        time.sleep(WATCH_INTERVAL)
    os._exit(1)


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

    context, waiting = get_context("fork"), list(range(jobs))[::-1]
    job_of, processes = dict[connection.Connection, int](), []
    try:
        for _ in range(min(workers, jobs)):
            ours, theirs = context.Pipe()
            process = context.Process(
                target=_serve, args=(work, theirs, ours, os.getpid()), daemon=True
            )
            process.start()
            theirs.close()
            processes.append(process)
            job_of[ours] = waiting.pop()
            ours.send(job_of[ours])
        while job_of:
            for ready in connection.wait(list(job_of)):
                assert isinstance(ready, connection.Connection)
                k = job_of.pop(ready)
                try:
                    failed, answer = ready.recv()
                except (EOFError, ConnectionError) as error:
                    raise ProcessDied(f"the process that did job {k} has died") from error
                if failed:
                    raise answer
                if waiting:
                    job_of[ready] = waiting.pop()
                    ready.send(job_of[ready])
                yield k, answer
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
