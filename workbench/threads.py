"""How many threads linear algebra may use: one, or WORKBENCH_THREADS.

The matrices of a fit are small or limited by memory, and two threads that wait for each other on a
busy machine were measured to be four times slower than one. Entering the context costs about 15
microseconds, so it belongs around a run, not around each product.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController

from workbench.errors import WorkbenchError


def thread_count() -> int:
    """The number of threads that WORKBENCH_THREADS sets, or 1. Raises WorkbenchError."""
    setting = os.environ.get("WORKBENCH_THREADS", "1")
    if not setting.isdecimal() or int(setting) < 1:
        raise WorkbenchError(f"WORKBENCH_THREADS is a count of threads, 1 or more, not {setting!r}")
    return int(setting)


@contextmanager
def limited_threads() -> Iterator[None]:
    """Limit BLAS to `thread_count()` threads inside of the context."""
    count = thread_count()
    if all(library.num_threads == count for library in _controller().lib_controllers):
        yield  # nothing to change, as inside another such context
        return
    with _controller().limit(limits=count):
        yield


def blas_libraries() -> list[str]:
    """Each BLAS in the process: its name, version, and threads outside of the context."""
    return [
        f"{library['internal_api']} {library['version']}, {library['num_threads']} threads, "
        f"{library.get('architecture', 'architecture unknown')} ({library['prefix']})"
        for library in _controller().info()
    ]


@cache
def _controller() -> ThreadpoolController:
    """The BLAS libraries of NumPy and SciPy. To find them takes milliseconds."""
    import numpy.linalg  # noqa: F401
    import scipy.linalg  # noqa: F401

    return ThreadpoolController().select(user_api="blas")
