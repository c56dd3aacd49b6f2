"""The unit that a file declares is taken where a body can have the size in it."""

import numpy as np
import pytest

from workbench.errors import BadFile
from workbench.motions.guesses import unit_of


def markers(size: float) -> np.ndarray:
    """Places (5, 20, 3) that reach `size` from one end to the other."""
    rng = np.random.default_rng(0)
    places = rng.uniform(size=(5, 20, 3))
    places[:, 0], places[:, 1] = 0, 1
    return size / np.sqrt(3) * places


@pytest.mark.parametrize(("declared", "size"), [("mm", 1800.0), ("m", 1.8), ("mm", 150.0)])
def test_declared_unit_is_taken_when_a_body_has_the_size(declared: str, size: float) -> None:
    metres, why = unit_of(markers(size), None, declared)
    assert metres == {"mm": 1e-3, "m": 1.0}[declared]
    assert why == f"the unit is {declared}, as the file says"


@pytest.mark.parametrize(("declared", "size", "taken"), [("m", 1661.0, 1e-3), ("mm", 1.7, 1.0)])
def test_declared_unit_that_makes_no_body_is_doubted(
    declared: str, size: float, taken: float
) -> None:
    metres, why = unit_of(markers(size), None, declared)
    assert metres == taken
    assert f"the file says {declared}" in why
    assert "as no body does" in why


def test_given_unit_wins_over_the_declared_one() -> None:
    assert unit_of(markers(1661.0), "m", "mm")[0] == 1.0


def test_size_of_no_body_is_refused_with_the_declared_unit() -> None:
    with pytest.raises(BadFile, match="the file says m"):
        unit_of(markers(1e6), None, "m")
