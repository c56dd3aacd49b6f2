"""The process that reads hostile files."""

from collections.abc import Iterator

import pytest

from tests.hostile.limits import Reader


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep tests that ask it in one process, so that it is started once."""
    for item in items:
        if item.path.parent.name == "hostile" and "reader" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.xdist_group("hostile"))


@pytest.fixture(scope="session")
def reader() -> Iterator[Reader]:
    """Reads files in a process of its own, under limits of time and of memory."""
    one = Reader()
    yield one
    one.close()
