"""The wall time of what the course and the examples cost, after every run that had some."""

from typing import Any

TAUGHT = ("tests/lectures/", "tests/test_examples", "tests/cli/test_lecture")


def pytest_terminal_summary(terminalreporter: Any) -> None:
    reports = [r for kind in ("passed", "failed") for r in terminalreporter.getreports(kind)]
    taught = [r.duration for r in reports if r.nodeid.startswith(TAUGHT)]
    if taught:
        terminalreporter.write_line(
            f"lectures, exercises and examples: {len(taught)} tests in {sum(taught):.0f} s"
        )
