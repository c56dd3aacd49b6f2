"""What all measurements share: turns, threads, the machine, kept numbers and Markdown tables."""

import gc
import importlib
import json
import os
import platform
import re
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np

from workbench.environment import DISTRIBUTION, version_of

HERE = Path(__file__).parent
RESULTS = HERE / "results"
DIGITS = 5  # of numbers that are kept
ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMEXPR_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}
TURN = 0.03  # s: a quick candidate is called a few times in its turn, a slow one once
AT_MOST = 5  # timed calls in a turn
PACKAGES = (DISTRIBUTION, "casadi", "numpy", "scipy")

Timing = dict[str, float]  # seconds of a call: "least" and "median"


class MissingData(Exception):
    """A measurement needs data that are not here; the message says which, and where they are."""


# Turns and threads


def one_thread() -> None:
    """Start this command again with one thread for every library, if it has more.

    Libraries read these variables when they are imported, so it has to happen before.
    """
    if any(os.environ.get(name) != value for name, value in ONE_THREAD.items()):
        command = [sys.executable, "-m", "benchmarks", *sys.argv[1:]]
        os.execve(sys.executable, command, {**os.environ, **ONE_THREAD})


@contextmanager
def on_one_core() -> Iterator[None]:
    """This process on its last core, so that it does not wander; nothing but on Linux."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def side_by_side(
    candidates: Mapping[str, Callable[[Any], object]],
    inputs: Sequence[Any],
    rounds: int,
    parts: int = 1,
) -> dict[str, Timing]:
    """Seconds of each candidate, which take turns, on changing inputs.

    Each candidate gets all inputs in turn, again and again; the workbench remembers the points of
    the last two, so that three are enough. A turn begins with a call that is not timed, because
    the others have filled the cache. A call that does `parts` equal things is divided by them.
    """
    taken: dict[str, list[float]] = {name: [] for name in candidates}
    following = {name: cycle(inputs) for name in candidates}
    calls = {}
    for name, run in candidates.items():  # the first calls compile
        took = [_seconds(run, one) for one in islice(following[name], 3)]
        calls[name] = int(np.clip(TURN / took[-1], 1, AT_MOST))
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, run in candidates.items():
                run(next(following[name]))
                taken[name] += [_seconds(run, next(following[name])) for _ in range(calls[name])]
    finally:
        gc.enable()
    return {name: timing(np.array(seconds) / parts) for name, seconds in taken.items()}


def timing(seconds: Any) -> Timing:
    """The least of some seconds, which other processes disturbed least, and the middle."""
    return {"least": float(np.min(seconds)), "median": float(np.median(seconds))}


def _seconds(run: Callable[[Any], object], argument: Any) -> float:
    began = time.perf_counter()
    run(argument)
    return time.perf_counter() - began


def peak() -> int:
    """The most memory of this process so far, in bytes."""
    facts = Path("/proc/self/status")  # Linux's getrusage would include the parent's
    if facts.exists():
        (line,) = (one for one in facts.read_text().splitlines() if one.startswith("VmHWM"))
        return 1024 * int(line.split()[1])
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def in_a_process_of_its_own(function: Callable[..., Any], *arguments: Any) -> Any:
    """What a function of a module returns, as JSON, from a process that does nothing else."""
    asked = json.dumps([function.__module__, function.__name__, arguments])
    command = [sys.executable, "-c", "from benchmarks.measuring import _answer; _answer()", asked]
    done = subprocess.run(command, cwd=HERE.parent, check=True, capture_output=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def _answer() -> None:
    module, name, arguments = json.loads(sys.argv[1])
    print(json.dumps(getattr(importlib.import_module(module), name)(*arguments)))


# The machine


def description(packages: Sequence[str] = ()) -> dict[str, Any]:
    """Processor, cores, system, versions, commit, date and load; `packages` beside the usual."""
    affinity = getattr(os, "sched_getaffinity", lambda _: set(range(os.cpu_count() or 1)))(0)
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "cores used": len(affinity),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {n: v for n in (*PACKAGES, *packages) if (v := version_of(n)) is not None},
        "commit": commit(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "load": list(os.getloadavg()) if hasattr(os, "getloadavg") else [],
    }


def measured_on(facts: Mapping[str, Any]) -> str:
    """A sentence: `Measured on 1 of 2 cores of ..., with casadi 3.8.2, ..., on 2026-01-31.`"""
    versions = ", ".join(f"{name} {v}" for name, v in facts["versions"].items() if v)
    of_commit = f" (commit {facts['commit']})" if facts.get("commit") else ""
    return (
        f"Measured on {facts['cores used']} of {facts['cores']} cores of {facts['processor']} "
        f"({facts['system']}), Python {facts['python']}, {versions}, "
        f"on {facts['date'].partition('T')[0]}{of_commit}."
    )


def commit() -> str:
    """The short hash of the commit that is checked out, with `+` if files differ from it."""

    def git(*words: str) -> str:
        command = ["git", *words]
        return subprocess.run(
            command, cwd=HERE, capture_output=True, text=True, check=False
        ).stdout.strip()

    return git("rev-parse", "--short", "HEAD") + "+" * bool(git("status", "-s", "-uno"))


def _processor() -> str:
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text().splitlines() if facts.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


# Kept numbers


def keep(
    name: str,
    found: Mapping[str, Any],
    folder: Path = RESULTS,
    packages: Sequence[str] = (),
    digits: int = DIGITS,
) -> None:
    """`name.json` in a folder: what was found, on what machine, at which commit and when."""
    write_json(folder / f"{name}.json", {"machine": description(packages), "found": found}, digits)


def kept(name: str, folder: Path = RESULTS) -> dict[str, Any] | None:
    """What `keep` wrote, with the keys `machine` and `found`; None if there is no such file."""
    file = folder / f"{name}.json"
    data: dict[str, Any] | None = json.loads(file.read_text("utf-8")) if file.exists() else None
    return data


def beside_kept(name: str, found: Mapping[str, Any], folder: Path = RESULTS) -> dict[str, Any]:
    """Parts that were measured now, and those that were kept before, which get a `machine`."""
    before = kept(name, folder)
    if before is None:
        return dict(found)
    old = {k: {"machine": before["machine"]} | v for k, v in before["found"].items()}
    return old | dict(found)


def write_json(file: Path, data: Any, digits: int) -> None:
    """Numbers to so many digits, and what holds nothing but numbers and texts on one line."""
    rounded = json.loads(
        json.dumps(data), parse_float=lambda said: float(f"{float(said):.{digits}g}")
    )
    text = json.dumps(rounded, indent=1, ensure_ascii=False)
    text = re.sub(r"\[[^][{}]*\]|{[^][{}]*}", lambda match: " ".join(match[0].split()), text)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text + "\n", encoding="utf-8")


# Markdown


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table whose first column stands to the left and whose others stand to the right."""
    lines = [head, ["---", *["--:"] * (len(head) - 1)], *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines) + "\n"


def milliseconds(one: Timing) -> str:
    """Least / median."""
    return f"{digits(1e3 * one['least'])} / {digits(1e3 * one['median'])}"


def ratio(timings: Mapping[str, Timing], candidate: str, to: str) -> float:
    """How often the least time of another."""
    return timings[candidate]["least"] / timings[to]["least"]


def digits(number: float) -> str:
    """Three digits."""
    return f"{number:,.0f}" if number >= 100 else f"{number:.3g}"


def write_between(file: Path, name: str, text: str) -> None:
    """Put text between the marks `<!-- name -->` and `<!-- end of name -->` of a file.

    Raises ValueError if the file has not both.
    """
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    before, begun, rest = file.read_text(encoding="utf-8").partition(begin)
    _, ended, after = rest.partition(end)
    if not (begun and ended):
        raise ValueError(f"{file} has no place for {name}: write {begin} and {end} into it")
    file.write_text(f"{before}{begin}\n{text.strip()}\n{end}{after}", encoding="utf-8")
