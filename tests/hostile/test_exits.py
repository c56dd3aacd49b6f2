"""How the command line and the processes that it starts come to their end."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.tiers import few

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and /dev")
HOUSE = Path(__file__).parents[2]
FULL = pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full")
HEARD = "import os, signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
MAIN = HEARD + "from workbench.cli import main\nmain()\n"


def program(
    code: str, *arguments: str, cwd: Path = HOUSE, out: int = subprocess.PIPE
) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-u", "-c", code, *arguments],
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        stdout=out,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(HOUSE), "COLUMNS": "200"},
    )


def ended(process: "subprocess.Popen[str]") -> tuple[int, str, str]:
    out, err = process.communicate(timeout=240)
    return process.returncode, out or "", err


# An output that cannot be written.


@FULL
@pytest.mark.parametrize("arguments", few([("--version",), ("solvers",), ("run", "--list")], 1))
def test_full_output_is_a_sentence(arguments: tuple[str, ...]) -> None:
    with open("/dev/full", "w") as full:
        code, _, err = ended(program(MAIN, *arguments, out=full.fileno()))
    assert (code, err) == (2, "cannot write to the standard output: No space left on device\n")


def test_output_that_nobody_reads_is_no_error() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    code, _, err = ended(program(MAIN, "--help", out=writing))
    os.close(writing)
    assert (code, err) == (1, "")


# Signals, from the first line of ours to the last of Python's.

WHEN = {
    "while the first modules are read": """
class Early:
    def find_spec(self, name, path=None, target=None):
        if name == "typer": send()
sys.meta_path.insert(0, Early())
from workbench.cli import main
main()
""",
    "while threads are waited for": """
import workbench.cli.app as module, threading, time
def late():
    threading.main_thread().join()  # it waits, too
    send()
module.app = lambda: threading.Thread(target=late).start()
from workbench.cli import main
main()
""",
}
SENDS = """
import threading
def send():
    for _ in range({times}): os.kill(os.getpid(), {number})
"""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("when", few(WHEN, 1))
def test_signals_end_with_their_code(when: str, number: signal.Signals, code: int) -> None:
    sends = SENDS.format(times=2, number=int(number))
    found, _, err = ended(program(HEARD + sends + WHEN[when], "--version"))
    assert "Traceback" not in err
    assert "Exception ignored" not in err
    assert found == code, err


# Processes that outlive the one that started them.


def alive(process: int) -> bool:
    """Running, and not only a number that nobody has asked for."""
    try:
        os.kill(process, 0)
        told = Path(f"/proc/{process}/stat")
        return not told.exists() or told.read_text().rpartition(")")[2].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def gone(processes: list[int], seconds: float = 10.0) -> bool:
    until = time.monotonic() + seconds
    while any(alive(process) for process in processes):
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True


def lines_of(path: Path, count: int, process: "subprocess.Popen[str]") -> list[int]:
    """Numbers of processes, once so many are told."""
    until = time.monotonic() + 240
    while time.monotonic() < until:
        assert process.poll() is None, process.stderr.read() if process.stderr else ""
        lines = path.read_text().split("\n")[:-1] if path.exists() else []
        if len(lines) >= count:
            return [int(line) for line in lines]
        time.sleep(0.05)
    raise AssertionError("they did not begin")


def killed(process: "subprocess.Popen[str]") -> None:
    process.kill()
    process.wait()
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()


PARENT = """
import os, subprocess, sys, time
from workbench import processes
child = subprocess.Popen(
    [sys.executable, "-c", "from workbench import processes; import os, time; "
     "processes.{begin}; print(os.getpid(), flush=True); time.sleep(300)"],
    env=os.environ | {{processes.PARENT_VARIABLE: str(os.getpid())}},
)
child.wait()
"""


@pytest.mark.thorough
@pytest.mark.parametrize("begin", ["end_with_parent()", "end_with(os.getppid())"])
def test_child_ends_with_its_parent(begin: str, tmp_path: Path) -> None:
    told = tmp_path / "told"
    with told.open("w") as file:
        process = program(PARENT.format(begin=begin), out=file.fileno())
    child = lines_of(told, 1, process)
    killed(process)
    assert gone(child)
