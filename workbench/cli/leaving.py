"""Ways to leave before the end: from the keyboard, and on request of the system."""

import atexit
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, NoReturn

from workbench.interrupts import caused_by

AGAIN = 2.0  # s; by then everything is cleaned up, or the exception was lost
LOST = 0.05  # s after which an exception is raised again that is known to be lost
INTERRUPTED = "interrupted; every file that was written is whole"
ONE_PRESS = 1.0  # s; signals of one kind within that time are one: the first is being obeyed


class Interrupted(BaseException):
    """Ctrl-C; says what became of the work.

    Typer gives an interrupt an exit code of its own choice and no sentence; this passes it by.
    """


class Terminated(BaseException):
    """SIGTERM: leave at once, cleaning up on the way; may say what became of the work."""


@contextmanager
def interrupts_say(text: Callable[[], str]) -> Iterator[None]:
    """Inside, an interrupt from the keyboard raises Interrupted with a text, also out of C code.

    A request to terminate raises Terminated with the same text, in which `terminated` stands for
    `interrupted`.
    """
    try:
        yield
    except (KeyboardInterrupt, Terminated, SystemError) as error:
        if caused_by(error, KeyboardInterrupt):
            raise Interrupted(text()) from error
        if caused_by(error, Terminated):
            raise Terminated(text().replace("interrupted", "terminated", 1)) from error
        raise


class Signals:
    """A context: inside, Ctrl-C raises KeyboardInterrupt and SIGTERM raises Terminated.

    They are raised once more if Python reports that they were lost, for example in a destructor.
    Terminated is also raised again after a while, in case C code or a bare `except:` caught it.
    After the context, the command is over: a signal ends the process at once. Where Ctrl-C is
    ignored, as in the background of a shell, it stays so.
    """

    def __init__(self) -> None:
        self.asked: type[BaseException] | None = None  # what was raised last
        self._when = -ONE_PRESS

    def __enter__(self) -> "Signals":
        atexit.register(_ignore)  # last of all, as Python itself is taken apart
        self._hook, sys.unraisablehook = sys.unraisablehook, self._unraisable
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, self._interrupt)
        signal.signal(signal.SIGTERM, self._terminate)
        if hasattr(signal, "SIGALRM"):
            signal.signal(signal.SIGALRM, self._again)
        return self

    def __exit__(self, *_: object) -> None:
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, _at_once)
        signal.signal(signal.SIGTERM, _at_once)
        _alarm(0.0)
        sys.unraisablehook = self._hook

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self._raise(KeyboardInterrupt)

    def _terminate(self, number: int, frame: FrameType | None) -> None:
        _alarm(AGAIN)
        self._raise(Terminated)

    def _raise(self, kind: type[BaseException]) -> None:
        now = time.monotonic()
        if kind is self.asked and now - self._when < ONE_PRESS:
            return
        self.asked, self._when = kind, now
        raise kind

    def _again(self, number: int, frame: FrameType | None) -> None:
        if self.asked is Terminated:
            _alarm(AGAIN)
        if self.asked is not None:
            raise self.asked

    def _unraisable(self, lost: Any) -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt | Terminated):
            _alarm(LOST)
        else:
            self._hook(lost)


@contextmanager
def held() -> Iterator[None]:
    """Defer Ctrl-C and SIGTERM until the block ends.

    Some modules swallow every exception while they are imported.
    """
    arrived: list[int] = []
    asked = [s for s in (signal.SIGINT, signal.SIGTERM) if callable(signal.getsignal(s))]
    before = {s: signal.signal(s, lambda number, frame: arrived.append(number)) for s in asked}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
    if arrived:
        signal.raise_signal(max(arrived))  # SIGTERM before SIGINT, by the handler that is there
        raise Terminated if signal.SIGTERM in arrived else KeyboardInterrupt


def _at_once(number: int, frame: FrameType | None) -> NoReturn:
    os._exit(128 + number)


def _ignore() -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def _alarm(seconds: float) -> None:
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)
