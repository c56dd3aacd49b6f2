"""TrustRegion: the default solver, from a small and from a large first radius."""

import numpy as np

import workbench as wb

w = wb.Block("w", (2,))
curve = wb.Residual("curve", 10 * (w.symbol[1] - w.symbol[0] ** 2), sigma=1.0)
floor = wb.Residual("floor", 1 - w.symbol[0], sigma=1.0)
problem = wb.Problem([curve, floor], free=["w"], blocks=[w])
for radius in (0.01, 1.0, 100.0):
    solution = wb.solve(problem, {"w": np.array([-1.2, 1.0])}, wb.TrustRegion(first_radius=radius))
    lengths = [round(iterate.step_norm, 3) for iterate in solution.trace[1:5]]
    print(f"first radius {radius:6}: {solution.iterations} iterations, first steps {lengths}")
