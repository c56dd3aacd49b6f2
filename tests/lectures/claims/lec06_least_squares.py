"""What lecture 6 says of its run."""

import numpy as np

from tests.lectures.prose import Run
from workbench.problem.steps import CHOLESKY_UP_TO


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


def growth(run: Run, name: str) -> float:
    """The power of the condition number with which the error grows."""
    some = slice(1, None)  # with the first one there is hardly anything but rounding
    logs = np.log(run["conditions"])[some], np.log(np.maximum(run["lost"][name], 1e-17))[some]
    return float(np.polyfit(*logs, 1)[0])


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
    "Minus half of the gradient still points downhill": lambda run: np.allclose(
        run["printed"] / run["slope"], 0.5, atol=1e-6
    ),
    "the elbow is bent by about 0.2 rad, and add $w\\,(b - 0.2)^2$ with $w = 0.02$ m²/rad²": (
        lambda run: (
            0.2,
            run["w"],
            np.isclose(run["both"](np.array([0, 1.2])) - run["F"](np.array([0, 1.2])), run["w"]),
        )
    ),
    "The lost factor has silently doubled the weight of the belief, and the answer is off by 0.09 rad: what": lambda run: (
        elbows(run)[0] - elbows(run)[1]
    ),
    "With a factor s that is too small (0.2) it creeps; with one that is a little too large (2.8) it never settles, and with a still larger one (4.5) it leaps about.": lambda run: (
        run["lengths"][0],
        run["lengths"][2],
        run["lengths"][3],
        run["fallen"][0.2][-1] > 1e3 * run["fallen"][2.0][-1],
        run["fallen"][2.8][-1] > 1e-3,
        np.ptp(run["fallen"][4.5][-20:]) > np.ptp(run["fallen"][2.8][-20:]),
    ),
    "The descent settles if $s$ is below 2 over the largest eigenvalue": lambda run: (
        2,
        run["lengths"][1] < 2 / run["largest"] < run["lengths"][2],
    ),
    "Five of these steps make $F$ smaller than sixty of the others did": lambda run: (
        len(run["fallen"][2.0]) - 1,
        run["F"](run["way"][5]) < 1e-3 * min(costs[-1] for costs in run["fallen"].values()),
    ),
    "and each of the last steps doubles the number of correct digits": lambda run: all(
        1.8 < digits(off(run), step) < 2.6 for step in (4, 5)
    ),
    "its condition number is the *square* of that of $J$": lambda run: (
        abs(run.line("condition of J:")[1] / run.line("condition of J:")[0] ** 2 - 1) < 0.3
    ),
    "columns that are alike to between one and six digits, solve each time for twenty answers": (
        lambda run: (len(run["answers"]), len(run["conditions"]) == 6)
    ),
    "The largest error of twenty answers, for columns that are more and more alike. By the normal equations it "
    "grows with the square of the condition number, by an orthogonal factorisation with the number itself.": (
        lambda run: (
            len(run["answers"]),
            1.5 < growth(run, "normal equations") < 2.5,
            growth(run, "np.linalg.lstsq") < 1.5,
            bool((np.diff(run["conditions"]) > 0).all()),
        )
    ),
    "The library goes over from the one to the other between a condition number of 3,000 and one of 30,000.": (
        lambda run: (
            round(run["conditions"][2], -3),
            round(run["conditions"][3], -4),
            run["lost"]["the library"][2] > 30 * run["lost"]["the library"][3],
        )
    ),
    "is below 10,000, so that enough digits are left": lambda run: (
        CHOLESKY_UP_TO,
        np.allclose(run["by_scaling"], run["by_hand"])
        and np.allclose(run["by_hand"], run["here"].step()),
    ),
    "With the factor, the zero of the gradient (circle) is the minimum; without it, the zero (square) is on the "
    "slope.": lambda run: (
        run["both"](run["zeros"][2]) < min(run["lowest"]) + 1e-6 < run["both"](run["zeros"][1])
    ),
    "divided by its standard deviation of 2 mm": lambda run: float(
        1e3 * run["problem"].residuals[0].sigma
    ),
    "This is the library's other way": lambda run: (
        worst(run, "normal equations") > 1e-6 > 1e-8 > worst(run, "the library"),
        worst(run, "np.linalg.lstsq") < 1e-8,
    ),
    "(which is negative if the point is nearer to the shoulder than the bone is long)": lambda run: (
        run.line("rho = 0.5 u: J'J")[-1] < 0 < run.line("rho = 1.5 u: J'J")[-1]
    ),
    "**triples** the number of correct digits": lambda run: digits(run["found"][1.0], 2) > 2.5,
    "For $\\rho > 2 u$ the factor is larger than one.": lambda run: (
        run["found"][2.2][8] > run["found"][2.2][0]
    ),
    "If the bone can reach the point (ρ = u), each step triples the number of correct digits. If it cannot, each step multiplies the error by about |1 - ρ/u|. Beyond 2 u the steps lead away, however near to the best angle they begin (that line starts at 0.01 rad, the others at 0.5 rad)": lambda run: (
        1,
        2,
        run["found"][2.2][0],
        run["found"][1.0][0],
        digits(run["found"][1.0], 2) > 2.5,
        all(abs(run.line(f"rho = {rho} u: factor")[1] - abs(1 - rho)) < 1e-3 for rho in (1.2, 0.5)),
        bool((np.diff(run["found"][2.2][:9]) > 0).all()),
    ),
    "(At 1.9 u the printed factor does not yet agree with the law, which holds for small errors: after 12 steps the error is not small.)": lambda run: (
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
    "Full steps go back and forth, and none of them leads to a better point than the start.": lambda run: (
        run.line("gauss-newton-full:")[-1] == 0.5,
    ),
    "the status says that the solver did not converge": lambda run: (
        "gauss-newton-full: MAX_ITERATIONS" in run.printed
    ),
    "halves the step until the actual decrease is a fair share of the predicted one": lambda run: (
        "gauss-newton     : CONVERGED" in run.printed,
        abs(run.line("gauss-newton     :")[-1]) < 1e-3,
    ),
    "72 numbers for the pose and 3 for the position are fitted to 369 vertices": lambda run: (
        run["bent"]["pose"].size,
        run["bent"]["trans"].size,
        run["body"].n_vertices,
    ),
    "In the second printed line the cost is twenty times smaller, and yet one number of the pose is further off than at the start": lambda run: (
        run["solution"].trace[0].cost / run["solution"].trace[1].cost,
        pose_off(run)[1] > 1.05 * pose_off(run)[0],
    ),
    "Gauss-Newton is fast if the model can fit the data closely.": lambda run: (
        len(run["solution"].trace) < 10 and pose_off(run)[-1] < 1e-9
    ),
}

GIVEN = ("Errors below 1e-17 are drawn at 1e-17.",)

GENERAL = (  # mathematics, definitions and advice
    "We know more than the gradient of $F$",
    "which says more than the gradient of the cost",
    "what is zero there is half the gradient of",
)
