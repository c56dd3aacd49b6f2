"""Examples in the docstrings of rigid registration are what a reader gets."""

import doctest
from types import ModuleType

import pytest

from workbench.registration import icp, icp_losses, point_cloud


@pytest.mark.parametrize("module", [icp, icp_losses, point_cloud], ids=lambda m: m.__name__)
def test_examples_in_docstrings(module: ModuleType) -> None:
    failed, tried = doctest.testmod(module)
    assert tried > 0
    assert failed == 0
