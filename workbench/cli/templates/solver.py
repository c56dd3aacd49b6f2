"""Where do an exponential curve and a line meet? A small problem to try a solver on."""

# A solver of your own. All commands take this file as a solver, and as a problem too:
#
#     workbench run NAME.py --solver NAME.py         solve the problem with it, and write a page
#     workbench diagnose NAME.py --solver NAME.py    diagnose where it ended
#     workbench compare NAME.py --solver NAME.py --solver trust-region
#     workbench sample NAME.py --solver NAME.py      draw from the posterior around its answer
#
# Compare it on problems that are not its own: workbench compare nist --solver NAME.py ...

from dataclasses import dataclass

import casadi as cs
import numpy as np

import workbench as wb
from workbench.solvers import Boxes, Callback, Derivative, Limits, Run


# 1. The options are the fields of a frozen dataclass. It derives from `Limits`, whose four fields
#    `Run` reads: every solver stops for the same reasons, and *converged* means the same for all.
@dataclass(frozen=True)
class Damped(Limits):
    """Levenberg's method (1944): (J'J + mu I) p = -J'r, with mu smaller after a success.

    Attributes:
        damping: the first mu.
    """

    damping: float = 1.0

    # 2. What it needs and takes. A problem with bounds or constraints is refused in a sentence.
    @property
    def abilities(self) -> wb.Abilities:
        """It needs a Jacobian, and takes no bounds."""
        return wb.Abilities(Derivative.JACOBIAN, Boxes.REFUSED, source="Levenberg 1944")

    # 3. The algorithm, on flat vectors x (n,) of all free numbers. `run.begin()` and `run.move(x)`
    #    linearize, add an iterate to the trace, and end the run when it has converged, a limit is
    #    reached or somebody presses Ctrl-C. The best point is kept, however the run ends.
    def solve(
        self, problem: wb.Problem, start: wb.Values, *, callback: Callback = None
    ) -> wb.Solution:
        """Solve from `start`; see `wb.Solver`. Raises NotSupported for bounds or constraints."""
        with Run("NAME", self, problem, start, callback) as run:
            x, here = run.x, run.begin()  # here.residual, here.jacobian, here.gradient, here.cost
            damping = self.damping
            while True:
                # (n,); the solvers of workbench have an option for its factorization instead
                step = here.step(damping)
                if np.array_equal(x + step, x):
                    run.stall("the step is too short to change any number")
                if run.cost(x + step) < here.cost:
                    x, here = run.move(x + step, damping)
                    damping = max(damping / 3, 1e-12)
                else:
                    damping *= 2
        return run.solution()


solver: wb.Solver = Damped()

# 4. A problem to try it on. It is not needed where the file is given as a solver alone.
x = wb.Block("x", (2,), labels=("across", "up"))
across, up = x.symbol[0], x.symbol[1]
curves = wb.Residual("curves", cs.vertcat(up - cs.exp(across), up + across - 3.0), sigma=0.1)
problem = wb.Problem([curves], free=["x"], blocks=[x])
start: wb.Values = {"x": np.array([3.0, 1.0])}

if __name__ == "__main__":  # `python NAME.py`
    solution = wb.solve(problem, start, solver)
    print(solution.status.name, solution.values["x"], len(solution.trace) - 1, "steps")
