"""measures, measured: stature, lengths and girths of a body, as numbers and as symbols."""

import numpy as np

import workbench as wb

body = wb.load_body("small")
betas = np.array([1.0, -0.5, *np.zeros(body.n_betas - 2)])
for name, metres in wb.measured(body, betas).items():
    print(f"{name:15} {metres:.3f} m")

# as symbols they can be constrained: the person nearest to the mean whose waist is 0.9 m
waist = wb.measures(body)["waist"]
shape = waist.blocks[0]
mean = wb.Residual("mean", shape.symbol, sigma=1.0)
held = wb.Constraint("waist", waist.expression, lower=0.9, upper=0.9, unit="m")
problem = wb.Problem([mean], free=["betas"], blocks=[shape], constraints=[held])
found = wb.solve(problem, {"betas": np.zeros(body.n_betas)}, wb.Ipopt())
print(wb.measured(body, found.values["betas"])["waist"].round(4))
