"""How tests are divided among processes, and the wall time of the course and the examples."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

TOGETHER = {  # files of tests that share what takes long, and a name for them
    "test_every_lecture.py": "lectures",
    "test_prose.py": "lectures",
    "test_benchmarks.py": "benchmarks",
    "test_examples.py": "examples",
    "test_site.py": "site",
    "test_no_hang.py": "no hang",
    "test_triangle_study.py": "triangles",
    "test_gauges_of_training.py": "gauges of training",
}
TAUGHT = ("tests/lectures/", "tests/test_examples", "tests/cli/test_lecture")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """With `-m browser`, files without such tests are not imported.

    They import libraries that an environment like a browser's does not have.
    """
    inside = collection_path.is_dir()
    if config.option.markexpr != "browser" or not (inside or collection_path.suffix == ".py"):
        return None
    files = collection_path.rglob("test_*.py") if inside else [collection_path]
    return not any("mark.browser" in file.read_text(encoding="utf-8") for file in files) or None


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist reads the groups
def pytest_collection_modifyitems(items: Iterable[pytest.Item]) -> None:
    """Keep tests that share what takes long in one process, where it is done once."""
    for item in items:
        if item.path.name in TOGETHER:
            item.add_marker(pytest.mark.xdist_group(TOGETHER[item.path.name]))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    reports = [r for kind in ("passed", "failed") for r in terminalreporter.getreports(kind)]
    taught = [r.duration for r in reports if r.nodeid.startswith(TAUGHT)]
    if taught:
        terminalreporter.write_line(
            f"lectures, exercises and examples: {len(taught)} tests in {sum(taught):.0f} s"
        )
