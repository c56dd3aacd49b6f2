"""What lecture 2 says of its run."""

import numpy as np

from tests.lectures.prose import Run
from workbench.geometry.rotation import SERIES_BELOW, SERIES_TERMS

ROUNDING = (
    1e-13  # what sums and products of a few numbers of size 1 lose, with room for any processor
)


def of_formula(run: Run, name: str) -> np.ndarray:
    """|R'R - I| at t = 0.1, 1, pi/3 and 3."""
    return np.array(run.line(f"{name:22} |R'R - I|")[-4:])


def way(run: Run, name: str) -> str:
    """The three lines that are printed of a way to write the formula."""
    lines = run.printed.splitlines()
    begin = lines.index(f"{name}:")
    return "\n".join(lines[begin + 1 : begin + 4])


def off_a_rotation(run: Run, name: str, angle: float) -> float:
    f, axis = run["formulas"][name], run["axis"]
    return float(np.linalg.norm(f(angle * axis).T @ f(angle * axis) - np.eye(3)))


def right_at(run: Run, name: str) -> set[float]:
    """The angles of the figure, beyond small ones, at which a formula gives a rotation."""
    found = zip(run["angles"], run["failure"][name], strict=True)
    return {round(float(t), 9) for t, off in found if t > 0.5 and off < 1e-9}


def stretches(run: Run) -> list[float]:
    """The longest of the hand for 8, 16 and 32 markers, in the mean."""
    return [line[-1] for line in run.lines("in the mean")]


SAYS = {
    "It takes its own axis to zero, so its determinant is zero, whereas its exponential keeps that axis.": lambda run: (
        all(abs(value) < 1e-9 for value in run.line("skew matrix")[-2:]),
        run.line("skew matrix")[0] > 1,
        run.line("exponential: ")[0] < 1e-9,
        abs(run.line("exponential: ")[1] - 1) < 1e-9,
        abs(run.line("exponential: ")[2] - np.linalg.norm(run["w"])) < 1e-3,
    ),
    "begin with the nine numbers of a matrix, watch them fail, and end with the three": lambda run: (
        run["M"].size == 9 and run["w"].size == 3
    ),
    "The noise is 5 mm in each coordinate, and the markers are met to less than that.": (
        lambda run: (5, run.line("markers are met to")[0] < 5)
    ),
    "the columns of a rotation have length 1, and its determinant is 1. Neither is so here: this "
    "matrix stretches": (
        lambda run: (
            1,
            1,
            max(run.line("lengths of the columns")) > 1.1,
            run.line("det M")[0] > 1.05,
        )
    ),
    "Along the forearm, where the markers are far apart, that hardly shows.": lambda run: (
        abs(run.line("lengths of the columns")[0] - 1) < 0.01
    ),
    "with 5 mm of noise, both turned back": lambda run: 5,
    "means of 200 draws of eight markers": lambda run: (
        run["mean_stretch"].__defaults__[1],
        run["mean_stretch"].__defaults__[0] == 8,
    ),
    "The more noise there is, the more the hand is stretched.": lambda run: (
        bool((np.diff(np.transpose(run["spread"])[0]) > 0).all()),
        bool((np.diff(np.transpose(run["spread"])[1]) < 0).all()),
    ),
    "Nine free ones stretch bones, and the more so the noisier and the fewer the data.": lambda run: (
        stretches(run) == sorted(stretches(run), reverse=True)
    ),
    "As a repair this is right": lambda run: (
        run.lines("distances in the hand are multiplied by")[1] == [1.0, 1.0],
        run.line("R'R = I to", "det R")[0] < ROUNDING,
    ),
    "Rodrigues' formula has $1 - \\cos t$ and the **unit** axis": lambda run: (
        of_formula(run, "1 - cos t, unit axis").max() < ROUNDING
    ),
    "The right one is off by rounding alone.": lambda run: (
        max(run["failure"]["1 - cos t, unit axis"]) < ROUNDING
    ),
    "The one with cos t is right at π/3 and 5π/3 (60 and 300 degrees) alone": lambda run: (
        3,
        3,
        60,
        300,
        right_at(run, "cos t") == {round(np.pi / 3, 9), round(5 * np.pi / 3, 9)},
    ),
    "the one without a unit axis at 1 rad, at full turns, and nearly so for small angles": (
        lambda run: (
            1,
            right_at(run, "no unit axis") == {1.0, round(2 * np.pi, 9)},
            off_a_rotation(run, "no unit axis", 0.01) < 1e-9,
        )
    ),
    "A test at 60 degrees ($\\pi/3$) would let the first one pass, and a test at 1 rad or at"
    " small angles the second one.": lambda run: (
        60,
        1,
        off_a_rotation(run, "cos t", np.pi / 3) < ROUNDING,
        off_a_rotation(run, "no unit axis", 1.0) < ROUNDING,
        off_a_rotation(run, "cos t", 1.0) > 0.1,
        off_a_rotation(run, "no unit axis", np.pi / 3) > 0.01,
    ),
    "$R^\\top R = I$ finds both misprints": lambda run: (
        off_a_rotation(run, "cos t", 3.0) > 1 and off_a_rotation(run, "no unit axis", 3.0) > 1
    ),
    "The textbook's form has no derivative at rest: NaN.": lambda run: (
        "finite  False" in way(run, "as in the textbook")
    ),
    "and second derivatives are off by 1, their own size": lambda run: (
        "off by up to 1" in way(run, "as in the textbook").splitlines()[-1],
        float(way(run, "as in the textbook").split()[-1]),
        np.isclose(np.abs(run["hessian"]).max(), 1),
    ),
    "It makes the NaN go away, but it leaves a matrix that is orthogonal to 5e-9 only and whose second "
    "derivative near zero is wrong": lambda run: (
        "finite  True" in way(run, "1e-8 added to w in |w|"),
        float(way(run, "1e-8 added to w in |w|").splitlines()[0].split()[-1]),
        float(way(run, "1e-8 added to w in |w|").split()[-1]) > 0.01,
    ),
    "The right cure costs nothing: near zero": lambda run: (
        float(way(run, "the library's").splitlines()[0].split()[-1]) < ROUNDING,
        float(way(run, "the library's").split()[-1]) < 1e-7,
    ),
    "`_series(t2, k)` sums eight or nine terms": lambda run: SERIES_TERMS == 8,
    "`SERIES_BELOW = 0.25` rad² is where it changes over": lambda run: SERIES_BELOW == 0.25,
    "One law is worth remembering": lambda run: (
        run.line("off this law by up to")[-1] < ROUNDING,
        run.line("the second singular value is off its law")[-1] < ROUNDING,
    ),
    "At a full turn, 2π, only a change along the axis has an effect: two of three "
    "directions are lost": (
        lambda run: (
            abs(run["at_full"][0] - np.sqrt(2)) < 1e-9,
            bool((run["at_full"][1:] < 1e-9).all()),
        )
    ),
    "sees a Jacobian of rank 1": lambda run: int((run["at_full"] > 1e-9).sum()),
}

GIVEN = (
    "there are 24 of these **rotation vectors**",
    "A body at rest has $t = 0$ in every joint",
    "the number $\\cos t$ is rounded to 1,",
)
