"""The unit of a recording and the axis that points up in it, guessed and said in sentences."""

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadFile, check_known, joined
from workbench.geometry.guesses import UP_TO_Y

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
OTHERS = {"in": 0.0254, "cmu": 0.0254 / 0.45}  # taken if they are given
BODY = (0.5, 3.0)  # m, how far the points of one frame reach, from one end to the other
LIKELY = (0.05, 10.0)  # m, in the unit that a file declares: a hand, several people
CMU = (20.0, 50.0)  # the same in the unit of the BVH conversions of CMU's recordings, 1 in / 0.45
ZUP = 1.2  # how much longer a standing person is along the height than along the other sides
FRAMES = 400  # that are looked at


def check_given(unit: str | None, up: str | None) -> None:
    """Raise UnknownName for a unit or an axis that does not exist."""
    if unit is not None:
        check_known("unit", unit, UNITS | OTHERS)
    if up is not None:
        check_known("axis", up.removeprefix("+"), UP_TO_Y)


def reach(places: Array) -> Array:
    """The extent (3,) of the points (T, M, 3) of a usual frame, along each axis. Raises BadFile."""
    some = places[:: max(1, len(places) // FRAMES)]
    there = some[np.isfinite(some).all(axis=2).sum(axis=1) > 1]
    if not len(there):
        there = places[np.isfinite(places).all(axis=2).sum(axis=1) > 1]
    if not len(there):
        raise BadFile("no frame shows two markers")
    return np.asarray(np.median(np.nanmax(there, axis=1) - np.nanmin(there, axis=1), axis=0))


def unit_of(
    places: Array, given: str | None, declared: str | None = None, what: str = "markers"
) -> tuple[float, str]:
    """Metres in the unit of points (T, M, 3), and why: what was given, what the file says, a guess.

    A unit that the file says is not taken if no body has this size in it. Raises BadFile for points
    that are no body's in any unit.
    """
    known = UNITS | OTHERS
    if given is not None:
        return known[given], f"the unit {given} was given"
    size, instead = float(np.linalg.norm(reach(places))), ""
    if declared is not None and declared in known:
        declared_size = size * known[declared]
        if LIKELY[0] <= declared_size <= LIKELY[1]:
            return known[declared], f"the unit is {declared}, as the file says"
        instead = (
            f"; the file says {declared}, in which they would reach {declared_size:,.4g} m, as no "
            "body does"
        )
    for name, metres in UNITS.items():
        if BODY[0] <= size * metres <= BODY[1]:
            return metres, (
                f"the unit is taken to be {name}, in which the {what} of a frame reach "
                f"{size * metres:.2f} m{instead}"
            )
    if what != "markers" and CMU[0] <= size <= CMU[1]:
        metres = OTHERS["cmu"]
        return metres, (
            f"the unit is taken to be cmu, {metres:.5f} m, as in BVH conversions of CMU's "
            f"recordings; in it the {what} of a frame reach {size * metres:.2f} m{instead}"
        )
    raise BadFile(
        f"the {what} of a frame reach {size:.3g}, which is no body in {joined([*UNITS])}{instead}; "
        f"give the unit ({', '.join(known)}), or scale them"
    )


def up_of(places: Array, given: str | None, what: str = "markers") -> tuple[str, str]:
    """The axis that points up, and why. It is y, unless a usual frame is longest along z."""
    if given is not None:
        axis = given.removeprefix("+")
        return axis, f"the axis {axis} was given as up"
    sides = reach(places)
    if sides[2] > ZUP * sides[:2].max():
        return "z", f"z is taken to be up, along which the {what} reach {sides[2]:.2f} m"
    sure = "" if sides[1] > ZUP * sides[[0, 2]].max() else ", which their form does not tell"
    return "y", f"y is taken to be up{sure}"
