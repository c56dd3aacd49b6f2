"""In which unit points are and which axis points up, guessed from a body, said in a sentence.

Points are those of a scan, markers or joints: (C, 3), or (T, M, 3) for T frames, with NaN where
one was not seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadFile, UnknownName, check_known, listed

# rotations that take the axis to y; what faces -y when z is up faces z
UP_TO_Y: dict[str, Array] = {
    "y": np.eye(3),
    "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "x": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "-y": np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]),
    "-z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "-x": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}


class Units(dict[str, float]):
    """Units in m by their names; a number, such as "0.3048", is a unit of so many m.

    Raises UnknownName for what is neither.
    """

    def __missing__(self, unit: str) -> float:
        try:
            metres = float(unit)
        except ValueError:
            metres = np.nan
        if not 0 < metres < np.inf:
            raise UnknownName("unit", unit, self, hint="or a number of metres")
        return metres


UNITS = Units({"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "cmu": 0.0254 / 0.45})
METRIC_UNITS = ("m", "cm", "mm")
USUAL_UNITS = (*METRIC_UNITS, "in")  # cmu is that of the BVH conversions of CMU's recordings
POSSIBLE_SIZE = (0.005, 100.0)  # m, in a unit that was given
UNSURE_UNIT = ": no standing person, so that this is uncertain; give the unit if it is wrong"

USUAL_RATE, PLAUSIBLE_RATES = 30.0, (4.0, 2000.0)  # frames a second
MOST_FRAMES = 400  # that are looked at
EXTENT_PERCENTILES = (0.2, 99.8)  # percentiles of points, between which an extent is measured
STANDING = (1.0, 2.3)  # m, from the floor to the head
CLEARLY_LONGER = 1.3  # times as tall as the thinnest side, or as another one, is clearly
END_SHARE = 0.06  # of the height: the feet at one end, the head at the other
FLOOR_SHARE = 0.1  # of the height, at either end
MEAN_COUNTS, FEET_COUNT = 11.0, 0.5  # what the two signs of a head count
CLEAR_SIGN = 0.2  # of their sum
# Of 160 simulated scans of poses from motion capture, by one camera and by four, 2 % would be
# turned over wrongly and 88 % rightly; with a floor, a crate and loose points 1 % and 79 %; and
# nearly all of these wrongly if FLOOR_SHARE were 0.
HEAD = ("head", "lfhd", "rfhd", "lbhd", "rbhd")
FEET = ("foot", "toe", "ankle", "heel", "lank", "rank", "lhee", "rhee", "lmt5", "rmt5")


@dataclass(frozen=True)
class Sizes:
    """How long something is from one end to the other.

    Attributes:
        name: what it is.
        usual: m, between which it is nearly always.
        others: wider ranges in m, which are looked at in turn when no unit makes it as usual.
    """

    name: str
    usual: tuple[float, float]
    others: tuple[tuple[float, float], ...]


PERSON = Sizes("a person", (1.3, 2.2), ((0.5, 3.0), (0.05, 10.0)))
"""In which unit a person is 1.3 to 2.2 m long is never undecided between m, cm, mm and in."""
HAND = Sizes("a hand", (0.1, 0.25), ((0.05, 0.6),))


def sizes_of(names: Sequence[str]) -> Sizes:
    """How large something with these joints or markers is: a hand alone, or a person."""
    plain = [name.lower() for name in names]
    person = any(word in name for name in plain for word in (*HEAD, *FEET, "pelvis", "hip"))
    return HAND if not person and any("thumb" in name for name in plain) else PERSON


def check_given(unit: str | None, up: str | None) -> None:
    """Raise UnknownName for a unit or an axis that does not exist."""
    if unit is not None:
        UNITS[unit]
    if up is not None:
        check_known("axis", up.removeprefix("+"), UP_TO_Y)


def extents(points: Array) -> Array:
    """How far the points of a usual frame extend along each axis, (3,). Raises BadFile."""
    low, high = np.nanpercentile(_shown_frames(points), EXTENT_PERCENTILES, axis=1)
    return np.asarray(np.median(high - low, axis=0))


def unit_of(
    size: float,
    given: str | None = None,
    declared: str | None = None,
    *,
    sizes: Sizes = PERSON,
    units: Sequence[str] = USUAL_UNITS,
    what: str = "the scan is {} long",
) -> tuple[str, str]:
    """The unit in which something is `size` long, and a sentence on why; `given` wins.

    `declared` is the unit that the file or its format states, which is believed if this is a size
    of the kind; else, or without one, it is the first of `units` in which the size is usual, or the
    first of m, cm and mm in which it is in a wider range of `sizes`. Raises UnknownName, and
    BadFile for a size that is none in any unit.
    """
    check_given(given, None)
    if given is not None:
        name = given if given in UNITS else f"{given} m"
        long = what.format(f"{size * UNITS[given]:.3g} m")
        if not POSSIBLE_SIZE[0] <= size * UNITS[given] <= POSSIBLE_SIZE[1]:
            raise BadFile(f"in {name} {long}, and no body is; units are {listed(UNITS)}")
        return given, f"the unit {name} was given; {long}"
    ranges, instead = (sizes.usual, *sizes.others), ""
    if declared is not None and declared in UNITS:
        if ranges[-1][0] <= size * UNITS[declared] <= ranges[-1][1]:
            return declared, f"the unit is {declared}, as the file says"
        long = what.format(f"{size * UNITS[declared]:,.4g} m")
        instead = f"; the file says {declared}, in which {long}, as no body is"
    for least, most in ranges:
        for unit in units if (least, most) == sizes.usual else METRIC_UNITS:
            if least <= size * UNITS[unit] <= most:
                why = f", as {sizes.name} is" if (least, most) == sizes.usual else UNSURE_UNIT
                long = what.format(f"{size * UNITS[unit]:.2f} m")
                return unit, f"the unit is taken to be {unit}, in which {long}{why}{instead}"
    raise BadFile(
        f"{what.format(f'{size:.3g}')}, in a unit that is not known: in none of {listed(units)} is "
        f"this the size of a body or of a part of one{instead}; give the unit, or scale it"
    )


def up_of(
    points: Array,
    given: str | None = None,
    declared: str | None = None,
    *,
    names: Sequence[str] = (),
    axes: str = "yz",
    what: str = "it",
) -> tuple[str, str]:
    """Which axis of points in m points up, and a sentence on why; `given` wins.

    `declared` is the axis that the file's format prescribes. Of points with `names` it is the one
    of `axes`, or -y as in cameras, along which the head is above the feet. The points of a standing
    person spread most along the height, with arms stretched to the sides as well: their standard
    deviations along `axes` are compared. The axis is positive, as most are, unless the form of a
    surface clearly says that the head is at its other end. For what is no standing person y is
    taken. Raises UnknownName.
    """
    check_given(None, given)
    if given is not None:
        axis = given.removeprefix("+")
        return axis, f"the axis {axis} was given as up"
    if declared is not None:
        return declared, f"{declared} is up, as the format prescribes"
    frames, sides = _shown_frames(points), extents(points)
    if (to_head := _to_head(frames, names)) is not None:
        k = int(np.argmax(np.abs(to_head)))
        axis = ("-" if to_head[k] < 0 else "") + "xyz"[k]
        if axis in (*axes, "-y") and abs(to_head[k]) > CLEARLY_LONGER * np.sort(np.abs(to_head))[1]:
            return axis, f"{axis} is taken to be up, along which the head is above the feet"
    spread = np.median(np.nanstd(frames, axis=1), axis=0)
    if points.ndim == 3:
        # a person who bends or lies down has y up, if nothing else is clear
        spread[1] *= CLEARLY_LONGER
    height = max(("xyz".index(axis) for axis in axes), key=lambda k: spread[k])
    tall = STANDING[0] <= sides[height] <= STANDING[1]
    if not (tall and sides[height] > CLEARLY_LONGER * sides.min()):
        return "y", (
            f"y is taken to be up, for {what} is not of the form of a standing person, which would "
            "tell; give the axis if it is another"
        )
    upright = _upright(points, height) if points.ndim == 2 else np.inf
    name = f"-{'xyz'[height]}" if upright < -CLEAR_SIGN else "xyz"[height]
    why = f"{name} is taken to be up: {what} is {sides[height]:.2f} m tall along it, as a person is"
    if abs(upright) <= CLEAR_SIGN:
        why += ", but which end is the head is not clear"
    return name, why


def rate_of(
    given: float | None, declared: Sequence[float], usual: float | None = None
) -> tuple[float, list[str]]:
    """Frames a second, and sentences on what is not sure; `given` wins over what a file declares.

    `usual` is the rate of all files of a kind that declare none. Raises BadFile for a file that
    declares several rates, or one that is none.
    """
    if given is not None:
        return given, []
    if any(not 1e-6 < rate < 1e6 or rate != declared[0] for rate in declared):
        raise BadFile(
            f"its rate is not one number of frames a second but {listed(map(str, declared))}"
        )
    if not declared and usual is not None:
        return usual, [
            f"it does not say its rate, and has {usual:g} frames a second as its kind has"
        ]
    if not declared:
        return USUAL_RATE, [
            f"it does not say its rate, and {USUAL_RATE:g} frames a second are taken, as videos "
            "have; give it if it is another (--rate)"
        ]
    rate = declared[0]
    if PLAUSIBLE_RATES[0] <= rate <= PLAUSIBLE_RATES[1]:
        return rate, []
    return rate, [f"{rate:g} frames a second are unusual; give the rate if it is another (--rate)"]


def _shown_frames(points: Array) -> Array:
    """Some of the frames (T, M, 3) that show two points or more. Raises BadFile."""
    frames = points if points.ndim == 3 else points[None]
    shown = frames[np.isfinite(frames).all(axis=2).sum(axis=1) > 1]
    if not len(shown):
        raise BadFile("no frame shows two points")
    return np.asarray(shown[:: max(1, len(shown) // MOST_FRAMES)])


def _to_head(frames: Array, names: Sequence[str]) -> Array | None:
    """The way (3,) from feet to head of a usual frame; None if the names do not tell them."""
    plain = [name.lower() for name in names]
    ends = []
    for words in (HEAD, FEET):
        columns = [i for i, name in enumerate(plain) if any(word in name for word in words)]
        places = frames[:, columns]
        if not columns or not np.isfinite(places).any(axis=(0, 1)).all():
            return None
        ends.append(np.nanmedian(places.reshape(len(frames), -1, 3), axis=(0, 1)))
    return np.asarray(ends[0] - ends[1])


def _upright(cells: Array, axis: int) -> float:
    """How clearly the head is at the end of an axis: above 0 if it is, below if the feet are.

    The mean of a person's surface lies above the middle, and two feet lie farther apart than the
    two sides of a head. A tenth of the height at either end does not count for the mean, so that a
    floor does not: it would make the end with the feet look like that with the head.
    """
    low, high = np.percentile(cells[:, axis], EXTENT_PERCENTILES)
    heights = (cells[:, axis] - low) / (high - low)
    across = np.delete(cells, axis, axis=1)
    feet, head = (
        np.sqrt(across[end].var(axis=0).sum()) if end.sum() > 3 else (high - low) / 50
        for end in (heights < END_SHARE, heights > 1 - END_SHARE)
    )
    body = heights[(heights > FLOOR_SHARE) & (heights < 1 - FLOOR_SHARE)]
    if not len(body):
        return 0.0
    return float(MEAN_COUNTS * (body.mean() - 0.5) + FEET_COUNT * np.log(feet / head))
