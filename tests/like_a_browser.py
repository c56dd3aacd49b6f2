"""A plugin for pytest, which takes away what Python does not have in a browser.

`python -m pytest -m browser -p tests.like_a_browser` runs the tests that are to pass there without
processes, threads, and the modules that Pyodide lacks. This is Linux all the same: that a browser
has less memory and 32-bit addresses is not tried.
"""

import errno
import os
import subprocess
import sys
import threading
from typing import Any, NoReturn

from workbench import environment

LACKING = (
    *("emcee", "arviz", "arviz_stats", "corner", "rtree"),
    *("_multiprocessing", "_posixshmem", "fcntl", "grp", "pwd", "readline", "resource", "termios"),
)


def _no_thread(self: threading.Thread) -> NoReturn:
    raise RuntimeError("can't start new thread")


def _no_process(self: Any, *_: Any, **__: Any) -> NoReturn:
    raise OSError(errno.ENOTSUP, "emscripten does not support processes")


def pytest_configure() -> None:
    """Take everything away before tests are collected, and with them the workbench is imported."""
    for name in LACKING:
        sys.modules[name] = None  # type: ignore[assignment]  # so that importing it fails
    environment.PLATFORMS = (sys.platform,)
    threading.Thread.start = _no_thread  # type: ignore[method-assign]
    subprocess.Popen.__init__ = _no_process  # type: ignore[method-assign]
    for name in ("fork", "forkpty", "posix_spawn", "sched_getaffinity"):
        if hasattr(os, name):
            delattr(os, name)
