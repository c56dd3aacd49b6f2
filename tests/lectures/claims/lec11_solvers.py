"""What lecture 11 says of its run."""

from typing import Any

import numpy as np

from tests.lectures.numerals import above
from tests.lectures.prose import Run
from workbench.comparison.targets import prices as published

GN, LM, DOGLEG, LBFGS = range(4)  # the columns of the lecture's tables


def ended(run: Run, problem: str, solver: int) -> tuple[int, float, str]:
    """What a solver says of itself: iterations, cost and status."""
    one = run["solutions"][problem, run["NAMES"][solver]]
    return one.iterations, one.cost, one.status.name


def iterations(run: Run, problem: str) -> list[int]:
    return [ended(run, problem, solver)[0] for solver in range(4)]


def arrived(run: Run, problem: str) -> list[bool]:
    """Who ends within a thousandth of the way to the least cost."""
    return [
        bool(cost.min() - run["least"][problem] <= 1e-3 * (cost[0] - run["least"][problem]))
        for _, cost in (run["runs"][problem, name] for name in run["NAMES"])
    ]


def leaders(run: Run, problem: str) -> set[int]:
    """Who is ahead at one effort or another along the way."""
    ahead = set()
    for effort in np.geomspace(5, 200, 40):
        left = [
            cost[course <= effort].min(initial=np.inf)
            for course, cost in (run["runs"][problem, name] for name in run["NAMES"])
        ]
        ahead.add(int(np.argmin(left)))
    return ahead


def lost(run: Run) -> np.ndarray:
    """On how many problems each solver misses the target."""
    return (~run["met"]).sum(axis=0)


def mean(run: Run, solver: int) -> float:
    """The effort until the target where it was met."""
    return float(run["times"][run["met"][:, solver], solver].mean())


def share_of(run: Run, problem: str, solver: int) -> float:
    """Of the sum of a solver's efforts, %."""
    times = run["times"][:, solver]
    at = run["PROBLEMS"].index(problem)
    return float(100 * times[at] / times[np.isfinite(times)].sum())


def quickest(run: Run, line: int) -> list[int]:
    """The shares of the problems on which each solver is the quickest, %."""
    text = [one for one in run.printed.splitlines() if one.startswith("quickest among")][line]
    return [int(part.split()[-2]) for part in text.partition(": ")[2].split(",")]


def at_price(run: Run, words: str) -> list[float]:
    """The same with another price of a Jacobian, %."""
    return run.line("a Jacobian for", words)[1:]


def prices(run: Run) -> tuple[float, float]:
    """Of a residual and of a gradient, as the lecture's efforts have them."""
    spent, counted = [], []
    for (problem, solver), (effort, _) in run["runs"].items():
        last = run["solutions"][problem, solver].trace[-1].evaluations
        n = run["setups"][problem].start["x"].size
        spent.append(effort[-1] - n * last.jacobian)
        counted.append((last.residual, last.gradient))
    found = np.linalg.lstsq(np.array(counted, dtype=float), np.array(spent), rcond=None)[0]
    return float(found[0]), float(found[1])


def intervals(run: Run) -> list[tuple[int, int]]:
    return [(line[1], line[2]) for line in run.lines("meets the target on")]


def by(run: Run, form: str) -> dict[str, Any]:
    """The solutions of one form of the turn, by solver."""
    return {solver: one for (of, solver), one in run["answers"].items() if of == form}


def squeezed(run: Run, solver: str) -> list[float]:
    """How far from a rotation the iterates of the nine numbers are."""
    return [run["squeezed"](i.values) for i in by(run, "nine numbers")[solver].trace]


def same_turn(run: Run) -> bool:
    """Whether all found the same turn."""
    nine = [one.values["matrix"] for one in by(run, "nine numbers").values()]
    three = [
        run["matrix_from_vector"](one.values["vector"].ravel())
        for one in by(run, "three numbers").values()
    ]
    return bool(np.ptp(np.array([*nine, *three]), axis=0).max() < 1e-5)


SAYS = {
    "The workbench has more than twenty solvers": lambda run: above(len(run["wb"].SOLVERS)),
    "We let four of them run on sixteen classical problems": lambda run: (
        len(run["PROBLEMS"]),
        len(run["NAMES"]) == 4,
    ),
    "On the first Gauss-Newton has the fewest iterations, on the second Levenberg-Marquardt.": (
        lambda run: (
            np.argmin(iterations(run, "rosenbrock")) == GN,
            np.argmin(iterations(run, "helical-valley")) == LM,
        )
    ),
    "L-BFGS has come down to a cost of $10^{-17}$, and says that it stalled": lambda run: all(
        ended(run, problem, LBFGS)[1] < 1e-16 and ended(run, problem, LBFGS)[2] == "STALLED"
        for problem in ("rosenbrock", "helical-valley")
    ),
    "three of the four say `CONVERGED` at a cost of 24.5, although 0 can be reached": lambda run: (
        [ended(run, "freudenstein-roth", k)[2] for k in range(4)].count("CONVERGED") == 3,
        *{round(ended(run, "freudenstein-roth", k)[1], 1) for k in (LM, DOGLEG, LBFGS)},
        round(run["setups"]["freudenstein-roth"].known.cost),
    ),
    "Gauss-Newton ends at more than two thousand times the least cost, where the cost still falls a "
    "little while unknowns run off, and says `NO_FINITE_MINIMUM`": lambda run: (
        above(ended(run, "bard-far", GN)[1] / run["setups"]["bard-far"].known.cost),
        ended(run, "bard-far", GN)[2] == "NO_FINITE_MINIMUM",
        run["solutions"]["bard-far", run["NAMES"][GN]].diverging != (),
    ),
    "which promises 95 % whatever the share is, and is wider for that reason": lambda run: (
        95 if run["worst"](run["rate"], 3) >= 0.95 > run["worst"](run["wilson"], 3) else 0
    ),
    "its prices are printed: 4 for a gradient as here": lambda run: published(9)["gradient"],
    "a residual costs 1, a gradient 4 (": prices,
    "Left: all arrive, and who is ahead changes on the way. Right: two arrive": lambda run: (
        all(arrived(run, "rosenbrock")),
        len(leaders(run, "rosenbrock")) > 1,
        arrived(run, "bard-far") == [False, True, False, True],
    ),
    "By the **mean over the problems that were solved** Gauss-Newton takes nearly twice as long as the "
    "dogleg, by the median hardly longer": lambda run: (
        1.9 < mean(run, GN) / mean(run, DOGLEG) < 2,
        np.median(run["times"], axis=0)[GN] < 1.2 * np.median(run["times"], axis=0)[DOGLEG],
    ),
    "brown-dennis, makes up 69 % of its mean": lambda run: share_of(run, "brown-dennis", GN),
    "Such a mean also leaves out the problems on which a solver fails": lambda run: (
        lost(run)[GN] > lost(run)[DOGLEG] > 0
    ),
    "$10^{-5}$ of the way is met at the wrong stationary point. Closer targets show it": lambda run: (
        run["met"][run["PROBLEMS"].index("freudenstein-roth-far")].all(),
        not np.isfinite(run["needed"](1e-7))[run["PROBLEMS"].index("freudenstein-roth-far")].any(),
    ),
    "At $\\alpha = 1$ it says how often $s$ *is* the best": lambda run: 1,
    "L-BFGS is never the quickest, and as reliable as the dogleg; Levenberg-Marquardt is mostly the"
    " quickest, and Gauss-Newton the least reliable": lambda run: (
        quickest(run, 0)[LBFGS] == 0,
        lost(run)[LBFGS] == lost(run)[DOGLEG],
        quickest(run, 0)[LM] > 50,
        lost(run)[GN] > max(lost(run)[[LM, DOGLEG, LBFGS]]),
    ),
    "on each problem on which it alone was the best, another one becomes the best": lambda run: (
        quickest(run, 1)[0] > quickest(run, 0)[GN]
    ),
    "Prices matter, too.": lambda run: (
        at_price(run, "10 residuals") != at_price(run, "1 residual ")
    ),
    "where both share their work, or as expensive as ten, where it comes from slower code": (
        lambda run: run["price"]
    ),
    "(Shares may add up to more than 100 %": lambda run: above(sum(quickest(run, 0))),
    "Sixteen problems are a sample.": lambda run: len(run["PROBLEMS"]),
    "The intervals overlap: sixteen problems do not tell which of these four is the most "
    "reliable": lambda run: (
        len(run["PROBLEMS"]),
        max(low for low, _ in intervals(run)) < min(high for _, high in intervals(run)),
        len(intervals(run)) == 4,
    ),
    "Performance profiles for the target 1e-5.": lambda run: (
        1e-5,
        np.array_equal(run["times"], run["needed"](1e-5)),
    ),
}

SAYS |= {
    "Now eight markers were turned by 90 degrees": lambda run: (
        len(run["markers"]) == 8,
        np.degrees(np.linalg.norm(run["turn"])),
    ),
    "Our four solvers know nothing of equations and refuse the problem. Two others take it": (
        lambda run: set(by(run, "nine numbers")) == {"sqp", "ipopt"}
    ),
    "needs no equations, and all six can be asked": lambda run: (
        len(by(run, "three numbers")) == 6,
        all(one.converged for one in run["answers"].values()),
    ),
    "All that answer find the same turn.": same_turn,
    "the equations hold at the end and nowhere in between": lambda run: all(
        squeezed(run, solver)[-1] < 1e-6 < min(squeezed(run, solver)[1:-1])
        for solver in ("sqp", "ipopt")
    ),
    "The first step leaves the rotations, and the later ones come back to them.": lambda run: all(
        squeezed(run, solver)[0] == 0 and squeezed(run, solver)[1] > 0.1
        for solver in ("sqp", "ipopt")
    ),
}

GIVEN = (
    "nine numbers $R$, of which only those with $R^\\top R = I$ are rotations. These are six",
    "The same turn as a rotation vector, three numbers",
    "is better off with three numbers here",
    "Over five problems with twenty draws of noise, `examples/16_nine_numbers_or_three.py`",
    "point filter line-search algorithm*, 2006)",
    "Ten starts of one problem are not ten problems",
    "Wilson's interval covers the truth in 95 % of the cases *on average*",
    "`rate` is the interval of Clopper and Pearson (1934)",
    "Griewank and Walther (*Evaluating Derivatives*, 2008)",
    "Below 1e-16 is drawn at 1e-16.",
    "with a probability of about 95 % it is no further than $z = 1.96$ times that",
    "shrinks to a point: at 0 and at $n$ successes",
)
