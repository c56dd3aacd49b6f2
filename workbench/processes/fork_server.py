"""A process that has everything imported already, and forks whenever it is asked to.

Importing the workbench takes a second or two, and a process that is killed has to be replaced;
forking takes milliseconds. The server has one thread and runs no code of a user's, so that forking
it is safe.
"""

import os
import pickle
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from workbench.browser import in_browser
from workbench.errors import WorkbenchError
from workbench.processes import orphans
from workbench.processes.channel import Channel

FORKING = hasattr(os, "fork") and hasattr(socket, "send_fds")
NUMBER = struct.Struct("!q")
FORK, WAIT = b"f", b"w"


class NoProcesses(WorkbenchError):
    """A process cannot be started, because this one runs in a browser."""


class ForkServer:
    """The server as its owner sees it. Raises OSError if the server is gone."""

    def __init__(self, arguments: Sequence[str], environment: Mapping[str, str]) -> None:
        self._lock = threading.Lock()
        self._process = Started(arguments, environment)
        self._control = self._process.connection

    def new(self) -> "Forked":
        """Fork a process, with the module paths and the folder that this process has now."""
        connection, theirs = socket.socketpair()
        with theirs, self._lock:
            socket.send_fds(self._control, [FORK], [theirs.fileno()])
            pid = self._number()
        Channel(connection).send(pickle.dumps((absolute_paths(), os.getcwd())))
        return Forked(self, pid, connection)

    def wait(self, pid: int) -> int:
        """Wait for a forked process that is dead or dying, and return its exit code."""
        try:
            with self._lock:
                self._control.sendall(WAIT + NUMBER.pack(pid))
                return self._number()
        except OSError:
            return -signal.SIGKILL

    def close(self) -> None:
        """End the server; it kills the processes that are left."""
        self._control.close()
        if self._process.wait(5) is None:
            self._process.end()

    def _number(self) -> int:
        data = self._control.recv(NUMBER.size, socket.MSG_WAITALL)
        if len(data) < NUMBER.size:
            raise ConnectionError("the process that forks workers is gone")
        return int(NUMBER.unpack(data)[0])


class Forked:
    """A process that a fork server has forked; see Started."""

    def __init__(self, server: ForkServer, pid: int, connection: socket.socket) -> None:
        self._server, self.pid, self.connection = server, pid, connection
        self._code: int | None = None

    def end(self) -> int:
        """See Started.end."""
        if self._code is None:
            kill(self.pid)  # if it has died, the server has not reaped it: nobody has its number
            self._code = self._server.wait(self.pid)
        return self._code


def serve_forks(handle: int, work: Callable[[Channel], None]) -> None:
    """Inside the server: fork a process that does the `work` whenever asked to, until the end of
    input.

    The input also ends when the owner has died. Then every remaining forked process is killed,
    because nobody waits for its answer.
    """
    children: set[int] = set()
    with socket.socket(fileno=handle) as asked:
        try:
            while True:
                what, handles, _, _ = socket.recv_fds(asked, 1, 1)
                if what == FORK:
                    pid = os.fork()
                    if pid == 0:
                        asked.close()
                        _child(handles[0], work)
                    children.add(pid)
                    os.close(handles[0])
                    asked.sendall(NUMBER.pack(pid))
                elif what == WAIT:
                    pid, status = os.waitpid(NUMBER.unpack(asked.recv(NUMBER.size))[0], 0)
                    children.discard(pid)
                    asked.sendall(NUMBER.pack(os.waitstatus_to_exitcode(status)))
                else:
                    return
        finally:
            for pid in children:
                kill(pid)


def kill(pid: int) -> None:
    """Kill a forked process and its group.

    A process that was forked a moment ago may not lead its group yet, so that both are killed.
    """
    kill_group(pid)
    with suppress(OSError):
        os.kill(pid, signal.SIGKILL)


def absolute_paths() -> list[str]:
    """Where this process finds modules, for a process that may run in another folder."""
    return [path or os.getcwd() for path in sys.path]


def _child(handle: int, work: Callable[[Channel], None]) -> NoReturn:
    """The forked process; it leaves without the clean-up that belongs to the server."""
    try:
        with suppress(Exception):
            os.setsid()
            channel = Channel.inherited(handle)
            sys.path[:], folder = pickle.loads(channel.receive() or b"")
            os.chdir(folder)
            work(channel)
    finally:
        os._exit(0)


class Started:
    """A Python process in a process group of its own, which reads and prints nothing.

    The last of its arguments is the handle of a socket; `connection` is the other end. The process
    ends by itself after this one if it calls `orphans.end_with_parent`. `environment` is added to
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
                    **orphans.environment(),
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
    known = {one.value: one.name for one in signal.Signals}
    return known.get(-code, f"signal {-code}")
