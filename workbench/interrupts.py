"""Ctrl-C and requests to terminate, while code is at work that loses the exceptions they raise.

Python raises KeyboardInterrupt between any two of its instructions. Where these are called from
C++, as CasADi and NLopt call a cost function, the exception is turned into a failed evaluation,
and the interrupt is lost. So a signal is written down first, and raised where it is heard.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

Handler = Callable[[int, FrameType | None], Any]

SIGNALS = (signal.SIGINT, signal.SIGTERM)
INSISTENT = 3  # from so many signals on, each is raised at once, wherever the program is


class _Heard:
    """What has arrived, for an outermost `Interrupts` and all that are opened within it."""

    def __init__(self) -> None:
        self.error: BaseException | None = None
        self.times = 0
        self.safe = False  # whether an exception may be raised here


class Interrupts:
    """From `open` to `close`, signals are written down; `check` raises what they ask for.

    What a signal means is decided by the handler that was there before: what it raises is kept.
    A signal without a Python handler is left alone, and so is everything outside of the main
    thread, where Python runs no handlers.
    """

    def __init__(self) -> None:
        self._heard = _Heard()
        self._before: dict[int, Handler] = {}
        self._was_safe = False

    def open(self) -> None:
        """Begin to write signals down; within another object's time, both share what is heard."""
        if threading.current_thread() is not threading.main_thread():
            return
        try:
            for number in SIGNALS:
                handler = signal.getsignal(number)
                outer = getattr(handler, "__self__", None)
                if isinstance(outer, Interrupts):
                    self._heard = outer._heard
                elif callable(handler):
                    self._before[number] = handler
                    signal.signal(number, self._note)
        except BaseException:
            self._restore()
            raise
        self._was_safe, self._heard.safe = self._heard.safe, False

    def close(self) -> None:
        """Give the signals back. Raises what was written down, unless it is a KeyboardInterrupt:
        that is for the caller to tell, who asks `pressed` afterwards.
        """
        self._heard.safe = self._was_safe
        self._restore()
        if self._heard.error is not None and not self.pressed:
            raise self._heard.error

    @property
    def pressed(self) -> bool:
        """Whether somebody has pressed Ctrl-C."""
        return isinstance(self._heard.error, KeyboardInterrupt)

    def check(self) -> None:
        """Raise what was written down, if anything was."""
        if self._heard.error is not None:
            raise self._heard.error

    @contextmanager
    def raised_at_once(self) -> Iterator[None]:
        """Inside, an exception may be raised at once: Python code runs there that may take long,
        or never end.
        """
        heard = self._heard
        self.check()
        before, heard.safe = heard.safe, True
        try:
            yield
        except Exception:
            self.check()  # C code on the way has made another error of it
            raise
        finally:
            heard.safe = before
        self.check()

    def _note(self, number: int, frame: FrameType | None) -> None:
        heard = self._heard
        try:
            self._before[number](number, frame)
        except BaseException as error:
            heard.error = error.with_traceback(None)
            heard.times += 1
            if heard.safe or heard.times >= INSISTENT:
                heard.safe = False  # once: what follows cleans up
                raise

    def _restore(self) -> None:
        while self._before:
            number, handler = self._before.popitem()
            signal.signal(number, handler)
