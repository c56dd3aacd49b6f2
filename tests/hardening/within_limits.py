"""Readers tried on hostile files in a process of their own, under a limit of time and of memory.

One process reads many files, since starting Python and loading the workbench takes longer than any
of them should. It is replaced when a file has killed it or has taken too long.
"""

import json
import resource
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

LONGEST = 600  # characters of a message, beside the file's path
PATIENCE = 60.0  # s by the clock until a process is killed, which may share its core with others
READY = "ready\n"


@dataclass(frozen=True)
class Answer:
    """What became of one file."""

    kind: str  # the name of the exception, or "read"
    message: str  # what it says; of a long one the beginning
    length: int  # of the whole message
    ours: bool  # a WorkbenchError
    seconds: float  # of its own work, however busy the machine is
    megabytes: float  # by which the process grew at most


class Reader:
    """A process that reads files with `module:function`, with `megabytes` to spare."""

    def __init__(self, function: str, seconds: float, megabytes: int) -> None:
        self.function, self.seconds, self.megabytes = function, seconds, megabytes
        self.process: subprocess.Popen[str] | None = None

    def read(self, path: Path) -> Answer:
        """What became of the file. Fails if the process took too long or died of it."""
        process = self.process = self.process or self._started()
        assert process.stdin is not None
        process.stdin.write(json.dumps(str(path)) + "\n")
        process.stdin.flush()
        line = _line(process, PATIENCE)
        if not line:
            self.close()
            raise AssertionError(f"{path.name} killed its reader or took over {self.seconds} s")
        return Answer(**json.loads(line))

    def refusal(self, path: Path) -> str:
        """The sentence with which the file is refused, within all limits."""
        answer = self.within_limits(path)
        assert answer.kind != "read", f"{path.name} was accepted"
        return answer.message

    def within_limits(self, path: Path) -> Answer:
        """What became of the file, which has to be read or refused in a sentence of ours."""
        answer = self.read(path)
        assert answer.ours or answer.kind == "read", f"{answer.kind}: {answer.message}"
        assert answer.seconds <= self.seconds
        assert answer.megabytes <= self.megabytes
        assert answer.length <= LONGEST + len(str(path)), answer.message
        assert answer.message.isprintable()
        return answer

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
            self.process = None

    def _started(self) -> subprocess.Popen[str]:
        command = [sys.executable, __file__, self.function, str(self.megabytes)]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
        )
        assert _line(process, 5 * PATIENCE) == READY
        return process


def _line(process: subprocess.Popen[str], seconds: float) -> str:
    """What the process says next; nothing if it has to be killed first."""
    assert process.stdout is not None
    timer = threading.Timer(seconds, process.kill)
    timer.start()
    try:
        return process.stdout.readline()
    finally:
        timer.cancel()


def reader(function: str, seconds: float, megabytes: int) -> Iterator[Reader]:
    """A reader for the fixture of a module."""
    one = Reader(function, seconds, megabytes)
    yield one
    one.close()


def _answer(read: Callable[[Any], object], path: str) -> Answer:
    from workbench.errors import WorkbenchError

    forget_peak()
    before, start, error = memory("VmRSS"), time.process_time(), None
    try:
        read(path)
    except Exception as raised:
        error = raised
    seconds, grown = time.process_time() - start, memory("VmHWM") - before
    said = "" if error is None else str(error)
    kind = "read" if error is None else type(error).__name__
    return Answer(
        kind, said[:2000], len(said), isinstance(error, WorkbenchError), seconds, grown / 1024
    )


def forget_peak() -> None:
    """Let the most memory that this process held, VmHWM, be what it holds now."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def memory(key: str) -> int:
    """kB of this process, as Linux counts them, by its key: VmRSS is what it holds; 0 elsewhere."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((int(line.split()[1]) for line in lines if line.startswith(f"{key}:")), 0)


def _serve(function: str, megabytes: int) -> None:
    module, name = function.split(":")
    read = getattr(__import__(module, fromlist=[name]), name)
    if taken := memory("VmSize"):
        most = (taken + 2 * 1024 * megabytes) * 1024  # memory that is set aside and never touched
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    print(READY, end="", flush=True)
    for line in sys.stdin:
        print(json.dumps(vars(_answer(read, json.loads(line)))), flush=True)


if __name__ == "__main__":
    import warnings

    warnings.simplefilter("error")
    _serve(sys.argv[1], int(sys.argv[2]))
