"""Readers that do what no reader may, to see that an attack notices it."""

import os
import time
from pathlib import Path

import numpy as np

from tests.fuzz.formats import Format
from workbench.errors import BadFile

VALID = b'{"a": [1, 2, 3]}'
FILE = "some.json"


def _make(folder: Path) -> None:
    (folder / FILE).write_bytes(VALID)


def _wrong(folder: Path) -> bool:
    return (folder / FILE).read_bytes() != VALID


def _raises(folder: Path) -> object:
    return {}["no such key"] if _wrong(folder) else ()


def _accepts(folder: Path) -> object:
    return float("nan") if _wrong(folder) else 1.0


def _hangs(folder: Path) -> object:
    return time.sleep(100) if _wrong(folder) else ()


def _dies(folder: Path) -> object:
    return os.abort() if _wrong(folder) else ()


def _eats(folder: Path) -> object:
    return len(np.ones(40_000_000)) if _wrong(folder) else ()


def _works_long(folder: Path) -> object:
    while _wrong(folder) and time.process_time() < 3:
        pass
    return ()


def _tells_all(folder: Path) -> object:
    if _wrong(folder):
        raise BadFile("a" * 10_000)
    return ()


def _warns(folder: Path) -> object:
    return np.log(np.zeros(1) if _wrong(folder) else np.ones(1))


BROKEN = {  # and what the attack must say of it
    "raises": (Format(_make, _raises), "KeyError"),
    "accepts": (Format(_make, _accepts), "accepted"),
    "hangs": (Format(_make, _hangs, patience=1), "not ended after 1 s"),
    "dies": (Format(_make, _dies), "SIGABRT"),
    "eats": (Format(_make, _eats, megabytes=200), "memory"),
    "works long": (Format(_make, _works_long, seconds=0.1), "slow"),
    "tells all": (Format(_make, _tells_all), "a message of 10000 characters"),
    "warns": (Format(_make, _warns), "RuntimeWarning"),
}
