"""Symmetric matrices made positive definite, and by how much they are changed for that."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, diags_array

from workbench.arrays import Array
from workbench.problem.steps import factorized
from workbench.problem.storage import Stored

LEAST = 1e-8  # of the largest eigenvalue: the least that a direction's curvature is taken for
SHARES = (0.0, 1 / 64, 1 / 16, 1 / 4)  # of what is certain to be enough, tried in this order


class Convex(NamedTuple):
    """A positive definite matrix (n, n), and by how much it was changed to become one."""

    matrix: Array
    change: float


class Raised(NamedTuple):
    """A sparse positive definite matrix (n, n), and the share of what is certain to be enough."""

    matrix: csc_array
    share: float


Convexify = Callable[[Array], Convex]


def shifted(H: Array) -> Convex:
    """H + tau I (n, n) with the smallest tau >= 0 that makes it positive definite.

    No eigenvalue is then below 1e-8 of the largest absolute one (Nocedal and Wright, Numerical
    Optimization, 2006, section 3.4).
    """
    values = np.linalg.eigvalsh(H)
    tau = max(0.0, LEAST * float(np.abs(values).max(initial=1e-300)) - float(values.min()))
    return Convex(H + tau * np.eye(len(H)), tau)


def reflected(H: Array) -> Convex:
    """H (n, n) with the absolute values of its eigenvalues, so that steps lead away from saddles.

    No eigenvalue is then below 1e-8 of the largest (Nocedal and Wright, Numerical Optimization,
    2006, section 3.4).
    """
    values, vectors = np.linalg.eigh(H)
    least = LEAST * float(np.abs(values).max(initial=1e-300))
    if values.min() >= least:
        return Convex(H, 0.0)
    positive = np.maximum(np.abs(values), least)
    return Convex((vectors * positive) @ vectors.T, float(np.max(positive - values)))


def raised(normal: Stored, H: Stored) -> Raised:
    """A sparse H with its diagonal raised until Cholesky's factorization of it exists.

    H is the sum of J'J, which has no negative curvature, and of a rest N. By Gershgorin's theorem
    N has none once e_i = max(0, sum over j != i of |N_ij| - N_ii) is added to its diagonal, for
    its rows are then dominated by their diagonal entries. So H + diag(e) is positive semidefinite,
    whatever J'J is. What is returned is H + t diag(e) with the first t of 0, 1/64, 1/16, 1/4 for
    which Cholesky's factorization tells that this is positive definite (Nocedal and Wright,
    Numerical optimization, 2006, algorithm 3.3, raises the diagonal step by step in the same way),
    else with t = 1. A further 1e-8 of the largest diagonal entry of J'J is added to the diagonal,
    so that a singular matrix does not pass for a definite one.
    """
    H, normal = csc_array(H), csc_array(normal)
    N = csc_array(H - normal)
    largest = float(abs(normal.diagonal()).max(initial=0.0))
    least = (LEAST * largest or LEAST) * np.ones(H.shape[0])
    own = N.diagonal()
    lacking = np.maximum(0.0, np.asarray(abs(N).sum(axis=0)) - abs(own) - own)
    if not lacking.any():
        return Raised(csc_array(H + diags_array(least)), 0.0)
    for share in SHARES:
        found = csc_array(H + diags_array(least + share * lacking))
        if factorized(found) is not None:
            return Raised(found, share)
    return Raised(csc_array(H + diags_array(least + lacking)), 1.0)
