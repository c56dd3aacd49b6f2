"""Readers that several files of tests ask."""

from collections.abc import Iterator

import pytest

from tests.hardening.pickled_bodies import loading
from tests.hardening.within_limits import Reader


@pytest.fixture(scope="module")
def bodies() -> Iterator[Reader]:
    """Reads bodies in a process of its own, under a limit of time and of memory."""
    yield from loading()
