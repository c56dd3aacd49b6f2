"""The section on self-contact is what its numbers say."""

import json

import numpy as np
import pytest

from benchmarks.images.contact import BEGIN, END, FITS, PAGE, RESULTS, WAYS, tables

FOUND = json.loads(RESULTS.read_text())
TEXT = PAGE.read_text()


def of(way: str, key: str) -> np.ndarray:
    """A number of every fit of a way."""
    return np.array(FOUND["fits"][way][key])


def test_the_tables_are_written_from_the_numbers() -> None:
    assert TEXT.partition(BEGIN)[2].partition(END)[0].strip() == tables(FOUND).strip()


def test_every_way_fitted_the_same_poses() -> None:
    assert list(FOUND["fits"]) == list(WAYS)
    assert {len(values) for each in FOUND["fits"].values() for values in each.values()} == {FITS}


@pytest.mark.parametrize("way", ["SQP after the hinge", "IPOPT after the hinge"])
def test_the_hinge_with_a_small_sigma_and_the_limit_agree_from_one_start(way: str) -> None:
    assert abs(of("hinge, sigma 0.1 mm", "cost") / of(way, "cost") - 1).max() < 0.001
    assert abs(of("hinge", "cost") / of(way, "cost") - 1).max() < 0.02
