"""`python -m benchmarks.gym.search`: find the known answers that no formula gives, and store them.

SciPy's trf descends from the numbers that noisy data were made of, or for published problems from
the start and from 40 points around it, and Newton's method in 40 digits refines the lowest end.
None of our solvers takes part. Where an answer is singular, so that Newton's method does not
settle, the lowest end itself is stored.
"""

import sys

import numpy as np
import scipy.optimize

from benchmarks.gym import answers
from benchmarks.gym.case import Case
from benchmarks.gym.cases import NEW
from benchmarks.gym.high_precision import refined, residual_of
from benchmarks.keeping import keep
from workbench.arrays import Array
from workbench.problem import Problem

AROUND = 40
DIGITS = 17
ROUNDING = 1e-20


def main() -> None:
    """Search for what is missing, or for the problems that are named."""
    found = dict(answers.stored())
    first: dict[str, Case] = {}
    for one in NEW:
        first.setdefault(one.problem, one)
    for name, one in first.items():
        setup = one.experiment.setup()
        if name in sys.argv[1:] or (setup.known is None and name not in found):
            x, cost, how = answer(one)
            found[name] = {"cost": cost, "x": x.tolist(), "how": how}
            print(name, f"{2 * cost:.12g}", how, flush=True)
    keep(answers.FILE, dict(sorted(found.items())), DIGITS)


def answer(one: Case) -> tuple[Array, float, str]:
    """The free numbers of the lowest minimum found, half the sum of squares, and its search."""
    setup = one.experiment.setup()
    problem = setup.problem
    start = problem.split(setup.start)[0]
    if setup.made_of is not None:
        begins = [problem.free.pack(dict(setup.start) | dict(setup.made_of))]
        how = "from the truth"
        if one.problem.startswith("arm"):
            begins += _around(start)
            how = "the lowest from the truth and around the start"
    else:
        begins, how = _around(start), "the lowest around the start"
    ends = [end for begin in begins if (end := _descended(problem, begin)) is not None]
    lowest = min(ends, key=lambda end: end[1])
    try:
        return *_told(*refined(residual_of(problem), lowest[0])), f"{how}, refined"
    except (ArithmeticError, ZeroDivisionError) as error:
        print(f"{one.problem} is not refined: {error}", flush=True)
        return *_told(*lowest), f"{how}; singular"


def _told(x: Array, cost: float) -> tuple[Array, float]:
    """The same, with a cost that only rounding keeps from 0 called 0."""
    return x, cost if cost > ROUNDING else 0.0


def _around(start: Array) -> list[Array]:
    rng = np.random.default_rng(0)
    size = np.maximum(np.abs(start), 0.5)
    moved = [
        start + size * spread * rng.standard_normal(start.size)
        for spread in (0.1, 0.3, 1.0)
        for _ in range(AROUND // 3)
    ]
    return [start, *moved]


def _descended(problem: Problem, begin: Array) -> tuple[Array, float] | None:
    fixed = np.zeros(problem.fixed.size)
    try:
        end = scipy.optimize.least_squares(
            lambda x: problem.residual(x, fixed),
            begin,
            lambda x: np.asarray(problem.linearize_at(x, fixed).jacobian),
            x_scale="jac",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=1000,
        )
    except ValueError:  # a start without a finite cost
        return None
    return end.x, float(end.cost)


if __name__ == "__main__":
    main()
