"""Cost and memory against the number of vertices."""

import json
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks import floor, ours
from benchmarks.bodies_made_up import case_of, random_body
from benchmarks.derivatives import KINDS
from benchmarks.timing import side_by_side

UP_TO_100_000 = (700, 1700, 6890, 20_000, 100_000)


def measure(sizes: tuple[int, ...], rounds: int) -> dict[str, Any]:
    """Seconds by kind, candidate and size, all taking turns; bytes by candidate and size."""
    memory: dict[str, Any] = {}
    candidates: dict[str, Any] = {}
    people: list[Any] = []
    for n_vertices in sizes:
        made = ours.cases(str(n_vertices), random_body(n_vertices))
        for way, case in made.items():
            memory.setdefault(way, {})[str(n_vertices)] = _asked(n_vertices, way)
            candidates[f"{way}/{n_vertices}"] = ours.candidate(way, case)
        candidates[f"{floor.FLOOR}/{n_vertices}"] = floor.candidate(made[ours.NUMPY])
        people = people or made[ours.NUMPY].people(4)
    seconds: dict[str, Any] = {}
    for kind in KINDS:
        calls = {key: getattr(one, kind) for key, one in candidates.items()}
        for key, taken in side_by_side(calls, people, rounds).items():
            name, _, N = key.rpartition("/")
            seconds.setdefault(kind, {}).setdefault(name, {})[N] = taken
    return {"sizes": list(sizes), "seconds": seconds, "bytes": memory}


def memory_of(n_vertices: int, way: str) -> dict[str, int]:
    """Bytes of this process, which should have done nothing else: before, and at the worst.

    `arrays` are those that the body is given in, without which there is no body.
    """
    before = peak()
    body = random_body(n_vertices)
    arrays = [body.template, body.shapedirs, body.posedirs, body.weights]
    with ours.compiling(way == ours.COMPILED):
        case = case_of(str(n_vertices), body)
        with_body = peak()
        (x,) = case.people(1)
        case.problem.residual(x, case.fixed)
        forward = peak()
        case.problem.linearize_at(x, case.fixed).step()
    return {
        "before": before,
        "arrays": sum(array.nbytes for array in arrays),
        "body": with_body,
        "forward": forward,
        "peak": peak(),
    }


def _asked(n_vertices: int, way: str) -> dict[str, int]:
    """memory_of in a process of its own."""
    command = [sys.executable, "-m", "benchmarks", "memory", str(n_vertices), way]
    here = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=here, check=True, capture_output=True, text=True)
    found: dict[str, int] = json.loads(done.stdout.splitlines()[-1])
    return found


def peak() -> int:
    """The most memory of this process so far; Linux's getrusage would include its parent's."""
    facts = Path("/proc/self/status")
    if facts.exists():
        (line,) = (one for one in facts.read_text().splitlines() if one.startswith("VmHWM"))
        return 1024 * int(line.split()[1])
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
