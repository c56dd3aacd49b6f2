"""A problem is residuals and a choice of free names: here a cubic through noisy points.

There is no body in it. The same five lines take any formula, and every solver takes the problem.
"""

import numpy as np

import workbench as wb

rng = np.random.default_rng(0)
truth = np.array([1.0, -2.0, 0.5, 0.25])
times = np.linspace(-2, 2, 40)
heights = np.polyval(truth[::-1], times) + 0.1 * rng.standard_normal(times.size)

t, y, w = wb.Block("t", (40,), "s"), wb.Block("y", (40,), "m"), wb.Block("w", (4,))
cubic = sum(w.symbol[k] * t.symbol**k for k in range(4))
residual = wb.Residual("cubic", cubic - y.symbol, sigma=0.1, unit="m")
problem = wb.Problem([residual], free=["w"], blocks=[t, y, w])
start = {"w": np.zeros(4), "t": times, "y": heights}
solution = wb.solve(problem, start)

here = problem.linearize(start | solution.values)
spread = np.sqrt(np.diag(here.covariance))

if __name__ == "__main__":
    print(solution.status.name, "after", solution.iterations, "iterations")
    for k in range(4):
        print(f"w[{k}] = {solution.values['w'][k]:+.3f} +- {spread[k]:.3f}, true {truth[k]:+.3f}")
