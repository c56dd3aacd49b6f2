"""Memory that tests no longer need."""

import ctypes
import gc
from contextlib import suppress
from types import ModuleType


def forget(module: ModuleType) -> None:
    """Empty the caches of a module's own functions."""
    for value in vars(module).values():
        own = getattr(value, "__module__", None) == module.__name__
        if own and hasattr(value, "cache_clear"):
            value.cache_clear()


def collect() -> None:
    """Free what only refers to itself, and return what is free to the system."""
    gc.collect()
    give_back()


def give_back() -> None:
    """Return freed memory to the system, of which glibc keeps hundreds of MB after a training."""
    with suppress(AttributeError, OSError, TypeError):  # only glibc has this
        ctypes.CDLL(None).malloc_trim(0)
