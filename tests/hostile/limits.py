"""Readers tried in a process of their own, under limits of time and of memory.

One process reads many files, as starting it takes longer than any of them should. It is replaced
when a file has killed it or has taken too long.

    python -m tests.hostile.limits

reads lines of JSON, [reader, path, seconds, megabytes], and answers each with an `Answer`.
"""

import json
import resource
import signal
import subprocess
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import astuple, dataclass
from importlib import import_module
from pathlib import Path
from types import FrameType

READ, REFUSED, FAILED = "read", "refused", "failed"
SECONDS, MEGABYTES = 20.0, 1000  # of CPU, ten times what is usual; and beyond what is held before
WALL = 120.0  # s by the clock until the process is killed, which may share its core with others
ADDRESSES = 4 * 2**30  # bytes that may be set aside, so that a bomb does not take the machine along
LONGEST_MESSAGE = 3000  # characters; a table of ten bad files has about two thousand


@dataclass(frozen=True)
class Answer:
    """What became of one file."""

    outcome: str
    what: str = ""  # the refusal, or what was wrong


class Reader:
    """A process that reads files, started when it is first asked."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[str] | None = None

    def ask(
        self,
        read: str,
        path: Path,
        seconds: float = SECONDS,
        megabytes: float = MEGABYTES,
        wall: float = WALL,
    ) -> Answer:
        """What becomes of a path that is read by a format, or by "module:function"."""
        process = self.process = self.process or self._started()
        assert process.stdin is not None
        process.stdin.write(json.dumps([read, str(path), seconds, megabytes]) + "\n")
        process.stdin.flush()
        line = _line(process, wall)
        if line:
            return Answer(*json.loads(line))
        code = process.wait(WALL)
        self.close()
        return Answer(
            FAILED, f"the process ended: {signal.Signals(-code).name if code < 0 else code}"
        )

    def refusal(self, read: str, path: Path, megabytes: float = MEGABYTES) -> str:
        """The sentence with which a path is refused: short and printable, whatever it holds."""
        answer = self.ask(read, path, megabytes=megabytes)
        assert answer.outcome == REFUSED, f"{answer.outcome}: {answer.what}"
        assert len(answer.what) <= 600 + len(str(path)), answer.what
        assert answer.what.isprintable(), answer.what
        return answer.what

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
            self.process = None

    def _started(self) -> "subprocess.Popen[str]":
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.hostile.limits"],
            cwd=Path(__file__).parents[2],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            encoding="utf-8",
        )
        assert _line(process, 3 * WALL) == "ready\n"
        return process


def _line(process: "subprocess.Popen[str]", seconds: float) -> str:
    """What the process says next; nothing if it died or has to be killed first."""
    assert process.stdout is not None
    timer = threading.Timer(seconds, process.kill)
    timer.start()
    try:
        return process.stdout.readline()
    finally:
        timer.cancel()


# ---- in the process of its own ------------------------------------------------------------------


class TooLong(BaseException):
    """The time of a file is over."""


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise TooLong


def judged(
    read: Callable[[Path], object],
    path: Path,
    seconds: float = SECONDS,
    megabytes: float = MEGABYTES,
) -> Answer:
    """What becomes of a path: it is read soundly, refused in a sentence of ours, or a failure."""
    from workbench.errors import WorkbenchError

    _forget_peak()
    before, there = _memory("VmRSS"), set(path.rglob("*"))
    signal.signal(signal.SIGPROF, _interrupt)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    began = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            read(path)
        answer = Answer(READ)
    except WorkbenchError as error:
        answer = Answer(REFUSED, str(error))
    except TooLong:
        answer = Answer(FAILED, f"not ended after {seconds:g} s\n{traceback.format_exc()}")
    except AssertionError as error:
        answer = Answer(FAILED, f"accepted: {error}\n{traceback.format_exc()}")
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}, {last.name}"
        answer = Answer(FAILED, f"{type(error).__name__} in {where}\n{traceback.format_exc()}")
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    if answer.outcome == FAILED:
        return answer
    if time.process_time() - began > seconds:
        return Answer(FAILED, "the signal for its end was swallowed")
    if (taken := (_memory("VmHWM") - before) / 1024) > megabytes:
        return Answer(FAILED, f"memory\n{taken:.0f} MB")
    if len(answer.what) > LONGEST_MESSAGE:
        return Answer(FAILED, f"a message of {len(answer.what)} characters")
    if set(path.rglob("*")) != there:
        return Answer(FAILED, "files were left or taken away")
    return answer


def _forget_peak() -> None:
    """Let the most memory that this process held, VmHWM, be what it holds now."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _memory(key: str) -> int:
    """kB of this process, as Linux counts them, by its key: VmRSS is what it holds; 0 elsewhere."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((int(line.split()[1]) for line in lines if line.startswith(f"{key}:")), 0)


def _reader(name: str) -> Callable[[Path], object]:
    from tests.hostile.formats import FORMATS

    if name in FORMATS:
        return FORMATS[name].check
    module, function = name.split(":")
    return getattr(import_module(module), function)  # type: ignore[no-any-return]


def main() -> None:
    """See above."""
    import tests.hostile.formats  # noqa: F401  (what is loaded now is no reader's memory)

    if taken := _memory("VmSize"):
        most = 1024 * taken + ADDRESSES
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    print("ready", flush=True)
    for line in sys.stdin:
        name, path, seconds, megabytes = json.loads(line)
        answer = judged(_reader(name), Path(path), seconds, megabytes)
        print(json.dumps(astuple(answer)), flush=True)


if __name__ == "__main__":
    main()
