"""What lecture 7 says of its run."""

import numpy as np

from tests.lectures.prose import Run
from workbench.solvers.trust_region import AHEAD, GOOD, LEAST, MOST, POOR, SLOW, next_radius


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
    "an upper arm of 0.30 m and a forearm of 0.25 m": lambda run: (run["UPPER"], run["LOWER"]),
    "So where the arm is straight ($b = 0$) the Jacobian is singular": lambda run: (
        0,
        abs(np.linalg.det(run["jacobian"]([0.4, 0.0]))) < 1e-15,
    ),
    "We try Gauss-Newton from thirty starts": lambda run: len(run["starts"]),
    "Within reach, halving mends what full steps break.": lambda run: (
        ended(run, "gauss-newton-full")[0] < len(run["starts"]),
        ended(run, "gauss-newton")[0] == len(run["starts"]),
    ),
    "Beyond reach nothing helps: not one of thirty starts ends at a minimum.": lambda run: (
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
    "The straighter the arm is, the smaller is the smallest singular value of $J$": lambda run: (
        np.linalg.svd(run["jacobian"](run["straight"]))[1][1]
        < np.linalg.svd(run["jacobian"](run["start"]))[1][1]
    ),
    "Every direction is shortened by its own share": lambda run: (
        run.line("lambda = 1e-05: p =")[-1]
        > run.line("lambda = 0.001: p =")[-1]
        > run.line("lambda =   0.1: p =")[-1]
        > run.line("lambda =    10: p =")[-1]
    ),
    "If the gain is near 1, the model was right, can be trusted further, and $\\lambda$ may become "
    "smaller. If the gain is below 0, the step went uphill": lambda run: (
        1,
        0,
        abs(steps_with(run, "0.01")[1] - 1) < 0.2,
        steps_with(run, "1e-05")[1] < 0,
    ),
    "Left: the arm is straight before it points exactly at the star, and from then on it hardly "
    "moves any more. Right: it comes to point at the star.": lambda run: (
        last_steps(run)[-1, 0] < 0.01,
        run.line("after  7 steps")[1] - run.line("after 11 steps")[1] < 1e-3,
        run.line("after 11 steps")[1] > 10 * run.line("after 11 steps")[2],
    ),
    "during the first 11 steps": lambda run: len(run["rows"]) - 1,
    "The method fits on one screen": lambda run: (
        np.abs(run["way"][-1][0] - [run["way"][-1][0][0], 0]).max() < 1e-6,
        run.line("the library: CONVERGED after")[1] < 1e-5,
    ),
    "tries where that line meets the radius": lambda run: (
        len(run["trials"]) <= 5,
        0.9 <= run["trials"][-1][1] / run["RADIUS"] <= 1.1,
    ),
    "the search ends as soon as a step is within the grey band": lambda run: all(
        not 0.9 <= length / run["RADIUS"] <= 1.1 for _, length in run["trials"][:-1]
    ),
    "With each of these ways to a shorter step, all runs end at a minimum.": lambda run: all(
        ended(run, name) == (30, 30) for name in ("levenberg-marquardt", "dogleg", "trust-region")
    ),
    "We try the same thirty starts with all three": lambda run: len(run["starts"]),
    "enough if the length is right to a tenth": lambda run: (LEAST, MOST) == (0.9, 1.1),
    "After a poor step the radius is halved. After a good one, or a Gauss-Newton step that was not "
    "poor, it is twice the length of the step": lambda run: (
        next_radius(2.0, 0.4, POOR - 0.01, 1.0) == 1.0,
        next_radius(0.5, 0.4, GOOD, 1.0) == 0.8,
        next_radius(0.5, 0.4, POOR + 0.01, 0.0) == 0.8,
    ),
    "Once a step lowers the cost by less than a tenth": lambda run: SLOW == 0.1,
    "looks a tenth of the next step ahead": lambda run: AHEAD == 0.1,
    "Grey: the cost, and four radii": lambda run: len(run["radii"]) == 4,
    "the dogleg does the same in two straight legs": lambda run: all(
        line[-1] > 0.98 for line in run.lines("the dogleg keeps")
    ),
    "its steps would look 57 times longer": lambda run: float(run["unit"][1]),
    "With Marquardt's $D$ the step is the same in both units.": lambda run: (
        np.allclose(*by_unit(run, "Marquardt, D")),
        not np.allclose(*by_unit(run, "Levenberg, D"), atol=0.01),
    ),
    "the workbench's default is $D = I$, and `levenberg-marquardt-columns` is the other": lambda run: (
        "levenberg-marquardt-columns" in run["wb"].SOLVERS
    ),
}

GIVEN = ("it is multiplied by 2, 4, 8 and so on",)

GENERAL = (  # mathematics, definitions and advice
    "Why is this better than setting $\\lambda$ directly?",
    "only as far as the model has kept its promises",
    "whose step is as long as the radius",
    "far more or far less than before",
    "only be as long as the valley is straight",
    "half of the curvature in the place of $e$",
)
