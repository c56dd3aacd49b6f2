"""The process in which a student's file is run: `python -m workbench.course.marker N FILE NAMES`.

It answers on what was its standard output, a line of JSON for each thing that begins or is done;
what the student's code prints goes elsewhere, and is counted.
"""

import importlib.util
import io
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from types import ModuleType
from typing import Any, TextIO

from workbench.course.marking import mark, said
from workbench.course.outline import lecture
from workbench.course.withholding import withhold

MEMORY = 6 * 2**30  # bytes that a student's code may take, where the system can be told so
KEPT = 400  # characters of what was printed


class Page(io.TextIOBase):
    """A stream that keeps the beginning of what is written, and counts the rest."""

    def __init__(self) -> None:
        self._kept, self._count = "", 0

    def write(self, text: str) -> int:
        """Keep what there is room for."""
        self._kept += text[: max(0, KEPT - len(self._kept))]
        self._count += len(text)
        return len(text)

    @property
    def text(self) -> str:
        """What was kept, and how much was not."""
        left = self._count - len(self._kept)
        return self._kept.rstrip() + (f"\n... and {left:,} characters more" if left else "")


def main() -> None:
    """Load the file, then mark one exercise after the other."""
    number, file, *exercises = sys.argv[1:]
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as out:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        sys.dont_write_bytecode = True  # nothing is left in the student's folder
        _limit_memory()
        one = lecture(int(number))
        withhold(one, file)
        page = Page()
        with _kept(page):
            _tell(out, begun="")
            try:
                module = load(file)
            except BaseException as error:
                found = sys.modules.get("answers")
                late = isinstance(error, SystemExit) and any(
                    hasattr(found, e) for e in one.exercises
                )
                if found is None or not late:
                    _tell(out, trouble=said(error, file=file))
                    return
                module = found  # a script may end by sys.exit: what stands above is there
        _tell(out, loaded=page.text)
        for exercise in exercises:
            _tell(out, begun=exercise)
            page = Page()
            with _kept(page):
                marks = mark(one, exercise, module)
            _tell(out, exercise=exercise, marks=[m.data() for m in marks], printed=page.text)
        _tell(out, done=True)
        out.flush()
        os._exit(0)  # threads of the student's may still run, and exit handlers of theirs wait


def load(file: str) -> ModuleType:
    """Run a student's file. Raises whatever it raises, SystemExit among it."""
    spec = importlib.util.spec_from_file_location("answers", file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{Path(file).name} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules["answers"] = module
    sys.path.append(str(Path(file).parent))  # at the end: it may hold a random.py
    spec.loader.exec_module(module)
    return module


@contextmanager
def _kept(page: Page) -> Iterator[None]:
    with redirect_stdout(page), redirect_stderr(page):
        yield


def _tell(out: TextIO, **what: Any) -> None:
    out.write(json.dumps(what) + "\n")
    out.flush()


def _limit_memory() -> None:
    with suppress(ImportError, ValueError, OSError):  # not on Windows, or already limited below
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


if __name__ == "__main__":
    main()
