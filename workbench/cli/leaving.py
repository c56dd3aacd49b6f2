"""Ways to leave before the end: from the keyboard, and on request of the system."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

AGAIN = 2.0  # s; by then everything is cleaned up, or the exception was lost


class Interrupted(BaseException):
    """Ctrl-C; says what became of the work.

    Typer gives an interrupt an exit code of its own choice and no sentence; this passes it by.
    """


class Terminated(BaseException):
    """SIGTERM: leave at once, cleaning up on the way."""


def mind_termination() -> None:
    """Raise Terminated on SIGTERM; and once more a little later, should C code or an `except:`
    of somebody's have swallowed it.
    """
    signal.signal(signal.SIGTERM, _terminate)
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, _terminate)


@contextmanager
def held() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait until the block is over: some modules, while they are imported,
    swallow whatever is raised.
    """
    arrived: list[int] = []
    asked = [s for s in (signal.SIGINT, signal.SIGTERM) if callable(signal.getsignal(s))]
    before = {s: signal.signal(s, lambda number, frame: arrived.append(number)) for s in asked}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if arrived:
        raise Terminated if signal.SIGTERM in arrived else KeyboardInterrupt


def be_done() -> None:
    """It was not swallowed."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _terminate(number: int, frame: FrameType | None) -> None:
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, AGAIN)
    raise Terminated
