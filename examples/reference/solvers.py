"""GaussNewton, LevenbergMarquardt, Dogleg, Newton, SteepestDescent, Ipopt, Sqp, Scipy, Nlopt: one
problem, solved by each of them.
"""

import numpy as np

import workbench as wb

w = wb.Block("w", (2,))
curve = wb.Residual("curve", w.symbol[1] - w.symbol[0] ** 2, sigma=1.0)
floor = wb.Residual("floor", 1 - w.symbol[0], sigma=1.0)
problem = wb.Problem([curve, floor], free=["w"], blocks=[w])
for solver in (
    wb.GaussNewton(),
    wb.LevenbergMarquardt(first_damping=0.1),
    wb.Dogleg(),
    wb.Newton(),
    wb.SteepestDescent(max_iterations=2_000),
    wb.Ipopt(),
    wb.Sqp(),
    wb.Scipy("trf"),
    wb.Nlopt("LD_LBFGS"),
):
    solution = wb.solve(problem, {"w": np.array([-1.2, 1.0])}, solver)
    print(f"{type(solver).__name__:18} {solution.status.name:10} {solution.values['w'].round(4)}")
