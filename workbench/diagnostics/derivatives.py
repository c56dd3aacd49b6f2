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
DIFFERENCE_STEPS = tuple(2e-4 / 32**k for k in range(5))  # of a unit, or of a larger number
NOISE = 8 * EPS  # relative rounding error of a residual
MOST_COLUMNS = 300  # columns that are all compared; of more, a random choice is
MOST_UNKNOWNS_OF_HESSIAN = 150  # with more of these or of
MOST_ROWS_OF_HESSIAN = 8000  # an exact Hessian takes longer than all the rest
TAYLOR_STEPS = np.logspace(-1, -5, 9)


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
    wrong, largest_error = 0, 0.0
    scale = here.column_norms.max(initial=0.0) / np.sqrt(max(here.shape[0], 1))
    for i in columns:
        column = here.column(int(i))
        size = max(float(abs(column).max(initial=0.0)), 1e-8 * scale, 1e-300)
        slope, error, allowed = _compared(problem, x, fixed, here.residual, int(i), column, size)
        largest_error = max(largest_error, float(np.max(error, initial=0.0)) / size)
        bad = np.flatnonzero(error > allowed)
        wrong += bad.size
        suspects += [
            Suspect(int(k), int(i), float(column[k]), float(slope[k]), float(error[k] / allowed[k]))
            for k in bad[np.argsort(-error[bad] / allowed[bad])][:10]
        ]
    taylor, order = _taylor(problem, x, fixed, here, rng)
    return DerivativeCheck(
        columns,
        largest_error,
        tuple(sorted(suspects, key=lambda s: -s.error)[:10]),
        wrong,
        TAYLOR_STEPS,
        taylor,
        order,
        _gradient_error(problem, x, fixed, here),
        _neglected(problem, x, fixed, here),
    )


def _compared(
    problem: Problem, x: Array, fixed: Array, r: Array, i: int, column: Array, size: float
) -> tuple[Array, Array, Array]:
    """For each row: the difference quotient with the largest step, the error of the column, and
    how large the error may be.

    Smaller steps are tried as long as some row disagrees; of each row the best counts.
    """
    unit = max(1.0, abs(x[i]))
    slopes = []
    error, allowed = np.full_like(column, np.inf), np.ones_like(column)
    for step in DIFFERENCE_STEPS:
        up, down = x.copy(), x.copy()
        up[i], down[i] = x[i] + step * unit, x[i] - step * unit
        slope = (problem.residual(up, fixed) - problem.residual(down, fixed)) / (up[i] - down[i])
        slopes.append(slope)
        rounding = NOISE * (abs(r) + abs(slope) * unit + 1.0) / (step * unit)
        error_here = np.maximum(abs(column - slope) - rounding, 0)
        allowed_here = np.maximum(WRONG * size, 9 * rounding)
        # at the edge of the domain of r differences say nothing
        outside = ~np.isfinite(slope)
        error_here[outside], allowed_here[outside] = 0.0, 1.0
        better = error_here * allowed < error * allowed_here
        error = np.where(better, error_here, error)
        allowed = np.where(better, allowed_here, allowed)
        if (error <= allowed).all():
            break
    return slopes[0], error, allowed


def _taylor(
    problem: Problem, x: Array, fixed: Array, here: Linearization, rng: np.random.Generator
) -> tuple[Array, float | None]:
    """The errors of the linear model at each step, and the slope of their logarithms."""
    d = rng.standard_normal(x.size)
    d /= max(float(np.linalg.norm(d)), 1e-300)
    moved = np.array([problem.residual(x + h * d, fixed) for h in TAYLOR_STEPS])
    linear = TAYLOR_STEPS[:, None] * here.along(d)
    error = np.linalg.norm(moved - here.residual - linear, axis=1)
    rounding = 100 * EPS * (1 + float(np.linalg.norm(here.residual)) + here.norm)
    clear = np.isfinite(error) & (error > 10 * rounding)
    if clear.sum() < 3:
        return error, None
    # the smallest steps that rounding has not reached, where the slope is clearest
    log_h, log_error = np.log(TAYLOR_STEPS[clear])[-4:], np.log(error[clear])[-4:]
    return error, float(np.polyfit(log_h, log_error, 1)[0])


def _gradient_error(problem: Problem, x: Array, fixed: Array, here: Linearization) -> float:
    _, g = problem.cost_and_gradient(x, fixed)
    size = float(np.linalg.norm(here.column_norms) * np.linalg.norm(here.residual))
    return float(np.linalg.norm(g - here.gradient)) / max(size, 1e-300)


def _neglected(problem: Problem, x: Array, fixed: Array, here: Linearization) -> float | None:
    """None of a large problem, and of functions that have no second derivatives or no graph."""
    if x.size > MOST_UNKNOWNS_OF_HESSIAN or problem.size > MOST_ROWS_OF_HESSIAN or not x.size:
        return None
    try:
        H = dense(problem.hessian_at(x, fixed))
    except (RuntimeError, NotSupported):
        return None
    if not np.isfinite(H).all():
        return None
    return float(np.linalg.norm(H - dense(here.normal))) / max(float(np.linalg.norm(H)), 1e-300)
