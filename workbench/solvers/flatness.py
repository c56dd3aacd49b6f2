"""Whether the cost hardly depends on some combination of unknowns at a minimum, in words."""

import numpy as np
import scipy.linalg

from workbench.arrays import Array
from workbench.blocks.directions import in_units
from workbench.problem import Linearization, Problem
from workbench.problem.steps import EPS
from workbench.solvers.ended import NAMED
from workbench.solvers.saddle import random_vector

MOST = 300  # unknowns: with more, singular values take too long
SUSPECT = 1e-6  # of the largest singular value: what J'J cannot tell from zero
CLEARLY = 1e-6  # an eigenvalue above this one is far from zero, and no inverse iteration needed
ROUNDS = 2  # of inverse iteration, each of which gains at least three digits


def flat_in_words(problem: Problem, x: Array, here: Linearization) -> str:
    """Which direction changes no residual at x (n,), or how many; empty if none does.

    Zero columns, unknowns on bounds, and problems with constraints are left out. Singular values
    are computed only if inverse iteration with J'J finds that the least one may be zero (Golub and
    Van Loan, Matrix Computations, 2013, section 7.6.1).
    """
    inside = (here.column_norms > 0) & (x > problem.lower) & (x < problem.upper)
    n = int(inside.sum())
    if here.constraints is not None or here.estimated or not 0 < n <= MOST:
        return ""
    lengths, normal = here.column_norms[inside], np.asarray(here.normal)
    normal = normal if n == len(x) else normal[np.ix_(inside, inside)]
    normal = normal / np.outer(lengths, lengths)
    if not _suspect(normal):
        return ""
    unit = here.columns(np.flatnonzero(inside)).scaled(1 / lengths)
    null = n - unit.rank
    if null == 0:
        return ""
    so = "so that other values fit as well"
    if null > 1:
        return f" ({null} directions change no residual here, {so}; a diagnosis names them)"
    direction = np.zeros(len(x))
    direction[inside] = np.linalg.svd(unit.unit_triangle)[2][-1] / lengths
    along = in_units(direction, problem.free, here.column_norms, NAMED)
    return f" (the cost hardly depends on {along}, {so})"


def _suspect(normal: Array) -> bool:
    """Whether the least eigenvalue of J'J, its diagonal being 1, is zero up to its rounding."""
    n = len(normal)
    if not _factor(normal, -CLEARLY)[1]:
        return False
    L, failed = _factor(normal, 10 * n * EPS)
    if failed:
        return True
    v = random_vector(n)
    for _ in range(ROUNDS):
        v = scipy.linalg.lapack.dpotrs(L, v / np.linalg.norm(v), lower=True)[0]
    v /= np.linalg.norm(v)
    return bool(v @ normal @ v <= SUSPECT**2 * n + 100 * n * EPS)


def _factor(normal: Array, raised: float) -> tuple[Array, int]:
    """The Cholesky factor of a matrix (n, n) plus `raised` I, and a number that is 0 if it exists.

    It exists, up to rounding, if no eigenvalue of the matrix is below -raised.
    """
    A = normal.copy()
    np.einsum("ii->i", A)[:] += raised
    L, failed = scipy.linalg.lapack.dpotrf(A, lower=True)
    return L, int(failed)
