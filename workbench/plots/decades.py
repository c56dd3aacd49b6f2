"""Logarithmic axes with plain letters: setting mathematics takes most of the time of a figure."""

import math

from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
FEW = 1.5  # decades: below, numbers between the powers of ten are written too


def power(value: float) -> str:
    """`10⁻⁵`, and `1`, `10`, `0.1`, `200` where that is short."""
    exponent = round(math.log10(value)) if value > 0 else 0
    if -2 <= exponent <= 3 or not math.isclose(value, 10.0**exponent):
        return f"{value:g}"
    return "10" + str(exponent).translate(RAISED)


def decades(axis: Axis, low: float, high: float) -> None:
    """Ticks for a logarithmic axis that shows low to high."""
    wide = math.log10(high / low) if low > 0 else 1.0
    subs = (1.0,) if wide > FEW else (1.0, 2.0, 5.0)
    axis.set_major_locator(LogLocator(subs=subs, numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power(value)))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
