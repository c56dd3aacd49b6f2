"""The command line in this process, for the tests that type at it."""

import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from workbench.cli import main

Ran = tuple[int, str, str]  # exit code, stdout, stderr
Run = Callable[..., Ran]


@pytest.fixture
def workbench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Run]:
    """The command line in this process, at an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    names = ("SIGINT", "SIGTERM", "SIGALRM")
    asked = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in asked}
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the background of a shell ignores it

    def run(*arguments: str) -> Ran:
        monkeypatch.setattr(sys, "argv", ["workbench", *arguments])
        with pytest.raises(SystemExit) as left:
            main()
        said = capsys.readouterr()
        code = left.value.code or 0
        assert isinstance(code, int)
        return code, said.out, said.err

    yield run
    for number, handler in before.items():
        signal.signal(number, handler)
