"""Residual, residuals: error terms with a unit, and the size of an ordinary error."""

import numpy as np

import workbench as wb

x = wb.Block("x", (2,), "m")
near = wb.Residual("near the goal", x.symbol - np.array([3.0, 4.0]), sigma=0.5, unit="m")
small = wb.residuals.gaussian(x.symbol, covariance=1.0)
problem = wb.Problem([near, small], free=["x"], blocks=[x])
here = problem.linearize({"x": np.zeros(2)})
print(here.residual)  # in sigmas
print(wb.solve(problem, {"x": np.zeros(2)}).values["x"])
