"""The process that reads hostile files."""

from collections.abc import Iterator

import pytest

from tests.hostile.limits import Reader


@pytest.fixture(scope="session")
def reader() -> Iterator[Reader]:
    """Reads files in a process of its own, under limits of time and of memory."""
    one = Reader()
    yield one
    one.close()
