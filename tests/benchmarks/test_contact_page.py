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
    apart = abs(of("hinge, sigma 0.1 mm", "cost") / of(way, "cost") - 1)
    assert apart.max() < 0.01
    assert (apart < 2.5e-4).sum() == (8 if way.startswith("IPOPT") else 10)
    assert abs(of("hinge", "cost") / of("hinge, sigma 0.1 mm", "cost") - 1).max() < 0.0125


def test_all_ways_agree_but_for_sqp_in_two_poses() -> None:
    ways = [way for way in WAYS if way not in ("nothing", "SMPLify's spheres")]
    costs = np.array([of(way, "cost") for way in ways])
    others = costs[[way != "SQP" for way in ways]]
    assert costs.shape[1] == 10
    assert (others.max(axis=0) / others.min(axis=0)).max() < 1.02
    higher = of("SQP", "cost") / of("hinge, sigma 0.1 mm", "cost") - 1
    assert np.round(100 * np.sort(higher)[-3:]).tolist() == [0, 3, 18]


def test_the_hinge_keeps_limbs_apart_on_the_mesh_and_spheres_do_not() -> None:
    for way in ("hinge", "hinge, Levenberg-Marquardt", "hinge, sigma 0.1 mm"):
        assert of(way, "depth").mean() < 1
        assert of(way, "depth").max() < 10
    assert of("SMPLify's spheres", "depth").mean() > 10
    assert of("nothing", "depth").mean() > 40


def test_capsules_miss_what_the_page_tells() -> None:
    counts = {name: counted(each["rows"]) for name, each in FOUND["alarms"].items()}
    deep, missed = (sum(k[what] for k in counts.values()) for what in ("deep", "missed"))
    assert f"{missed} of {deep} deep penetrations are missed" in TEXT
    assert missed <= 0.02 * deep
    assert all(k["false"] <= 0.5 * k["alarms"] for k in counts.values())
    assert max(each["draws"] for each in FOUND["capsules"].values()) < 9.5
