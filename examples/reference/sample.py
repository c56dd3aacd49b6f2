"""sample, laplace, Posterior: draws from a posterior, and its Gaussian approximation."""

import casadi as ca
import numpy as np

import workbench as wb

x = wb.Block("x", (1,))
data = wb.Residual("data", ca.exp(x.symbol) - 1.0, sigma=0.5)
prior = wb.residuals.gaussian(x.symbol, covariance=1.0)
problem = wb.Problem([data, prior], free=["x"], blocks=[x])
at = wb.solve(problem, {"x": np.array([0.5])}).values
drawn: wb.Posterior = wb.sample(problem, at, seed=0, steps=2_000)
gauss = wb.laplace(problem, at, seed=0)
for posterior in (drawn, gauss):
    print(f"{posterior.method}: {posterior.mean[0]:.2f} +- {posterior.sd[0]:.2f}")
