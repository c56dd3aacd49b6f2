"""The section on self-contact is what its numbers say."""

import json

import numpy as np
import pytest

from benchmarks.images.contact import BEGIN, END, FITS, PAGE, RESULTS, WAYS, counted, tables

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


def test_all_ways_agree_in_nine_of_ten_poses() -> None:
    costs = np.array(
        [of(way, "cost") for way in WAYS if way not in ("nothing", "SMPLify's spheres")]
    )
    assert (costs.max(axis=0) / costs.min(axis=0) < 1.03).sum() == 9
    assert costs.shape[1] == 10


def test_the_hinge_keeps_limbs_apart_on_the_mesh_and_spheres_do_not() -> None:
    for way in ("hinge", "hinge, Levenberg-Marquardt", "hinge, sigma 0.1 mm"):
        assert of(way, "depth").mean() < 1
        assert of(way, "depth").max() < 10
    assert of("SMPLify's spheres", "depth").mean() > 15
    assert of("nothing", "depth").mean() > 40


def test_capsules_miss_no_penetration() -> None:
    for each in FOUND["alarms"].values():
        k = counted(each["rows"])
        assert k["deep"] > 90
        assert k["missed"] == 0
        assert k["false"] <= 0.5 * k["alarms"]
    assert max(each["draws"] for each in FOUND["capsules"].values()) < 9.5
