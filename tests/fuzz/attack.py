"""Files that are wrong, given to their readers one after the other in a process of its own.

    python -m tests.fuzz.attack FORMAT SEED FIRST LAST FOLDER

prints a line of JSON when a case begins and when it has ended. `attacked` starts such a process,
starts another one where the first was killed, and collects what was seen.
"""

import json
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from types import FrameType
from typing import IO, TYPE_CHECKING

import numpy as np

from tests.hardening.within_limits import forget_peak, memory

if TYPE_CHECKING:
    from tests.fuzz.formats import Format

READ, REFUSED, FAILED = "read", "refused", "failed"
KILLED = 90  # s before its process is killed
LONGEST_MESSAGE = 3000  # characters; a table of ten bad files has about two thousand
AT_MOST = 6 * 2**30  # bytes of address space, so that a bomb does not take the machine along


@dataclass(frozen=True)
class Failure:
    """A case that did not end as it must."""

    format: str
    seed: int
    number: int
    file: str
    what: str
    content: bytes


@dataclass
class Counts:
    """What came of the cases of one format."""

    read: int = 0
    refused: int = 0
    failures: list[Failure] = field(default_factory=list)

    @property
    def tried(self) -> int:
        """All of them."""
        return self.read + self.refused + len(self.failures)

    def reasons(self) -> Counter[str]:
        """Failures by their kind."""
        return Counter(failure.what.split("\n")[0][:160] for failure in self.failures)


def attacked(name: str, seed: int, cases: int, folder: Path) -> Counts:
    """So many cases of one format; `folder` is for the files."""
    counts, first = Counts(), 0
    while first < cases:
        for number, file, outcome, what in _seen(name, seed, first, cases, folder):
            first = number + 1
            if outcome == READ:
                counts.read += 1
            elif outcome == REFUSED:
                counts.refused += 1
            else:
                path = folder / "failed" / str(number)
                path = path if path.is_file() else folder / "changed" / file  # it was killed
                content = path.read_bytes()
                counts.failures.append(Failure(name, seed, number, file, what, content))
    return counts


def _seen(
    name: str, seed: int, first: int, last: int, folder: Path
) -> Iterator[tuple[int, str, str, str]]:
    """Case by case until the process ends; one that is not finished by then is a failure."""
    command = [sys.executable, "-m", __name__, name, str(seed), str(first), str(last), str(folder)]
    with (
        (folder / "stderr").open("w+") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as child,
    ):
        assert child.stdout is not None
        lines: Queue[str] = Queue()
        Thread(target=_passed_on, args=(child.stdout, lines), daemon=True).start()
        begun: tuple[int, str] | None = None
        ended = "died"
        while True:
            try:
                line = lines.get(timeout=KILLED)
            except Empty:
                child.kill()
                ended = f"did not end within {KILLED} s, and did not listen to an interrupt"
                break
            if not line:
                break
            said = json.loads(line)
            if "outcome" in said:
                yield said["number"], said["file"], said["outcome"], said["what"]
                begun = None
            else:
                begun = said["number"], said["file"]
        code = child.wait()
        if begun is not None:
            why = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            yield *begun, FAILED, f"the process {ended}: {why}"
        elif code != 0:
            errors.seek(0)
            raise RuntimeError(f"the attack on {name} itself failed:\n{errors.read()}")


def _passed_on(stream: IO[str], lines: Queue[str]) -> None:
    for line in stream:
        lines.put(line)
    lines.put("")


# ---- in the process of its own ------------------------------------------------------------------


class TooLong(BaseException):
    """The time of a case is over."""


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise TooLong


def _format(name: str) -> "Format":
    from tests.fuzz.broken_readers import BROKEN
    from tests.fuzz.formats import FORMATS

    return FORMATS[name] if name in FORMATS else BROKEN[name][0]


def _drawn(seed: int, number: int, whole: Path, changed: Path) -> str:
    """One file of a copy is another; its name."""
    from tests.fuzz.mutations import mutated

    rng = np.random.default_rng((seed, number))
    shutil.rmtree(changed, ignore_errors=True)
    shutil.copytree(whole, changed)
    names = sorted(p.relative_to(whole).as_posix() for p in whole.rglob("*") if p.is_file())
    name = names[rng.integers(len(names))]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        (changed / name).write_bytes(mutated(name, (whole / name).read_bytes(), rng))
    return name


def judged(name: str, folder: Path) -> tuple[str, str]:
    """What became of reading a folder of files: an outcome, and what was wrong if it failed."""
    from tests.fuzz.formats import sound
    from workbench.errors import WorkbenchError

    format, what = _format(name), ""
    forget_peak()
    before = memory("VmRSS")
    there = {p.relative_to(folder) for p in folder.rglob("*")}
    signal.signal(signal.SIGALRM, _interrupt)
    signal.alarm(format.patience)
    start = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sound(format.read(folder))
        outcome = READ
    except WorkbenchError as error:
        outcome, message = REFUSED, str(error)
        if len(message) > LONGEST_MESSAGE:
            what = f"a message of {len(message)} characters"
    except TooLong:
        what = f"not ended after {format.patience} s\n{traceback.format_exc()}"
    except AssertionError as error:
        what = f"accepted: {error}\n{traceback.format_exc()}"
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}, {last.name}"
        what = f"{type(error).__name__} in {where}\n{traceback.format_exc()}"
    finally:
        signal.alarm(0)
    seconds = time.process_time() - start
    if not what and seconds > format.seconds:
        what = f"slow\n{seconds:.1f} s"
    taken = (memory("VmHWM") - before) / 1024
    if not what and taken > format.megabytes:
        what = f"memory\n{taken:.0f} MB"
    if not what and {p.relative_to(folder) for p in folder.rglob("*")} != there:
        what = "files were left or taken away"
    return (FAILED, what) if what else (outcome, "")


def main() -> None:
    """See above."""
    name, seed, first, last, folder = sys.argv[1:]
    whole, changed = Path(folder) / "whole", Path(folder) / "changed"
    shutil.rmtree(whole, ignore_errors=True)
    whole.mkdir(parents=True)
    _format(name).make(whole)
    outcome, what = judged(name, whole)
    if outcome != READ:
        raise RuntimeError(f"the valid {name} is not read: {what}")
    resource.setrlimit(resource.RLIMIT_AS, (AT_MOST, AT_MOST))
    for number in range(int(first), int(last)):
        file = _drawn(int(seed), number, whole, changed)
        print(json.dumps({"number": number, "file": file}), flush=True)
        outcome, what = judged(name, changed)
        if outcome == FAILED:
            (Path(folder) / "failed").mkdir(exist_ok=True)
            shutil.copyfile(changed / file, Path(folder) / "failed" / str(number))
        said = {"number": number, "file": file, "outcome": outcome, "what": what}
        print(json.dumps(said), flush=True)


if __name__ == "__main__":
    main()
