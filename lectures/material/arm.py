"""An arm that is dragged, and the step of its linear model by damping, radius and gain."""

from pathlib import Path

from workbench.arrays import Array
from workbench.reports.replays import ReplayPage, flat_page
from workbench.solvers.levenberg_marquardt import FASTEST_FALL

SCRIPT = Path(__file__).with_suffix(".js")
CAPTION = (
    "Drag the wrist, the star, or the step along its curve, and change the damping. The blue dots lead to where "
    "the linear model expects the wrist. Beside the arm: lines of equal cost (grey) and of the linear model's cost "
    "(blue, dotted) at the same levels, the step of each damping, the dogleg, Gauss-Newton's step (the star), and "
    "the circle of the radius that belongs to the damping."
)


def arm_page(
    upper: float,
    lower: float,
    start: Array,
    in_reach: Array,
    beyond: Array,
    damping: float,
) -> ReplayPage:
    """The page of an arm of two bones, in m, that begins with the angles `start` (2,) in rad.

    `in_reach` and `beyond` are places (2,) in m for the star, which is in reach at first, and
    `damping` is the first one, in m^2/rad^2.
    """
    data = {
        "upper": upper,
        "lower": lower,
        "inReach": list(in_reach),
        "beyond": list(beyond),
        "opens": {"angles": list(start), "star": list(in_reach), "damping": damping},
        "slowest": FASTEST_FALL,
    }
    return flat_page(SCRIPT, data, CAPTION)
