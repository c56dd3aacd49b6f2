"""solve, Solution, Status, SOLVERS, Iterate, Evaluations: a problem solved, and what is known of
the run.
"""

import numpy as np

import workbench as wb

w = wb.Block("w", (2,))
valley = [
    wb.Residual("curve", 10 * (w.symbol[1] - w.symbol[0] ** 2), sigma=1.0),
    wb.Residual("floor", 1 - w.symbol[0], sigma=1.0),
]
problem = wb.Problem(valley, free=["w"], blocks=[w])
solution: wb.Solution = wb.solve(problem, {"w": np.array([-1.2, 1.0])})
print(solution.status is wb.Status.CONVERGED, solution.values["w"], solution.iterations)
second: wb.Iterate = solution.trace[1]  # the trace has every point that the solver visited
asked: wb.Evaluations = second.evaluations
print(round(second.cost, 3), asked.residual, "residuals,", asked.jacobian, "Jacobians")
print(wb.solve(problem, {"w": np.array([-1.2, 1.0])}, wb.SOLVERS["scipy-trf"]).status.name)
