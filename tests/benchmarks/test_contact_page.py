"""The section on self-contact is what its numbers say."""

import json
from functools import partial

import numpy as np
import pytest

from benchmarks.images.contact import (
    BEGIN,
    DEEP,
    END,
    FITS,
    FRESH,
    HINGED,
    LEAST,
    MOST,
    NOISE,
    PAGE,
    POSES,
    RESULTS,
    SEED,
    SLACK,
    WAYS,
    counted,
    tables,
)
from tests.benchmarks.prose import Prose, unheld
from workbench import load_body
from workbench.bodies import SkinnedBody
from workbench.bodies.penetrations import FOLDS
from workbench.geometry.solids import mesh_edges
from workbench.reading.archive import shipped
from workbench.reading.expected import read_expected, reals

FOUND = json.loads(RESULTS.read_text())
AFTER = "SQP after the hinge", "IPOPT after the hinge"
TEXT = Prose(PAGE, "Bodies that are kept out of themselves")


def of(way: str, key: str) -> np.ndarray:
    """A number of every fit of a way."""
    return np.array(FOUND["fits"][way][key])


def test_the_tables_are_written_from_the_numbers() -> None:
    assert PAGE.read_text().partition(BEGIN)[2].partition(END)[0].strip() == tables(FOUND).strip()


def test_every_way_fitted_the_same_poses() -> None:
    assert list(FOUND["fits"]) == list(WAYS)
    assert {len(values) for each in FOUND["fits"].values() for values in each.values()} == {FITS}


@pytest.mark.parametrize("way", AFTER)
def test_the_hinge_with_a_small_sigma_and_the_limit_agree_from_one_start(way: str) -> None:
    apart = abs(of("hinge, sigma 0.1 mm", "cost") / of(way, "cost") - 1)
    assert apart.max() < 0.01
    assert (apart < 3e-4).sum() == 9
    assert "to 1 % in all poses, and for each of the two to 0.03 % in nine poses" in TEXT
    low = (1 - of("hinge", "cost") / of("hinge, sigma 0.1 mm", "cost")).max()
    assert low < 0.0095
    told = f"sigma {1e3 * SLACK:g} mm ends at a cost that is at most {100 * low:.1f} % too low"
    assert told in TEXT
    assert f"With sigma {1e2 * SLACK:g} mm it ends at the cost of IPOPT and SQP" in TEXT


def test_all_ways_agree_but_in_three_poses_with_several_minima() -> None:
    ways = [way for way in WAYS if way not in ("nothing", "SMPLify's spheres")]
    costs = np.array([of(way, "cost") for way in ways])
    assert costs.shape[1] == 10
    several = np.array([0, 2, 9])
    ratios = costs / of("hinge, sigma 0.1 mm", "cost")
    assert (costs.max(axis=0) / costs.min(axis=0))[several].min() > 1.2
    assert "reach costs that differ by a factor of 1.2 or more" in TEXT
    assert not of("SQP", "converged")[several].any()
    by_damping = ratios[ways.index("hinge, Levenberg-Marquardt")]
    assert f"{by_damping.max():.2f} times the cost" in TEXT
    assert (by_damping > 1.05).sum() == 1
    assert abs(np.delete(ratios, several, axis=1) - 1).max() < 0.015
    assert "In the other seven all fits agree to 1.5 %" in TEXT


def test_the_hinge_keeps_limbs_apart_on_the_mesh_and_spheres_do_not() -> None:
    for way in ("hinge", "hinge, Levenberg-Marquardt", "hinge, sigma 0.1 mm"):
        assert of(way, "depth").max() < 10
        assert of(way, "depth").mean() < 1
    assert of("SMPLify's spheres", "depth").mean() > 10
    assert of("nothing", "depth").mean() > 40


def test_more_poses_say_more_than_ten() -> None:
    many, fresh = (np.array(FOUND[p]["hinge"]["depth"]) for p in ("hinged, seed 700", "hinged"))
    few = of("hinge", "depth")
    assert few.mean() < 1
    assert few.max() < 10
    assert len(few) == 10
    assert "With the hinge, the ten poses keep" in TEXT
    assert "so that the wanted 1 mm and 10 mm are reached. Ten poses say little." in TEXT
    assert f"The second table is of {HINGED} poses of a seed" in TEXT
    assert f"mean depth of {few.mean():.1f} mm and a largest of {few.max():.1f} mm" in TEXT
    assert len(many) == len(fresh) == HINGED
    assert f"In {HINGED} other poses of the same seed the mean is {many.mean():.1f} mm" in TEXT
    assert f"and {(many > 10).sum()} are more than 10 mm deep" in TEXT
    assert f"deepest has fingers {many.max():.1f} mm in the neck" in TEXT
    assert f"seed ({FRESH}) that was not looked at" in TEXT
    assert f"there the mean is {fresh.mean():.1f} mm, and {(fresh > 10).sum()} is more" in TEXT
    assert "is more than 10 mm deep, a hand" in TEXT
    assert f"hand that is {fresh.max():.1f} mm in the thigh" in TEXT


def test_the_dogleg_is_quicker_than_damping() -> None:
    damped, dogleg = (FOUND["hinged"][name] for name in ("hinge", "hinge, dogleg"))
    first, second = np.array(damped["seconds"]), np.array(dogleg["seconds"])
    assert f"On the {len(first)} poses of seed {FRESH} the hinge takes" in TEXT
    assert (
        f"takes {np.median(first):.2f} s in the median and {first.mean():.2f} s in the mean with "
        f"the default solver, and {np.median(second):.2f} s and {second.mean():.2f} s with" in TEXT
    )
    assert second.mean() < 0.15 < first.mean()
    assert "so that the wanted 0.15 s are reached with the dogleg" in TEXT
    ratio = np.array(dogleg["own"]) / np.array(damped["own"])
    apart = abs(ratio - 1) > 0.01
    assert f"less than 1 % but in {apart.sum()} pose, in which the dogleg's is" in TEXT
    assert f"is {100 * (1 - ratio[apart][0]):.0f} % lower" in TEXT
    ten = np.sort(of("hinge", "seconds"))
    assert "Of the ten poses of the first table, one took" in TEXT
    assert f"one took {ten[-1]:.1f} s, and the other nine {ten[:-1].mean():.2f} s in the" in TEXT


def test_the_shape_space_limits_the_capsules_of_small() -> None:
    small, default = (FOUND["capsules"][name] for name in ("small", "default"))
    assert default["others"] < 9.5 < small["others"]
    assert "The wanted 9.5 mm are reached by `default` and not by `small`" in TEXT
    assert f"capsules of `small` are {small['nearest']:.1f} mm away" in TEXT
    assert f"and those of `default` {default['nearest']:.1f} mm" in TEXT
    far = {name: far_from_its_space(name) for name in ("small", "default")}
    assert f"these people are {far['small']:.1f} mm (root mean square, in space) from" in TEXT
    assert f"body of `small`, and {far['default']:.1f} mm from that of `default`" in TEXT


def far_from_its_space(name: str) -> float:
    """How far the held-out people are from the nearest bodies of a shape space, mm rms."""
    body = load_body(name)
    assert isinstance(body, SkinnedBody)
    with shipped("bodies/held_out_people.npz", "file of held-out people") as archive:
        wanted = {name: reals("people", body.n_vertices, 3)}
        people = read_expected(archive, wanted)[name]
    flat = (people - body.template).reshape(len(people), -1).T
    directions = body.shapedirs.reshape(-1, body.n_betas)
    left = flat - directions @ np.linalg.lstsq(directions, flat, rcond=None)[0]
    return float(1e3 * np.sqrt(3 * np.mean(left**2)))


def test_capsules_miss_what_the_page_tells() -> None:
    counts = {name: counted(each["rows"]) for name, each in FOUND["alarms"].items()}
    told = []
    for body in ("default", "full"):
        each = [k for name, k in counts.items() if name.startswith(f"`{body}`")]
        told.append([sum(k[what] for k in each) for what in ("missed", "deep")])
        assert told[-1][0] <= 0.025 * told[-1][1]
    (a, b), (c, d) = told
    assert f"{a} of {b} deep penetrations of `default` are missed, and {c} of {d} of `full`" in TEXT
    assert not any(k["missed beside, too"] for k in counts.values())
    assert f"tell of all {a + c} cases" in TEXT
    assert all(k["false"] <= 0.47 * k["alarms"] for k in counts.values())
    assert FOUND["capsules"]["default"]["others"] < 9.5
    assert FOUND["linearizations"]["hinge"] < 1.7  # what 30 capsules with 228 pairs took


def test_what_is_said_of_poses_and_capsules_is_what_the_code_has() -> None:
    body = load_body("default")
    assert isinstance(body, SkinnedBody)
    elbow = body.joint_names.index("left_elbow")
    edges = mesh_edges(body.faces)
    forearm = edges[(body.weights.argmax(axis=1)[edges] == elbow).all(axis=1)]
    long = np.linalg.norm(np.subtract(*body.template[forearm.T]), axis=-1).max()
    for told in (
        f"to its {body.n_joints} joints, each coordinate with {1e3 * NOISE:g} mm of noise",
        f"the body penetrates itself by {1e3 * LEAST:g} to {1e3 * MOST:g} mm",
        f"sigma, the slack, is {1e3 * SLACK:g} mm if nothing else is said",
        f"and *hinge, sigma {1e2 * SLACK:g} mm* begin where the hinge ended",
        f"The poses of the first table are of a seed ({SEED})",
        f"A penetration is called deep from {1e3 * DEEP:g} mm on",
        f"a triangle of the forearm is up to {1e2 * long:.0f} cm long",
        f"whose three corners are all {1e2 * FOLDS:g} cm or more from it",
        f"({POSES} of the prior and {POSES} of the recording for each)",
    ):
        assert told in TEXT


def test_no_number_of_its_prose_is_held_by_nothing() -> None:
    tests = (
        partial(test_the_hinge_with_a_small_sigma_and_the_limit_agree_from_one_start, AFTER[0]),
        test_all_ways_agree_but_in_three_poses_with_several_minima,
        test_more_poses_say_more_than_ten,
        test_the_dogleg_is_quicker_than_damping,
        test_the_shape_space_limits_the_capsules_of_small,
        test_capsules_miss_what_the_page_tells,
        test_what_is_said_of_poses_and_capsules_is_what_the_code_has,
    )
    given = ("*drawn people* are 100 of the body's own shape space",)
    once = (
        "the cost then bends 8 times as much",
        "they take 907 steps",
        "The dogleg takes 69 steps to the same cost. It was chosen on 70 poses of the seeds 100 "
        "and 300, where it takes 0.12 s in the mean and at most 0.5 s, and the default 0.24 s and "
        "at most 6.9 s",
        "ends 1 % or more higher in 2 of the 70",
        "what is said of the 70 poses",
        "On 100 poses of seeds that were looked at (100, 300, 400 and 500) the mean depth was 1.25 "
        "mm with the former capsules and is 1.05 mm with the present ones. Four poses are above "
        "10 mm with either. Crossed calves, which were 10.8 mm",
        "no longer among them (7.2 mm). The largest depth rose from 12.3 to 19.0 mm",
        "their mean depth is 2.1 mm",
        "with 480 poses of the seeds 100, 300, 400 and 500",
        "There, 10 of 739 deep penetrations of `default` are missed, and capsules of the "
        "neighbouring part raise an alarm for all ten. With the former capsules 12 were missed",
        "If vertices outside of thighs counted 2.5 instead of 2 times, there would be 349 more "
        "false alarms in these 480 poses",
        "38 % of the sum of squares",
        "vertices there lie 8 mm outside",
        "and the 8 mm were measured once",
    )
    assert not unheld(TEXT, tests, given, once)
