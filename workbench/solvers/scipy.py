"""SciPy's least-squares solvers, for comparison; a run counts, keeps the best point and judges."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.optimize

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.errors import check_known
from workbench.problem import Problem
from workbench.problem.storage import Stored, columns_of, dense, stacked, unblocked
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.limits import Limits
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution, Status
from workbench.solvers.trust_region import Scaling, identity

METHODS = {
    name: Abilities(Derivative.JACOBIAN, boxes, source=source)
    for name, boxes, source in (
        ("trf", Boxes.TAKEN, "Branch, Coleman and Li 1999; SciPy"),
        ("dogbox", Boxes.TAKEN, "Voglis and Lagaris 2004; SciPy"),
        ("lm", Boxes.REFUSED, "Moré 1978 (MINPACK); SciPy"),
    )
}
TOLERANCE = 1e-15  # of SciPy's own rules, so that ours is asked first


@dataclass(frozen=True)
class Scipy(Limits):
    """A method of `scipy.optimize.least_squares`. Raises UnknownName for any other method.

    Attributes:
        method: `trf` (Branch, Coleman and Li, A subspace, interior, and conjugate gradient method
            for large-scale bound-constrained minimization problems, 1999), `dogbox` (Voglis and
            Lagaris, 2004) or `lm` (Moré, The Levenberg-Marquardt algorithm: implementation and
            theory, 1978).
        scaling: the metric D of a step, computed once, at the start. `identity`: a radian, a metre
            and a standard deviation count the same; `columns`: units do not matter.
    """

    method: str = "trf"
    scaling: Scaling = identity

    def __post_init__(self) -> None:
        super().__post_init__()
        check_known("method of SciPy", self.method, METHODS)

    @property
    def abilities(self) -> Abilities:
        """The entry of `METHODS`."""
        return METHODS[self.method]

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`, which is moved inside the bounds; see `Solver`.

        Raises NotSupported for constraints, and for bounds if the method is `lm`.
        """
        name = f"scipy {self.method}"
        with Run(name, self, problem, start, callback) as run:
            loose = problem.lower < problem.upper  # SciPy takes no bounds that are equal
            functions = _Functions(run, loose, dense=self.method == "lm")
            D = self.scaling(run.linearize(run.x))[loose]
            answer: Any = scipy.optimize.least_squares(
                functions.residual,
                run.x[loose],
                functions.jacobian,
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
    """Residual and Jacobian as SciPy asks for them, in the `loose` entries.

    MINPACK needs as many rows as columns, and does not notice a NaN: it gets zeros below, and ten
    times the largest residual so far.
    """

    def __init__(self, run: Run, loose: Mask, dense: bool) -> None:
        self._run, self._loose, self._dense = run, loose, dense
        here = run.begin()
        self._at = run.x
        self._padding = max(0, int(loose.sum()) - here.shape[0])
        self._largest = here.residual

    def residual(self, free: Array) -> Array:
        """The residual (m,) and zeros below it."""
        cost, r = self._run.cost_and_residual(self._whole(free))
        if not np.isfinite(cost):
            r = 10 * np.abs(self._largest) + 1
        elif r @ r > self._largest @ self._largest:
            self._largest = r
        return np.append(r, np.zeros(self._padding))

    def jacobian(self, free: Array) -> Stored:
        """The Jacobian (m, n) and zeros below it. Another point than before is an iterate."""
        x = self._whole(free)
        here = self._run.linearize(x)
        if not np.array_equal(x, self._at):
            self._at = x
            self._run.record(x, here.cost, here)
        J = columns_of(here.jacobian, self._loose)
        if self._padding:
            J = unblocked(stacked(J, np.zeros((self._padding, J.shape[1]))))
        return dense(J) if self._dense else J

    def _whole(self, free: Array) -> Array:
        x = self._run.x.copy()
        x[self._loose] = free
        return x
