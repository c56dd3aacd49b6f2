"""Whether a dense matrix fits into memory, checked before it is allocated."""

import os
from contextlib import suppress
from pathlib import Path

from workbench.errors import TooLarge

SMALL = 2**28  # bytes: not worth asking for
GIGA = 1e9
INSTEAD = "free fewer blocks at a time, or divide the problem, as a long sequence into short ones"


def check_fits(rows: int, columns: int) -> None:
    """Raise TooLarge unless a dense Jacobian fits twice into the memory that is free."""
    size = 8 * rows * columns
    if size <= SMALL:
        return
    free = free_memory()
    if free is not None and 2 * size > free:  # a factorization of it takes as much again
        raise TooLarge(
            f"a dense Jacobian of {rows:,} x {columns:,} takes {size / GIGA:.3g} GB, and a step "
            f"with it as much again; {free / GIGA:.2g} GB of memory are free; {INSTEAD}"
        )


def free_memory() -> int | None:
    """The bytes that this process may still allocate; None where the system does not tell.

    It is the available memory of the machine, or what a limit of the process or of its container
    leaves if that is less. Only Linux tells.
    """
    limits: list[int] = []
    with suppress(OSError, ValueError):
        facts = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text().splitlines())
        limits.append(1024 * int(facts["MemAvailable"].split()[0]))
    with suppress(OSError, ValueError, ImportError):
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        if most != resource.RLIM_INFINITY:
            limits.append(max(0, most - taken))
    with suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        most = int((group / "memory.max").read_text())  # "max" is no number: no limit
        limits.append(max(0, most - int((group / "memory.current").read_text())))
    return min(limits, default=None)
