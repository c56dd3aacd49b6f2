"""Levenberg and Marquardt's damping: how it follows the gain, also in solvers of others."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, eye_array

from workbench.arrays import Array
from workbench.problem import Linearization
from workbench.problem.storage import Stored, unblocked
from workbench.solvers.run import Run
from workbench.solvers.trust_radius import first_radius

FASTEST_FALL = 0.1  # of the damping in one step; the paper's 1/3 needs 4 more on a noiseless body
RISE, RISES = 4.0, 8  # of the damping for each step that was tried in vain, and how many count
SMALLEST, LARGEST = 1e-12, 1e3  # of the largest diagonal entry: below the smallest there is none
AGAIN = 1e-6  # from which on it rises, if it was below


def eased(gain_ratio: float) -> float:
    """The factor of the damping after a step with a gain ratio above zero, from 0.1 to 2.

    See Nielsen, Damping parameter in Marquardt's method, 1999.
    """
    return float(max(FASTEST_FALL, 1 - (2 * gain_ratio - 1) ** 3))


@dataclass(frozen=True)
class Damped:
    """Gauss and Newton's Hessian, damped: J'J + damping d I, with d the largest entry of J'J.

    It is for solvers that take a Hessian and have a line search. Where J'J is nearly singular,
    their steps are so long that the line search cuts nearly all of each, whereas a damped step is
    short in the weak directions alone. The damping rises if the line search evaluated the cost more
    than once since the last Hessian, which means that it cut the step; otherwise it follows the
    gain ratio, as that of Levenberg and Marquardt does (Madsen, Nielsen and Tingleff, Methods for
    non-linear least squares problems, 2004, section 3.2). It vanishes at the solution of a problem
    that Gauss and Newton's method solves. At the start it is raised until the damped step is no
    longer than the first radius (see `trust_radius`), so that the first step does not leap. With
    constraints there is no damping, for a line search then cuts steps for the sake of the
    constraints, too, and the first step is as long as they allow.

    Attributes:
        first_damping: the least damping at the start, as a share of the largest entry of J'J.
    """

    first_damping: float = 1e-3

    def along(self, run: Run) -> "DampedHessian":
        """A function that gives the damped Hessian in one run, and remembers its damping."""
        constrained = run.problem.stacked_constraints is not None
        return DampedHessian(run, 0.0 if constrained else self.first_damping)


DAMPED = Damped()


class DampedHessian:
    """A function of x (n,) and of multipliers, which it does not read, to the Hessian (n, n)."""

    def __init__(self, run: Run, first_damping: float) -> None:
        self._run, self._damping, self._damped = run, first_damping, first_damping > 0
        self._last: Last | None = None

    def __call__(self, x: Array, multipliers: Array) -> Stored:
        """The Hessian at x; the damping follows what happened since the last one."""
        here = self._run.linearize(x)
        if not self._damped:
            return unblocked(here.normal)
        largest = float(here.column_norms.max(initial=0.0) ** 2)
        if self._last is not None:
            if np.array_equal(x, self._last.x):
                return self._last.hessian
            damping = min(self._next(self._last, x, here), LARGEST)
            self._damping = damping if damping > SMALLEST else 0.0
        else:
            radius = first_radius(x, np.ones_like(x))
            while self._damping < LARGEST and not _length(here, self._damping * largest) <= radius:
                self._damping *= 2.0
        H = _raised(unblocked(here.normal), self._damping * largest)
        self._last = Last(x.copy(), here.cost, here.gradient, H, self._tried)
        return H

    @property
    def _tried(self) -> int:
        return self._run.meter.counts["residual"] + self._run.one_pass.at_once

    def _next(self, last: "Last", x: Array, here: Linearization) -> float:
        """The damping after the step from the last point to x."""
        cut = self._tried - last.tried - 1
        if cut > 0:
            return max(self._damping, AGAIN) * RISE ** min(cut, RISES)
        p = x - last.x
        predicted = -float(last.gradient @ p) - 0.5 * float(p @ (last.hessian @ p))
        if predicted <= 0:  # the step was not to lower the cost, but to meet constraints
            return self._damping
        if self._run.rounding_noise.hides(predicted, x, here):
            return self._damping * FASTEST_FALL
        gain_ratio = (last.cost - here.cost) / predicted
        return self._damping * (eased(gain_ratio) if gain_ratio > 0 else 2.0)


class Last(NamedTuple):
    """The point at which the last Hessian was asked for.

    Attributes:
        x: (n,) the point.
        cost: the cost there.
        gradient: (n,) its gradient.
        hessian: (n, n) the damped Hessian there.
        tried: how many trials there had been.
    """

    x: Array
    cost: float
    gradient: Array
    hessian: Stored
    tried: int


def _length(here: Linearization, damping: float) -> float:
    """The length of the damped step."""
    return float(np.linalg.norm(here.step(damping)))


def _raised(normal: Stored, by: float) -> Stored:
    if isinstance(normal, csc_array):
        return csc_array(normal + by * eye_array(normal.shape[0]))
    return normal + by * np.eye(len(normal))
