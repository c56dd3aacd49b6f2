"""Which of a test's parameters belong to the default run."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest

THOROUGH = pytest.mark.thorough


def few(values: Iterable[Any], keep: int | Collection[Any] = 4) -> list[Any]:
    """Values for `parametrize`, of which the default run takes some and the thorough run the rest.

    Args:
        values: plain values or `pytest.param`s.
        keep: how many of the first ones are in the default run, or which values or ids.
    """
    found = []
    for number, one in enumerate(values):
        param = one if hasattr(one, "marks") and hasattr(one, "values") else pytest.param(one)
        if isinstance(keep, int):
            kept = number < keep
        else:
            names = [param.id, *param.values] if len(param.values) == 1 else [param.id]
            kept = any(name in keep for name in names if name is not None)
        marks = tuple(param.marks) if kept else (*param.marks, THOROUGH)
        found.append(pytest.param(*param.values, id=param.id, marks=marks))
    return found
