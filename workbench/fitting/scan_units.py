"""In which unit a scan is, guessed from its size as that of a person, and said in a sentence."""

from workbench.arrays import Array
from workbench.errors import check_known, listed
from workbench.fitting.scans.scan import BadScan
from workbench.fitting.scans.surface import extents, principal_axes

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}  # in m
PERSON = (1.3, 2.2)  # m, how long a person is from one end to the other
LIKELY = (0.05, 10.0)  # m: a hand, a part of a body, an animal, a person with arms stretched
POSSIBLE = (0.02, 30.0)  # m, in a unit that was given


def unit_of(cells: Array, given: str | None, declared: str | None = None) -> tuple[str, str]:
    """The unit of an outline (C, 3), and a sentence on why; `given` wins.

    `declared` is the unit of the file's format, which is believed if the size is likely then.
    The size is the largest extent along a principal axis, so that it does not depend on how the
    scan is turned. In which unit a person is 1.3 to 2.2 m long is never undecided; what has
    another size is in metres if that is likely.

    Raises UnknownName, and BadScan for a size that no unit makes that of a body.
    """
    size = float(extents(cells, principal_axes(cells)).max())
    lengths = {unit: size * metres for unit, metres in UNITS.items()}
    if given is not None:
        check_known("unit", given, UNITS)
        long = lengths[given]
        if not POSSIBLE[0] <= long <= POSSIBLE[1]:
            raise BadScan(
                f"in {given} the scan is {long:.3g} m long, and no body is; "
                f"units are {listed(UNITS)}"
            )
        return given, f"the unit {given} was given; the scan is {long:.2f} m long"
    if declared is not None and LIKELY[0] <= lengths[declared] <= LIKELY[1]:
        long = lengths[declared]
        return (
            declared,
            f"the unit {declared} is that of the format; the scan is {long:.2f} m long",
        )
    for (least, most), said in (
        (PERSON, ", as a person is"),
        (
            LIKELY,
            ": no standing person, so that this is uncertain; give the unit if it is wrong",
        ),
    ):
        for unit, long in lengths.items():  # in the order of how usual they are
            if least <= long <= most:
                return unit, (
                    f"the unit is taken to be {unit}, in which the scan is {long:.2f} m long{said}"
                )
    raise BadScan(
        f"the scan is {size:.3g} long, in a unit that is not known: in none of {listed(UNITS)} is "
        "this the size of a body or of a part of one; give the unit, or scale the scan"
    )
