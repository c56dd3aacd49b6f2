"""Whether there is a compiler for tests of compiled code."""

import pytest

from workbench.compiling import NoLibrary, find_compiler


def compiler() -> bool:
    """Whether a C compiler works here."""
    try:
        find_compiler()
    except NoLibrary:
        return False
    return True


NEEDS_A_COMPILER = pytest.mark.skipif(not compiler(), reason="cc")
