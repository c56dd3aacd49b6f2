"""The other cores, kept busy while something is timed: what a shared machine does to the numbers.

`python -m benchmarks.busy` reads and writes 64 MB of memory again and again until it is ended, so
that the processor's last cache and its way to memory are shared as well as its clock.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

NUMBERS = 4_000_000  # of each of two arrays: together they fit into no cache


@contextmanager
def busy_elsewhere() -> Iterator[int]:
    """A process that computes on every core but ours, which is yielded as their number."""
    mine = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else {0}
    others = sorted({*range(os.cpu_count() or 1)} - mine)
    made = [subprocess.Popen([sys.executable, "-m", "benchmarks.busy", str(c)]) for c in others]
    try:
        yield len(made)
    finally:
        for process in made:
            process.kill()
            process.wait()


def compute(core: int) -> None:
    """Use one core until the process is ended."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})
    a, b = np.ones(NUMBERS), np.full(NUMBERS, 1e-9)
    while True:
        a += b
        b += 1e-20


if __name__ == "__main__":
    compute(int(sys.argv[1]))
