"""Processes to work in: forked from one that has everything imported already, or started plainly.

Importing the workbench takes a second or two, and a process that is killed has to be replaced. So,
where the system can fork, one process imports it once and forks whenever it is asked to: that takes
milliseconds. It has one thread, and runs nothing of anybody's, so that forking it is safe. These
are plain subprocesses: daemonic processes, such as those of Dask's nannies and of joblib, may not
have children by `multiprocessing`.
"""

import os
import pickle
import signal
import socket
import struct
import subprocess
import sys
import threading
from contextlib import suppress
from typing import BinaryIO, Protocol

from workbench import orphans
from workbench.threads import thread_count

FORKING = hasattr(os, "fork") and hasattr(socket, "send_fds")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
MODULE = "from workbench.comparison.worker import "
NUMBER = struct.Struct("!q")
FORK, WAIT = b"f", b"w"


class Process(Protocol):
    """A process with a channel to it."""

    reading: BinaryIO
    writing: BinaryIO

    def end(self) -> int:
        """Kill it with all that it started; the code that it ended with, minus a signal's number.
        If it had died before, that is how.
        """


class Plain:
    """Started from nothing."""

    def __init__(self) -> None:
        self._popen = subprocess.Popen(
            [sys.executable, "-c", MODULE + "plain; plain()"], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=_environment(),
            start_new_session=True,
        )  # fmt: skip
        assert self._popen.stdin is not None
        assert self._popen.stdout is not None
        self.reading: BinaryIO = self._popen.stdout  # type: ignore[assignment]  # bytes it is
        self.writing: BinaryIO = self._popen.stdin  # type: ignore[assignment]

    def end(self) -> int:
        """See Process."""
        if self._popen.poll() is None:
            kill(self._popen.pid)
        return self._popen.wait()


class Forked:
    """A child of a nursery."""

    def __init__(self, nursery: "Nursery", pid: int, channel: socket.socket) -> None:
        self._nursery, self._pid, self._code = nursery, pid, 0
        self._alive, self._channel = True, channel
        self.reading: BinaryIO = channel.makefile("rb")
        self.writing: BinaryIO = channel.makefile("wb")

    def end(self) -> int:
        """See Process."""
        if self._alive:
            self._alive = False
            kill(self._pid)  # one that has died already is not reaped yet: nobody has its number
            self._code = self._nursery.wait(self._pid)
        return self._code

    def __del__(self) -> None:
        self._channel.close()


class Nursery:
    """A process that forks on request. Raises OSError if it is gone."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._control, theirs = socket.socketpair()
        with theirs:
            self._popen = subprocess.Popen(
                [sys.executable, "-c", f"{MODULE}nursery; nursery({theirs.fileno()})"],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                env=_environment(), start_new_session=True, pass_fds=(theirs.fileno(),),
            )  # fmt: skip

    def new(self) -> Forked:
        """A child, with the paths and the folder that this process has now."""
        ours, theirs = socket.socketpair()
        with theirs, self._lock:
            socket.send_fds(self._control, [FORK], [theirs.fileno()])
            pid = self._number()
        child = Forked(self, pid, ours)
        pickle.dump((_paths(), os.getcwd()), child.writing)
        child.writing.flush()
        return child

    def wait(self, pid: int) -> int:
        """The code that a child, which is dead or dying, ended with."""
        try:
            with self._lock:
                self._control.sendall(WAIT + NUMBER.pack(pid))
                return self._number()
        except OSError:
            return -signal.SIGKILL

    def close(self) -> None:
        """End it; children that are idle end with their channels."""
        self._control.close()
        with suppress(subprocess.TimeoutExpired):
            self._popen.wait(timeout=5)
            return
        self._popen.kill()
        self._popen.wait()

    def _number(self) -> int:
        data = b""
        while len(data) < NUMBER.size:
            more = self._control.recv(NUMBER.size - len(data))
            if not more:
                raise ConnectionError("the process that forks workers is gone")
            data += more
        return int(NUMBER.unpack(data)[0])


def kill(pid: int) -> None:
    """A process with all that it started; one that was forked a moment ago leads no group yet."""
    with suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(pid, signal.SIGKILL)
    with suppress(OSError):
        os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))  # Windows: TerminateProcess


def _paths() -> list[str]:
    return [path or os.getcwd() for path in sys.path]


def _environment() -> dict[str, str]:
    threads = dict.fromkeys(THREADS, str(thread_count()))
    paths = {"PYTHONPATH": os.pathsep.join(_paths())}
    return dict(os.environ) | threads | paths | orphans.environment()
