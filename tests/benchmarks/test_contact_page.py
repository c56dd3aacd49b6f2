"""The section on self-contact is what its numbers say."""

import json

import numpy as np
import pytest

from benchmarks.images.contact import (
    BEGIN,
    END,
    FITS,
    FRESH,
    HINGED,
    PAGE,
    RESULTS,
    WAYS,
    counted,
    tables,
)

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
    assert (apart < 3e-4).sum() == 9
    assert abs(of("hinge", "cost") / of("hinge, sigma 0.1 mm", "cost") - 1).max() < 0.0095


def test_all_ways_agree_but_in_three_poses_with_several_minima() -> None:
    ways = [way for way in WAYS if way not in ("nothing", "SMPLify's spheres")]
    costs = np.array([of(way, "cost") for way in ways])
    assert costs.shape[1] == 10
    several = np.array([0, 2, 9])
    ratios = costs / of("hinge, sigma 0.1 mm", "cost")
    assert (costs.max(axis=0) / costs.min(axis=0))[several].min() > 1.2
    assert not of("SQP", "converged")[several].any()
    by_damping = ratios[ways.index("hinge, Levenberg-Marquardt")]
    assert f"{by_damping.max():.2f} times the cost" in " ".join(TEXT.split())
    assert (by_damping > 1.05).sum() == 1
    assert abs(np.delete(ratios, several, axis=1) - 1).max() < 0.015


def test_the_hinge_keeps_limbs_apart_on_the_mesh_and_spheres_do_not() -> None:
    for way in ("hinge", "hinge, Levenberg-Marquardt", "hinge, sigma 0.1 mm"):
        assert of(way, "depth").max() < 10
        assert of(way, "depth").mean() < 1
    assert of("SMPLify's spheres", "depth").mean() > 10
    assert of("nothing", "depth").mean() > 40


def test_more_poses_say_more_than_ten() -> None:
    text = " ".join(TEXT.split())
    many, fresh = (np.array(FOUND[p]["hinge"]["depth"]) for p in ("hinged, seed 700", "hinged"))
    few = of("hinge", "depth")
    assert f"mean depth of {few.mean():.1f} mm and a largest of {few.max():.1f} mm" in text
    assert len(many) == len(fresh) == HINGED
    assert f"In {HINGED} other poses of the same seed the mean is {many.mean():.1f} mm" in text
    assert f"and {(many > 10).sum()} are more than 10 mm deep" in text
    assert f"deepest has fingers {many.max():.1f} mm in the neck" in text
    assert f"seed ({FRESH}) that was not looked at" in text
    assert f"there the mean is {fresh.mean():.1f} mm, and {(fresh > 10).sum()} is more" in text
    assert f"hand that is {fresh.max():.1f} mm in the thigh" in text


def test_the_dogleg_is_quicker_than_damping() -> None:
    text = " ".join(TEXT.split())
    damped, dogleg = (FOUND["hinged"][name] for name in ("hinge", "hinge, dogleg"))
    first, second = np.array(damped["seconds"]), np.array(dogleg["seconds"])
    assert (
        f"takes {np.median(first):.2f} s in the median and {first.mean():.2f} s in the mean with "
        f"the default solver, and {np.median(second):.2f} s and {second.mean():.2f} s with" in text
    )
    assert second.mean() < 0.15 < first.mean()
    ratio = np.array(dogleg["own"]) / np.array(damped["own"])
    apart = abs(ratio - 1) > 0.01
    assert f"less than 1 % but in {apart.sum()} pose, in which the dogleg's is" in text
    assert f"is {100 * (1 - ratio[apart][0]):.0f} % lower" in text
    ten = np.sort(of("hinge", "seconds"))
    assert f"one took {ten[-1]:.1f} s, and the other nine {ten[:-1].mean():.2f} s in the" in text


def test_the_shape_space_limits_the_capsules_of_small() -> None:
    text = " ".join(TEXT.split())
    small, default = (FOUND["capsules"][name] for name in ("small", "default"))
    assert default["others"] < 9.5 < small["others"]
    assert f"capsules of `small` are {small['nearest']:.1f} mm away" in text
    assert f"and those of `default` {default['nearest']:.1f} mm" in text


def test_capsules_miss_what_the_page_tells() -> None:
    counts = {name: counted(each["rows"]) for name, each in FOUND["alarms"].items()}
    told = []
    for body in ("default", "full"):
        each = [k for name, k in counts.items() if name.startswith(f"`{body}`")]
        told.append([sum(k[what] for k in each) for what in ("missed", "deep")])
        assert told[-1][0] <= 0.025 * told[-1][1]
    (a, b), (c, d) = told
    text = " ".join(TEXT.split())
    assert f"{a} of {b} deep penetrations of `default` are missed, and {c} of {d} of `full`" in text
    assert not any(k["missed beside, too"] for k in counts.values())
    assert f"tell of all {a + c} cases" in text
    assert all(k["false"] <= 0.47 * k["alarms"] for k in counts.values())
    assert FOUND["capsules"]["default"]["others"] < 9.5
    assert FOUND["linearizations"]["hinge"] < 1.7  # what 30 capsules with 228 pairs took
