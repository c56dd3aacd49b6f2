"""How tests are divided among processes, what they forget, and the wall time of the course."""

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.memory import forget, give_back

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
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep tests that share what takes long in one process, where it is done once.

    Tests of one lecture follow each other, so that no more than one run of a lecture is kept.
    """
    for item in items:
        if item.path.name in TOGETHER:
            item.add_marker(pytest.mark.xdist_group(TOGETHER[item.path.name]))
    places = [i for i, one in enumerate(items) if TOGETHER.get(one.path.name) == "lectures"]
    taught = sorted((items[i] for i in places), key=lecture_number)  # others keep their order
    for i, one in zip(places, taught, strict=True):
        items[i] = one


def lecture_number(item: pytest.Item) -> int:
    """Of the lecture that a test is about; 0 for one that is about none."""
    given = getattr(getattr(item, "callspec", None), "params", {})
    number = getattr(given.get("lecture"), "number", given.get("number", 0))
    return int(number)


@pytest.fixture(autouse=True, scope="module")
def nothing_is_kept_for_other_files(request: pytest.FixtureRequest) -> Iterator[None]:
    """After a file of tests, what its cached functions hold is freed.

    All files of a run are imported at its start and stay, and so would what their caches hold.
    """
    yield
    assert isinstance(request.module, ModuleType)
    forget(request.module)
    give_back()


def pytest_terminal_summary(terminalreporter: Any) -> None:
    reports = [r for kind in ("passed", "failed") for r in terminalreporter.getreports(kind)]
    taught = [r.duration for r in reports if r.nodeid.startswith(TAUGHT)]
    if taught:
        terminalreporter.write_line(
            f"lectures, exercises and examples: {len(taught)} tests in {sum(taught):.0f} s"
        )
