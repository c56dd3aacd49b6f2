"""A check of derivatives by finite differences and by the error of the linear model."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.errors import NotSupported
from workbench.problem import Linearization, Problem
from workbench.problem.steps import EPS
from workbench.problem.storage import dense

WRONG = 1e-5  # of the largest entry of its column: by more, an entry is wrong
STEPS_OF_DIFFERENCES = tuple(2e-4 / 32**k for k in range(5))  # of a unit, or of a larger number
NOISE = 8 * EPS
MOST_COLUMNS = 300  # columns that are all compared; of more, a random choice is
HESSIAN_UP_TO = 150  # free numbers, and
HESSIAN_ROWS = 8000  # rows: above, an exact Hessian takes longer than all the rest
STEPS = np.logspace(-1, -5, 9)


@dataclass(frozen=True)
class Suspect:
    """One entry of the Jacobian that differences do not confirm.

    Attributes:
        row: its row.
        column: its column.
        given: the value in the Jacobian.
        differences: the value by central differences.
        error: how far the two are apart, over what rounding allows; above 1 it is wrong.
    """

    row: int
    column: int
    given: float
    differences: float
    error: float


@dataclass(frozen=True, eq=False)
class DerivativeCheck:
    """What was compared, and what did not agree.

    Attributes:
        columns: the columns that were compared with differences.
        largest_error: the largest |J - differences|, over the largest entry of its column.
        suspects: the entries that are wrong, the worst first, ten at most.
        wrong: how many entries are wrong.
        steps: the step lengths h of the Taylor test.
        taylor: |r(x + h d) - r(x) - h J d| for each step h.
        slope: the slope of log(taylor) over log(h): 2 is right, 1 is wrong; None where r is linear.
        gradient_error: the relative difference between the adjoint gradient and J'r.
        neglected: |H - J'J| / |H|, the share of the exact Hessian H that J'J leaves out.
    """

    columns: Index = field(repr=False)
    largest_error: float
    suspects: tuple[Suspect, ...]
    wrong: int
    steps: Array = field(repr=False)
    taylor: Array = field(repr=False)
    slope: float | None
    gradient_error: float
    neglected: float | None

    @property
    def passed(self) -> bool:
        """Whether no entry, slope or gradient is wrong."""
        return not self.wrong and not any(self.faults)

    @property
    def faults(self) -> Iterator[str]:
        """What is wrong apart from single entries, a sentence for each."""
        if self.slope is not None and self.slope <= 1.5:
            yield f"the error of the linear model falls like h^{self.slope:.1f}, not like h^2"
        if not self.gradient_error < 1e-8:
            yield f"the gradient differs from J'r by {self.gradient_error:.1e}"


def check_derivatives(
    problem: Problem, at: Mapping[str, ArrayLike], here: Linearization, seed: int = 0
) -> DerivativeCheck:
    """Central differences, column by column; where they do not agree, with smaller steps as well.

    An entry is wrong if it differs from every difference by more than 1e-5 of its column's largest
    entry and more than ten times the rounding error of the difference.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        return _checked(problem, *problem.split(at), here, np.random.default_rng(seed))


def _checked(
    problem: Problem, x: Array, fixed: Array, here: Linearization, rng: np.random.Generator
) -> DerivativeCheck:
    n = x.size
    columns = (
        np.arange(n) if n <= MOST_COLUMNS else np.sort(rng.choice(n, MOST_COLUMNS, replace=False))
    )
    suspects: list[Suspect] = []
    wrong, largest = 0, 0.0
    scale = here.column_norms.max(initial=0.0) / np.sqrt(max(here.shape[0], 1))
    for i in columns:
        column = here.column(int(i))
        size = max(float(abs(column).max(initial=0.0)), 1e-8 * scale, 1e-300)
        first, off, allowed = _compared(problem, x, fixed, here.residual, int(i), column, size)
        largest = max(largest, float(np.max(off, initial=0.0)) / size)
        bad = np.flatnonzero(off > allowed)
        wrong += bad.size
        suspects += [
            Suspect(int(k), int(i), float(column[k]), float(first[k]), float(off[k] / allowed[k]))
            for k in bad[np.argsort(-off[bad] / allowed[bad])][:10]
        ]
    taylor, slope = _taylor(problem, x, fixed, here, rng)
    return DerivativeCheck(
        columns,
        largest,
        tuple(sorted(suspects, key=lambda s: -s.error)[:10]),
        wrong,
        STEPS,
        taylor,
        slope,
        _gradient_error(problem, x, fixed, here),
        _neglected(problem, x, fixed, here),
    )


def _compared(
    problem: Problem, x: Array, fixed: Array, r: Array, i: int, column: Array, size: float
) -> tuple[Array, Array, Array]:
    """Differences, how far off the given column is, and how far it may be, for each row.

    Smaller steps are tried as long as some row disagrees; of each row the best counts.
    """
    unit = max(1.0, abs(x[i]))
    first = np.zeros_like(column)
    off, allowed = np.full_like(column, np.inf), np.ones_like(column)
    for step in STEPS_OF_DIFFERENCES:
        up, down = x.copy(), x.copy()
        up[i], down[i] = x[i] + step * unit, x[i] - step * unit
        apart = problem.residual(up, fixed) - problem.residual(down, fixed)
        slope = apart / (up[i] - down[i])
        first = slope if step == STEPS_OF_DIFFERENCES[0] else first
        doubt = NOISE * (abs(r) + abs(slope) * unit + 1.0) / (step * unit)
        here, may = np.maximum(abs(column - slope) - doubt, 0), np.maximum(WRONG * size, 9 * doubt)
        # at the edge of the domain of r differences say nothing
        here[~np.isfinite(slope)], may[~np.isfinite(slope)] = 0.0, 1.0
        better = here * allowed < off * may
        off, allowed = np.where(better, here, off), np.where(better, may, allowed)
        if (off <= allowed).all():
            break
    return first, off, allowed


def _taylor(
    problem: Problem, x: Array, fixed: Array, here: Linearization, rng: np.random.Generator
) -> tuple[Array, float | None]:
    d = rng.standard_normal(x.size)
    d /= max(float(np.linalg.norm(d)), 1e-300)
    moved = np.array([problem.residual(x + h * d, fixed) for h in STEPS])
    left = np.linalg.norm(moved - here.residual - STEPS[:, None] * here.along(d), axis=1)
    rounding = 100 * EPS * (1 + float(np.linalg.norm(here.residual)) + here.norm)
    clear = np.isfinite(left) & (left > 10 * rounding)
    if clear.sum() < 3:
        return left, None
    # the smallest steps that rounding has not reached, where the slope is clearest
    h, e = np.log(STEPS[clear])[-4:], np.log(left[clear])[-4:]
    return left, float(np.polyfit(h, e, 1)[0])


def _gradient_error(problem: Problem, x: Array, fixed: Array, here: Linearization) -> float:
    _, g = problem.cost_and_gradient(x, fixed)
    size = float(np.linalg.norm(here.column_norms) * np.linalg.norm(here.residual))
    return float(np.linalg.norm(g - here.gradient)) / max(size, 1e-300)


def _neglected(problem: Problem, x: Array, fixed: Array, here: Linearization) -> float | None:
    """None of a large problem, and of functions that have no second derivatives or no graph."""
    if x.size > HESSIAN_UP_TO or problem.size > HESSIAN_ROWS or not x.size:
        return None
    try:
        H = dense(problem.hessian_at(x, fixed))
    except (RuntimeError, NotSupported):
        return None
    if not np.isfinite(H).all():
        return None
    return float(np.linalg.norm(H - dense(here.normal))) / max(float(np.linalg.norm(H)), 1e-300)
