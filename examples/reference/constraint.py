"""Constraint: what a solution must hold to, between two limits."""

import numpy as np

import workbench as wb

x = wb.Block("x", (2,), "m")
goal = wb.Residual("goal", x.symbol - np.array([2.0, 1.0]), sigma=0.1, unit="m")
circle = wb.Constraint("circle", x.symbol[0] ** 2 + x.symbol[1] ** 2, upper=1.0, unit="m^2")
problem = wb.Problem([goal], free=["x"], blocks=[x], constraints=[circle])
solution = wb.solve(problem, {"x": np.zeros(2)}, wb.Ipopt())
print(solution.status.name, solution.values["x"].round(3))
