"""Units and axes are guessed by one rule for scans, markers and joints."""

from pathlib import Path

import numpy as np
import pytest

from workbench import load_body
from workbench.arrays import Array
from workbench.errors import BadFile, UnknownName
from workbench.fitting import read_scan
from workbench.fitting.marker_files import read_markers
from workbench.geometry.guesses import (
    HAND,
    PERSON,
    UNITS,
    UP_TO_Y,
    rate_of,
    sizes_of,
    unit_of,
    up_of,
)
from workbench.geometry.solids import random_surface_points

BODY, SPREAD, ONE_HAND = load_body("default"), load_body("full-hands"), load_body("hand")
LENGTHS = pytest.mark.parametrize("unit", ["m", "cm", "mm", "in"])


def test_declared_unit_that_makes_no_body_is_doubted() -> None:
    for declared, size, taken in [("m", 1661.0, "mm"), ("mm", 1.7, "m")]:
        unit, why = unit_of(size, None, declared)
        assert unit == taken
        assert f"the file says {declared}, in which" in why
        assert "as no body is" in why


def test_given_unit_wins_over_the_declared_one() -> None:
    assert unit_of(16.61, "m", "cm")[0] == "m"


def test_size_of_no_body_is_refused() -> None:
    with pytest.raises(BadFile, match="the file says m"):
        unit_of(1e6, None, "m")
    with pytest.raises(BadFile, match="in m the scan is 1e"):
        unit_of(1e6, "m")
    with pytest.raises(UnknownName, match="no unit is called 'ell'"):
        unit_of(1.7, "ell")


def test_unit_is_the_one_in_which_the_size_is_usual() -> None:
    for sizes, metres in ((PERSON, 1.35), (PERSON, 1.75), (PERSON, 2.15), (HAND, 0.18)):
        for unit in ("m", "cm", "mm", "in"):
            assert unit_of(metres / UNITS[unit], sizes=sizes)[0] == unit
    assert unit_of(1.75 / UNITS["cmu"], units=tuple(UNITS))[0] == "cmu"
    assert unit_of(70, sizes=PERSON)[0] == "in"
    for unit in ("m", "cm"):  # a child, or a person who sits
        assert unit_of(0.95 / UNITS[unit])[0] == unit


@LENGTHS
def test_hand_has_the_unit_that_it_was_saved_in(unit: str, tmp_path: Path) -> None:
    scale, sizes = 1 / UNITS[unit], sizes_of(ONE_HAND.joint_names)
    points, _ = random_surface_points(
        ONE_HAND.vertices(), ONE_HAND.faces, 2000, np.random.default_rng(0)
    )
    np.save(tmp_path / "hand.npy", scale * points)
    assert read_scan(tmp_path / "hand.npy", sizes=sizes).unit == unit
    joints = np.tile(ONE_HAND.joints(), (3, 1, 1))
    labels = np.array(ONE_HAND.joint_names)
    np.savez(tmp_path / "hand.npz", markers=scale * joints, labels=labels, fps=10.0)
    there = read_markers(tmp_path / "hand.npz").markers
    np.testing.assert_allclose(np.ptp(there, axis=1), np.ptp(joints, axis=1), atol=1e-9)


def t_pose(kind: str) -> tuple[Array, tuple[str, ...]]:
    """Points (M, 3) m of a body whose arms are stretched to the sides, and their names."""
    if kind == "surface":
        return BODY.vertices(), ()
    if kind == "joints without names":
        return np.tile(BODY.joints(), (2, 1, 1)), ()
    body = SPREAD if kind == "joints with fingers" else BODY
    return np.tile(body.joints(), (2, 1, 1)), body.joint_names


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize(
    "kind", ["surface", "joints", "joints without names", "joints with fingers"]
)
def test_t_pose_stands_along_its_height(kind: str, up: str) -> None:
    points, names = t_pose(kind)
    assert up_of(points @ UP_TO_Y[up], names=names)[0] == up


def test_bending_person_has_y_up() -> None:
    """Where joints without names spread a little farther along z than along y."""
    pose = np.zeros((24, 3))
    for side, turn in (("left", -1.3), ("right", 1.3)):  # arms down
        pose[BODY.joint_names.index(f"{side}_shoulder"), 2] = turn
    pose[0, 0] = np.radians(50)
    joints = np.tile(BODY.joints(pose), (2, 1, 1))
    assert joints[0].std(axis=0).argmax() == 2
    assert up_of(joints)[0] == "y"


def test_names_tell_that_y_points_down_as_in_a_camera() -> None:
    points, names = t_pose("joints")
    assert up_of(points @ UP_TO_Y["-y"], names=names)[0] == "-y"


@pytest.mark.parametrize(
    ("given", "declared", "usual", "rate", "said"),
    [
        (25.0, [0.0, 3.0], None, 25.0, ""),
        (None, [59.94, 59.94], None, 59.94, ""),
        (None, [], None, 30.0, "30 frames a second are taken"),
        (None, [], 60.0, 60.0, "60 frames a second as its kind has"),
        (None, [1 / 30], None, 1 / 30, "0.0333333 frames a second are unusual"),
    ],
)
def test_rate_is_given_declared_or_usual(
    given: float | None, declared: list[float], usual: float | None, rate: float, said: str
) -> None:
    found, notes = rate_of(given, declared, usual)
    assert found == rate
    assert len(notes) == bool(said)
    assert said in " ".join(notes)


def test_lying_person_leaves_y_up() -> None:
    points, names = t_pose("joints")
    assert up_of(points @ UP_TO_Y["x"], names=names)[0] == "y"
    assert up_of(points @ UP_TO_Y["x"], "+x", names=names) == ("x", "the axis x was given as up")
