"""A Python process with a socket to it, which can be killed with all that it has started."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from workbench.processes import orphans


class Started:
    """A Python process in a process group of its own, which reads and prints nothing.

    The last of its arguments is the handle of a socket; `connection` is the other end. The process
    ends by itself after this one if it calls `orphans.end_with_parent`.

    Attributes:
        pid: the number of the process.
        connection: this process's end of the socket.
    """

    def __init__(
        self, arguments: Sequence[str], environment: Mapping[str, str], folder: Path | None = None
    ) -> None:
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
                env={**os.environ, **environment, **orphans.environment()},
                start_new_session=True,
                close_fds=posix,
                pass_fds=(theirs.fileno(),) if posix else (),
            )
        self.pid = self._popen.pid

    def wait(self, seconds: float) -> int | None:
        """Wait for the exit code, minus the number of a signal; None if the process still runs."""
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
