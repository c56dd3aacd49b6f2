"""What lecture 6 says of its run."""

import numpy as np

from tests.lectures.prose import Run


def off(run: Run) -> np.ndarray:
    """The error along the Gauss-Newton steps on the arm, rad."""
    return np.abs(run["way"] - run["truth"]).max(axis=1)


def digits(errors: np.ndarray, step: int) -> float:
    """By what the number of right digits is multiplied in a step."""
    return float(np.log(errors[step]) / np.log(errors[step - 1]))


def elbows(run: Run) -> tuple[float, float]:
    """Where the whole gradient is zero, and where the halved one is, rad."""
    return run.line("2 J'e: elbow")[1], run.line("1 J'e: elbow")[1]


def worst(run: Run, name: str) -> float:
    return run.line(f"{name:17} off by up to")[0]


def pose_off(run: Run) -> list[float]:
    """Of the body's fit, iterate by iterate, rad."""
    pose = run["bent"]["pose"]
    return [float(np.abs(one.values["pose"] - pose).max()) for one in run["solution"].trace]


SAYS = {
    "The upper bone is $u = 0.30$ m long, the forearm $l = 0.25$ m.": lambda run: (
        run["UPPER"],
        run["LOWER"],
    ),
    "its length $u = 0.30$ m": lambda run: run["UPPER"],
    "here $4 \\times 2$": lambda run: run["jacobian"](run["start"]).shape == (4, 2),
    "Half of the gradient still points downhill": lambda run: np.allclose(
        run["printed"] / run["slope"], 0.5, atol=1e-6
    ),
    "the elbow is bent by about 0.2 rad, and add $w\\,(b - 0.2)^2$ with $w = 0.02$ m²/rad²": (
        lambda run: (
            0.2,
            run["w"],
            np.isclose(run["both"](np.array([0, 1.2])) - run["F"](np.array([0, 1.2])), run["w"]),
        )
    ),
    "The lost factor has doubled the weight of the belief, without a word, and the answer is off by "
    "0.09 rad.": lambda run: elbows(run)[0] - elbows(run)[1],
    "Too short a step (0.2) creeps; one that is a little too long (2.8) never settles, a longer one "
    "(4.5) leaps about": lambda run: (
        run["lengths"][0],
        run["lengths"][2],
        run["lengths"][3],
        run["fallen"][0.2][-1] > 1e3 * run["fallen"][2.0][-1],
        run["fallen"][2.8][-1] > 1e-3,
        np.ptp(run["fallen"][4.5][-20:]) > np.ptp(run["fallen"][2.8][-20:]),
    ),
    "The border is at 2 over the largest eigenvalue": lambda run: (
        2,
        run["lengths"][1] < 2 / run["largest"] < run["lengths"][2],
    ),
    "Five of these steps do what sixty of the others did not do": lambda run: (
        len(run["fallen"][2.0]) - 1,
        run["F"](run["way"][5]) < 1e-3 * min(costs[-1] for costs in run["fallen"].values()),
    ),
    "and each of the last ones doubles the number of right digits": lambda run: all(
        1.8 < digits(off(run), step) < 2.6 for step in (4, 5)
    ),
    "that of $J^\\top J$ is the *square* of that of $J$": lambda run: (
        abs(run.line("condition of J:")[1] / run.line("condition of J:")[0] ** 2 - 1) < 0.3
    ),
    "so we solve for twenty answers": lambda run: len(run["answers"]),
    "the library changes over to that": lambda run: (
        worst(run, "normal equations") > 1e-6 > 1e-8 > worst(run, "the library"),
        worst(run, "np.linalg.lstsq") < 1e-8,
    ),
    "(negative where the point is nearer than the bone is long)": lambda run: (
        run.line("rho = 0.5 u: J'J")[-1] < 0 < run.line("rho = 1.5 u: J'J")[-1]
    ),
    "**triples** the digits": lambda run: digits(run["found"][1.0], 2) > 2.5,
    "And at $\\rho > 2 u$ it is more than one.": lambda run: (
        run["found"][2.2][8] > run["found"][2.2][0]
    ),
    "Where the point can be met (ρ = u) each step triples the right digits; where it cannot, it "
    "multiplies the error by |1 - ρ/u|; beyond 2 u the steps lead away, however near they began (that "
    "line starts at 0.01 rad, the others at 0.5 rad)": lambda run: (
        1,
        2,
        run["found"][2.2][0],
        run["found"][1.0][0],
        digits(run["found"][1.0], 2) > 2.5,
        all(abs(run.line(f"rho = {rho} u: factor")[1] - abs(1 - rho)) < 1e-3 for rho in (1.2, 0.5)),
        bool((np.diff(run["found"][2.2][:9]) > 0).all()),
    ),
    "(At 1.9 u the law is not yet met: it is one of small errors, and after 12 steps the error is not "
    "small.)": lambda run: (
        1.9,
        len(run["found"][1.9]) - 1,
        abs(run.line("rho = 1.9 u: factor")[1] - 0.9) > 1e-3,
        run["found"][1.9][-1] > 0.05,
    ),
    "Here is the bone with $\\rho = 2.2\\, u$, from $a = 0.5$ rad; the best angle is 0.": lambda run: (
        float(run["far"]["a"]),
        0,
        np.isclose(run["far"]["target"][0], 2.2 * run["UPPER"]),
    ),
    "Full steps go to and fro, and none of them was better than the start.": lambda run: (
        run.line("gauss-newton-full:")[-1] == 0.5,
    ),
    "the status says that it did not converge": lambda run: (
        "gauss-newton-full: MAX_ITERATIONS" in run.printed
    ),
    "halves the step until a fair share is kept": lambda run: (
        "gauss-newton     : CONVERGED" in run.printed,
        abs(run.line("gauss-newton     :")[-1]) < 1e-3,
    ),
    "72 numbers of the pose and 3 of its place, fitted to 369 vertices that we made up": lambda run: (
        run["bent"]["pose"].size,
        run["bent"]["trans"].size,
        run["body"].n_vertices,
    ),
    "In the second line the cost has fallen twentyfold, and yet one number of the pose is further off "
    "than at the start": lambda run: (
        run["solution"].trace[0].cost / run["solution"].trace[1].cost,
        pose_off(run)[1] > 1.05 * pose_off(run)[0],
    ),
    "Gauss-Newton is quick where the data can be met.": lambda run: (
        len(run["solution"].trace) < 10 and pose_off(run)[-1] < 1e-9
    ),
}

GIVEN = ("Below 1e-17 is drawn at 1e-17.",)
