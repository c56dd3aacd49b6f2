"""Ctrl-C and requests to terminate, while code runs that would lose the exceptions they raise.

Where CasADi and NLopt call a cost function from C++, a KeyboardInterrupt is turned into a failed
evaluation and lost. So a signal is noted first, and its exception is raised where it is not lost.
"""

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

Handler = Callable[[int, FrameType | None], Any]

SIGNALS = (signal.SIGINT, signal.SIGTERM)
RAISED_AT_ONCE_FROM = 3  # from so many signals on, each is raised at once, wherever the program is


class _Received:
    """What has arrived, for an outermost `Interrupts` and all that are opened within it."""

    def __init__(self) -> None:
        self.error: BaseException | None = None
        self.times = 0
        self.safe = False  # whether an exception may be raised here


class Interrupts:
    """Notes signals from `open` to `close`; `check` raises what their handlers have raised.

    It is a context manager that opens and closes itself; code that cannot be inside of one `with`
    calls both. The handler that was there before decides what a signal means: what it raises is
    kept.
    A signal without a Python handler is left alone, and so is everything outside of the main
    thread, where Python runs no handlers.
    """

    def __init__(self) -> None:
        self._received = _Received()
        self._before: dict[int, Handler] = {}
        self._was_safe = False

    def open(self) -> None:
        """Begin to note signals; within another object's time, both share what is received."""
        if threading.current_thread() is not threading.main_thread():
            return
        try:
            for number in SIGNALS:
                handler = signal.getsignal(number)
                outer = getattr(handler, "__self__", None)
                if isinstance(outer, Interrupts):
                    self._received = outer._received
                elif callable(handler):
                    self._before[number] = handler
                    signal.signal(number, self._note)
        except BaseException:
            self._restore()
            raise
        self._was_safe, self._received.safe = self._received.safe, False

    def close(self) -> None:
        """Restore the handlers. Raises what was noted, unless it is a KeyboardInterrupt, which the
        caller reports, who asks `pressed` afterwards.
        """
        self._received.safe = self._was_safe
        self._restore()
        if self._received.error is not None and not self.pressed:
            raise self._received.error

    def __enter__(self) -> "Interrupts":
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self.close()

    @property
    def pressed(self) -> bool:
        """Whether somebody has pressed Ctrl-C."""
        return isinstance(self._received.error, KeyboardInterrupt)

    def check(self) -> None:
        """Raise what was noted, if anything was."""
        if self._received.error is not None:
            raise self._received.error

    def raised_at_once(self) -> "_RaisedAtOnce":
        """A context in which an exception may be raised at once: Python code runs there that may
        take long, or never end.
        """
        return _RaisedAtOnce(self, self._received)

    def _note(self, number: int, frame: FrameType | None) -> None:
        received = self._received
        try:
            self._before[number](number, frame)
        except BaseException as error:
            received.error = error.with_traceback(None)
            received.times += 1
            if received.safe or received.times >= RAISED_AT_ONCE_FROM:
                received.safe = False  # once: what follows cleans up
                raise

    def _restore(self) -> None:
        while self._before:
            number, handler = self._before.popitem()
            signal.signal(number, handler)


class _RaisedAtOnce:
    """The context of `Interrupts.raised_at_once`.

    A run enters one at every evaluation. A generator as a context would take several times as long.
    """

    __slots__ = ("_before", "_interrupts", "_received")

    def __init__(self, interrupts: Interrupts, received: _Received) -> None:
        self._interrupts, self._received = interrupts, received

    def __enter__(self) -> None:
        self._interrupts.check()
        self._before, self._received.safe = self._received.safe, True

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self._received.safe = self._before
        if error is None or isinstance(error, Exception):
            self._interrupts.check()  # C code on the way may have made another error of it


def caused_by(error: BaseException, kind: type[BaseException]) -> bool:
    """Whether an error, or one of its causes, is of a kind.

    C code that is interrupted during a callback raises a SystemError caused by the interrupt.
    """
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, kind):
        cause = cause.__cause__
    return cause is not None
