"""Derivatives by differences, and complaints that say which entry is wrong."""

from collections.abc import Callable

import numpy as np

from workbench import Problem

Array = np.ndarray
FIRST_STEP, HALVINGS = 2e-3, 7


def differences(f: Callable[[Array], Array], x: Array) -> Array:
    """df/dx (m, n) by central differences, extrapolated to a step of zero.

    Ridders' method (Advances in Engineering Software 4(2), 1982): Neville's tableau over halved
    steps, and for each entry the place in it that agrees best with its neighbours.
    """
    columns = []
    for i in range(x.size):
        h = np.zeros_like(x)
        h[i] = FIRST_STEP * max(1.0, abs(x[i]) / 50)  # pixels come in hundreds
        best, least = np.zeros(0), np.zeros(0)
        above: list[Array] = []
        for _ in range(HALVINGS + 1):
            row = [(f(x + h) - f(x - h)) / (2 * h[i])]
            for j, neighbour in enumerate(above, start=1):
                row.append(row[-1] + (row[-1] - neighbour) / (4**j - 1))
                error = np.maximum(abs(row[j] - row[j - 1]), abs(row[j] - neighbour))
                if best.size == 0:
                    best, least = row[j], error
                best, least = np.where(error < least, row[j], best), np.minimum(error, least)
            above, h = row, h / 2
        columns.append(best)
    return np.column_stack(columns)


def assert_jacobian(problem: Problem, x: Array, fixed: Array, tolerance: float) -> None:
    """The problem's Jacobian is that of differences, within `tolerance` of its largest entry."""
    J = problem.linearize_at(x, fixed).jacobian
    expected = differences(lambda x: problem.residual(x, fixed), x)
    off = np.abs(J - expected) > tolerance * max(1.0, np.abs(expected).max())
    wrong = [
        f"d {problem.row_label(row)} / d {problem.free.label(column)}: "
        f"{J[row, column]:.9g}, by differences {expected[row, column]:.9g}"
        for row, column in np.argwhere(off | ~np.isfinite(J))
    ]
    assert not wrong, "\n".join(wrong[:10])


def assert_hessian(problem: Problem, x: Array, fixed: Array, tolerance: float) -> None:
    """The exact Hessian of the cost is the derivative of its gradient."""
    H = problem.hessian_at(x, fixed)
    expected = differences(lambda x: problem.cost_and_gradient(x, fixed)[1], x)
    off = np.abs(H - expected) > tolerance * max(1.0, np.abs(expected).max())
    wrong = [
        f"d2 cost / d {problem.free.label(i)} d {problem.free.label(j)}: "
        f"{H[i, j]:.9g}, by differences {expected[i, j]:.9g}"
        for i, j in np.argwhere(off | ~np.isfinite(H))
    ]
    assert not wrong, "\n".join(wrong[:10])
