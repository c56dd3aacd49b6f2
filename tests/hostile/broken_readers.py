"""Readers that do what no reader may, to see that it is noticed."""

import os
import time
from pathlib import Path

import numpy as np

from workbench.errors import BadFile


def raises(path: Path) -> None:
    {}["no such key"]


def accepts(path: Path) -> None:
    from tests.hostile.formats import finite

    finite([1.0, float("nan")])


def sleeps(path: Path) -> None:
    time.sleep(100)


def works(path: Path) -> None:
    while True:
        pass


def dies(path: Path) -> None:
    os.kill(os.getpid(), 9)


def fills_memory(path: Path) -> None:
    np.ones(40_000_000).sum()


def asks_for_memory(path: Path) -> None:
    np.empty(2**33)


def talks(path: Path) -> None:
    raise BadFile("a" * 10_000)


def warns(path: Path) -> None:
    np.log(np.zeros(1))


def leaves(path: Path) -> None:
    (path / "left").write_text("something")


BROKEN = {  # and what must be said of it
    raises: "KeyError in broken_readers.py, raises",
    accepts: "accepted: the number nan",
    sleeps: "SIGKILL",
    works: "not ended after",
    dies: "SIGKILL",
    fills_memory: "memory",
    asks_for_memory: "MemoryError",
    talks: "a message of 10000 characters",
    warns: "RuntimeWarning",
    leaves: "files were left",
}
