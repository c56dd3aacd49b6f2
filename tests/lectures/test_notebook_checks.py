"""Exercises in notebooks: cells for answers, and cells that check them."""

import numpy as np
import pytest

from workbench.course.grading import check_here
from workbench.errors import UnknownName


def hat(w):
    return np.cross(np.eye(3), -w)


def test_answer_is_checked_where_it_is_defined(capsys: pytest.CaptureFixture[str]) -> None:
    check_here(2, hat)
    said = capsys.readouterr().out
    assert "failed: hat(w) @ v is w x v" in said
    assert "perhaps this is v x w" in said
    assert said.endswith("0 of 1 points\n")
    with pytest.raises(UnknownName, match="no exercise of lecture 2 is called 'test_here'"):
        check_here(2, test_here)


def test_here() -> None:
    """A function that is no exercise."""
