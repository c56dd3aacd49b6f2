"""How tests are divided among processes, and the wall time of the course and the examples."""

from collections.abc import Iterable
from typing import Any

import pytest

RUN_LECTURES = ("test_every_lecture.py", "test_prose.py")
TAUGHT = ("tests/lectures/", "tests/test_examples", "tests/cli/test_lecture")


def pytest_collection_modifyitems(items: Iterable[pytest.Item]) -> None:
    """Keep the tests that run lectures in one process, where each lecture is run once."""
    for item in items:
        if item.path.name in RUN_LECTURES:
            item.add_marker(pytest.mark.xdist_group("lectures"))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    reports = [r for kind in ("passed", "failed") for r in terminalreporter.getreports(kind)]
    taught = [r.duration for r in reports if r.nodeid.startswith(TAUGHT)]
    if taught:
        terminalreporter.write_line(
            f"lectures, exercises and examples: {len(taught)} tests in {sum(taught):.0f} s"
        )
