"""Signals while the command line is still being imported."""

import os
import signal
import subprocess
import sys

import pytest

from workbench.cli.leaving import Terminated, held

EARLY = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # the background of a shell ignores it
class Early:  # a module of the command line begins to be imported: that is when it comes
    def find_spec(self, name, path=None, target=None):
        if name == "{module}":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Early())
from workbench.cli import main
main()
"""


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("module", ["workbench.cli.app", "workbench.cli.run", "workbench.problem"])
def test_an_interrupt_while_importing_is_a_sentence(module: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", EARLY.replace("{module}", module), "run", "--list"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 130
    assert done.stderr == "interrupted; nothing was written\n"
    assert done.stdout == ""


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_what_is_held_is_not_swallowed() -> None:
    before = signal.getsignal(signal.SIGINT)
    went_on: list[bool] = []
    with pytest.raises(KeyboardInterrupt), held():  # noqa: PT012
        signal.raise_signal(signal.SIGINT)
        went_on.append(True)
    assert went_on
    assert signal.getsignal(signal.SIGINT) is before
    handler = signal.signal(signal.SIGTERM, lambda number, frame: None)
    try:
        with pytest.raises(Terminated), held():
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, handler)
