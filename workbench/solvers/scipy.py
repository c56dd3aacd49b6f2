"""SciPy's least squares, as a reference: its steps, our counters, our best point, our judge."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.optimize

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.errors import UnknownName
from workbench.problem import Problem
from workbench.problem.storage import Stored, columns_of, dense, stacked, unblocked
from workbench.solvers.abilities import Abilities, Boxes, Derivative, refuse
from workbench.solvers.run import Run
from workbench.solvers.scaling import Scaling, identity
from workbench.solvers.solution import Callback, Solution, Status

METHODS = {
    "trf": Abilities(Derivative.JACOBIAN, Boxes.TAKEN, source="Branch, Coleman and Li 1999; SciPy"),
    "dogbox": Abilities(Derivative.JACOBIAN, Boxes.TAKEN, source="Voglis and Lagaris 2004; SciPy"),
    "lm": Abilities(Derivative.JACOBIAN, Boxes.UNKNOWN, source="Moré 1978 (MINPACK); SciPy"),
}
TOLERANCE = 1e-15  # of SciPy's own rules, so that ours is asked first


@dataclass(frozen=True)
class Scipy:
    """`scipy.optimize.least_squares` by the name of its method: trf, dogbox or lm.

    `scaling` is asked once, at the start. Raises UnknownName for another method.
    """

    method: str = "trf"
    scaling: Scaling = identity
    max_iterations: int = 1_000
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UnknownName("method of SciPy", self.method, METHODS)

    @property
    def abilities(self) -> Abilities:
        """As the table has them."""
        return METHODS[self.method]

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver. Bounds are honoured by trf and dogbox, and the start is moved inside them."""
        name = f"scipy {self.method}"
        refuse(name, self.abilities, problem)
        with Run(name, self, problem, start, callback) as run:
            x0 = np.clip(run.x, problem.lower, problem.upper)
            loose = problem.lower < problem.upper  # SciPy takes no bounds that are equal
            functions = _Functions(run, x0, loose)
            D = self.scaling(functions.here)[loose]
            answer: Any = scipy.optimize.least_squares(
                functions.residual,
                x0[loose],
                functions.dense_jacobian if self.method == "lm" else functions.jacobian,
                bounds=(problem.lower[loose], problem.upper[loose]),
                method=self.method,  # type: ignore[arg-type]  # one of METHODS
                x_scale=1 / D,
                ftol=TOLERANCE,
                xtol=TOLERANCE,
                gtol=TOLERANCE,
                max_nfev=2 * self.max_evaluations,
            )
            run.stall(f"{Status.STALLED.value} (scipy: {answer.message})")
        return run.solution()


class _Functions:
    """Residual and Jacobian as SciPy asks for them, in the entries whose bounds leave them loose.

    MINPACK wants as many rows as columns, so there are zeros below. A residual that is not finite
    becomes the largest seen, ten times: MINPACK believes a NaN.
    """

    def __init__(self, run: Run, x0: Array, loose: Mask) -> None:
        self.run, self.x0, self.loose = run, x0, loose
        self.here = run.linearize(x0)
        self._known: Array | None = x0
        run.record(x0, self.here.cost, run.optimality(x0, self.here))
        self._padding = max(0, int(loose.sum()) - self.here.shape[0])
        self._largest = self.here.residual

    def residual(self, free: Array) -> Array:
        x = self._whole(free)
        if self._known is not None and np.array_equal(x, self._known):
            r = self.here.residual
        else:
            cost, r = self.run.cost_and_residual(x)
            if not np.isfinite(cost):
                r = 10 * np.abs(self._largest) + 1
            elif r @ r > self._largest @ self._largest:
                self._largest = r
        return np.append(r, np.zeros(self._padding))

    def jacobian(self, free: Array) -> Stored:
        x = self._whole(free)
        if self._known is None or not np.array_equal(x, self._known):
            self.here, self._known = self.run.linearize(x), x
            self.run.record(x, self.here.cost, self.run.optimality(x, self.here))
        J = columns_of(self.here.jacobian, self.loose)
        return unblocked(stacked(J, np.zeros((self._padding, J.shape[1])))) if self._padding else J

    def dense_jacobian(self, free: Array) -> Array:
        return dense(self.jacobian(free))

    def _whole(self, free: Array) -> Array:
        x = self.x0.copy()
        x[self.loose] = free
        return x
