"""Problem, Linearization: residuals with some names free, and how they look at one point."""

import numpy as np

import workbench as wb

t, y = np.linspace(0, 1, 5), np.array([0.9, 1.6, 2.1, 2.4, 3.1])
line = wb.Block("line", (2,), labels=("offset", "slope"))
fitted = line.symbol[0] + line.symbol[1] * t
problem = wb.Problem([wb.Residual("data", fitted - y, sigma=0.1)], free=["line"], blocks=[line])
here = problem.linearize({"line": np.zeros(2)})
print("residual", here.residual.shape, "Jacobian", here.jacobian.shape, "rank", here.rank)
print("cost", here.cost, "gradient", here.gradient)
print("a Gauss-Newton step", here.step())
print("sigmas", np.sqrt(np.diag(here.covariance)))
