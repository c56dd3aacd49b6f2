"""The command line: parsing, progress and printing; no mathematics."""

import atexit
import errno
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from types import FrameType

from workbench.interrupts import caused_by

EXIT_PIPE_CLOSED = 1  # the exit code if nobody reads on, as after `| head -1`
INTERRUPTED = "interrupted; every file that was written is whole"
SAME_PRESS_SECONDS = 1.0  # signals of one kind within that time are one: the first is obeyed


class Interrupted(BaseException):
    """Ctrl-C; says what became of the work.

    Typer gives an interrupt an exit code of its own choice and no sentence; this passes it by.
    """


class Terminated(BaseException):
    """SIGTERM: leave at once, cleaning up on the way; may say what became of the work."""


def main() -> None:
    """Run a command. Errors of ours are a sentence and exit code 2, an interrupt is 130, and a
    request to terminate 143. An output that cannot be written is a sentence and exit code 2. If the
    reader of a pipe has closed it, nothing is said and the exit code is 1.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        if isinstance(stream := getattr(sys, name), TextIOWrapper):
            stream.reconfigure(errors="replace")
    _listen()
    code, sentence, unprinted = _run_app()
    for number in (signal.SIGINT, signal.SIGTERM):  # what is left to do can be left
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda number, frame: os._exit(128 + number))
    try:
        sys.stdout.flush()
    except OSError as error:
        unprinted = error
        with suppress(OSError):  # what is left is printed nowhere, or Python stumbles as it ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if isinstance(unprinted, BrokenPipeError):
        code, sentence = code or EXIT_PIPE_CLOSED, ""
    elif unprinted is not None:
        code, sentence = 2, f"cannot write to the standard output: {unprinted.strerror}"
    if sentence:
        tell(sentence)
    sys.exit(code)


def _run_app() -> tuple[int, str, OSError | None]:
    """Run a command: its exit code, a last sentence, and why its output could not be written."""
    try:
        with defer_signals():
            from workbench.cli.app import app
        app()
    except Interrupted as leaving:
        return 130, str(leaving), None
    except KeyboardInterrupt:
        return 130, INTERRUPTED, None
    except Terminated as leaving:
        return 143, str(leaving) or INTERRUPTED.replace("interrupted", "terminated"), None
    except SystemExit as leaving:  # Typer's, also of an interrupt while it reads the arguments
        code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        return code, INTERRUPTED if code == 130 else "", None
    except Exception as error:
        if isinstance(error, OSError) and error.errno in (errno.EPIPE, errno.ENOSPC):
            return 0, "", error
        if explain(error):
            return 2, "", None
        raise
    return 0, "", None


def tell(sentence: str) -> None:
    """Print to the standard error; if that fails as well, only the exit code says what happened."""
    with suppress(OSError):
        print(sentence, file=sys.stderr, flush=True)


def explain(error: Exception) -> bool:
    """Print the sentence of an error of ours, and return True.

    Return False for any other error, which is a mistake in the workbench.
    """
    from rich.console import Console
    from rich.markup import escape

    from workbench.errors import WorkbenchError

    if not isinstance(error, WorkbenchError):
        return False
    with suppress(OSError):
        Console(stderr=True).print(
            f"[bold red]error:[/] {escape(str(error))}", highlight=False, soft_wrap=True
        )
    return True


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
        if caused_by(error, Terminated) and not (isinstance(error, Terminated) and error.args):
            raise Terminated(text().replace("interrupted", "terminated", 1)) from error
        raise


@contextmanager
def defer_signals() -> Iterator[None]:
    """Defer Ctrl-C and SIGTERM until the block ends.

    Some modules swallow every exception while they are imported.
    """
    arrived: list[int] = []
    deferred = [s for s in (signal.SIGINT, signal.SIGTERM) if callable(signal.getsignal(s))]
    before = {s: signal.signal(s, lambda number, frame: arrived.append(number)) for s in deferred}
    try:
        yield
    finally:
        for signal_number, handler in before.items():
            signal.signal(signal_number, handler)
    if arrived:
        signal.raise_signal(max(arrived))  # SIGTERM before SIGINT, by the handler that is there
        raise Terminated if signal.SIGTERM in arrived else KeyboardInterrupt


def _listen() -> None:
    """From now on Ctrl-C raises KeyboardInterrupt and SIGTERM raises Terminated.

    Where Ctrl-C is ignored, as in the background of a shell, it stays so.
    """
    obeyed: dict[type[BaseException], float] = {}

    def obey(kind: type[BaseException]) -> None:
        now = time.monotonic()
        if now - obeyed.get(kind, -SAME_PRESS_SECONDS) >= SAME_PRESS_SECONDS:
            obeyed[kind] = now
            raise kind

    def interrupt(number: int, frame: FrameType | None) -> None:
        obey(KeyboardInterrupt)

    def terminate(number: int, frame: FrameType | None) -> None:
        obey(Terminated)

    for number in (signal.SIGINT, signal.SIGTERM):  # last of all, as Python is taken apart
        atexit.register(signal.signal, number, signal.SIG_IGN)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, terminate)
