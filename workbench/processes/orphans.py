"""Processes that end by themselves soon after the one that started them is gone.

A process that is killed cannot end its children, and some of these would work or wait for ever.
"""

import ctypes
import os
import signal
import sys
import threading
import time
from contextlib import suppress

PARENT = "WORKBENCH_PARENT"  # in the environment of a process: who started it
EVERY = 0.5  # s between two looks at the parent
PR_SET_PDEATHSIG = 1  # of Linux's prctl: the signal that a process gets when its parent has died


def environment() -> dict[str, str]:
    """The environment variables with which a process ends with this one: `end_with_parent`."""
    return {PARENT: str(os.getpid())}


def end_with_parent() -> None:
    """End this process when the one that made its environment is gone.

    On Linux the system does this, even if code in C never lets another thread run. The system takes
    the thread that started the process for its parent, so that thread has to live longer than the
    process.
    """
    parent = os.environ.pop(PARENT, "")
    if not parent.isdecimal():
        return
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    end_with(int(parent))


def end_with(parent: int) -> None:
    """End this process when its parent, which has this number, is gone. A thread watches it."""
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    if sys.platform == "win32":  # which never changes what it says of a process's parent
        import _winapi

        with suppress(OSError):  # there is no such process any more
            handle = _winapi.OpenProcess(_winapi.SYNCHRONIZE, False, parent)
            _winapi.WaitForSingleObject(handle, _winapi.INFINITE)
    else:
        while os.getppid() == parent:  # an orphan is given to another process
            time.sleep(EVERY)
    os._exit(1)
