"""What lecture 7 says of its run."""

import numpy as np

from tests.lectures.prose import Run
from workbench.solvers.damped_length import LEAST, MOST
from workbench.solvers.trust_region import AHEAD, POOR, SLOW


def ended(run: Run, solver: str) -> tuple[int, int]:
    """How many of thirty starts end well in reach, and beyond."""
    found = run.line(f"{solver:20} in reach")
    return int(found[0]), int(found[3])


def last_steps(run: Run) -> np.ndarray:
    """How bent the arm is, the length asked for, and the share taken, of the last six steps."""
    rows = run["rows"][-6:]
    return np.array([(abs(np.sin(x[1])), np.linalg.norm(p), share) for x, p, share in rows])


def steps_with(run: Run, damping: str) -> tuple[float, float]:
    """The length of a damped step, rad, and its gain."""
    found = run.line(f"lambda = {damping:>5}: |p| =", "gain")
    return found[1], found[-1]


def by_unit(run: Run, name: str) -> np.ndarray:
    """Both entries of the step in radians, and the same with the elbow in degrees."""
    return np.array(run.line(name, "by degrees")[-4:]).reshape(2, 2)


SAYS = {
    "an upper arm of 0.30 m, a forearm of 0.25 m": lambda run: (run["UPPER"], run["LOWER"]),
    "So where the arm is straight ($b = 0$) it is singular": lambda run: (
        0,
        abs(np.linalg.det(run["jacobian"]([0.4, 0.0]))) < 1e-15,
    ),
    "We try Gauss-Newton from thirty starts": lambda run: len(run["starts"]),
    "Within reach, halving mends what full steps break.": lambda run: (
        ended(run, "gauss-newton-full")[0] < len(run["starts"]),
        ended(run, "gauss-newton")[0] == len(run["starts"]),
    ),
    "Beyond reach nothing helps: not one of thirty starts ends.": lambda run: (
        len(run["starts"]),
        ended(run, "gauss-newton-full")[1] == 0 and ended(run, "gauss-newton")[1] == 0,
    ),
    "watch those steps grow without end": lambda run: last_steps(run)[-1, 1] > 1000,
    "the model falls to zero, but the cost follows the model for a short way only": lambda run: (
        run.line("step  0:")[-2] > 1
    ),
    "the straighter the arm, the longer the steps that are asked for, and the less of them can be "
    "taken": lambda run: (
        bool((np.diff(last_steps(run)[:, 0]) < 0).all()),
        bool((np.diff(last_steps(run)[:, 1]) > 0).all()),
        bool((np.diff(last_steps(run)[:, 2]) < 0).all()),
    ),
    "The straighter the arm, the smaller the smallest singular value of $J$": lambda run: (
        np.linalg.svd(run["jacobian"](run["straight"]))[1][1]
        < np.linalg.svd(run["jacobian"](run["start"]))[1][1]
    ),
    "Every direction is shortened by its own share": lambda run: (
        run.line("lambda = 1e-05: p =")[-1]
        > run.line("lambda = 0.001: p =")[-1]
        > run.line("lambda =   0.1: p =")[-1]
        > run.line("lambda =    10: p =")[-1]
    ),
    "A gain near 1: the model can be trusted further, lower $\\lambda$. A gain below 0: the step goes "
    "uphill": lambda run: (
        1,
        0,
        abs(steps_with(run, "0.01")[1] - 1) < 0.2,
        steps_with(run, "1e-05")[1] < 0,
    ),
    "With each of these ways to a shorter step, all runs end.": lambda run: all(
        ended(run, name) == (30, 30) for name in ("levenberg-marquardt", "dogleg", "trust-region")
    ),
    "The same thirty starts, by all three": lambda run: len(run["starts"]),
    "enough if the length is right to a tenth": lambda run: (LEAST, MOST) == (0.9, 1.1),
    "The gain ratio now sets the radius. After a poor step it is halved": lambda run: POOR == 0.25,
    "Once a step lowers the cost by less than a tenth": lambda run: SLOW == 0.1,
    "looks a tenth of the next step ahead": lambda run: AHEAD == 0.1,
    "Grey: the cost, and four radii": lambda run: len(run["radii"]) == 4,
    "the dogleg does the same in two straight legs": lambda run: all(
        line[-1] > 0.98 for line in run.lines("the dogleg keeps")
    ),
    "its steps would look 57 times longer": lambda run: float(run["unit"][1]),
    "then units cancel": lambda run: (
        np.allclose(*by_unit(run, "Marquardt, D")),
        not np.allclose(*by_unit(run, "Levenberg, D"), atol=0.01),
    ),
    "the workbench's default is $D = I$, and `levenberg-marquardt-columns` is the other": lambda run: (
        "levenberg-marquardt-columns" in run["wb"].SOLVERS
    ),
}

GIVEN = ("after each failure by 2, 4, 8, ...",)
