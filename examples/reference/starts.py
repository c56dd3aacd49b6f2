"""Starts, Spread, Hypothesis: a sum of sines has several minima, and each start finds one."""

import casadi as cs
import numpy as np

import workbench as wb

times = np.linspace(0, 3, 40)
omega = wb.Block("omega", (), "rad/s")
seen = np.sin(4.0 * times)
wave = wb.Residual("wave", cs.sin(omega.symbol * times) - seen, sigma=0.1)
problem = wb.Problem([wave], ["omega"], blocks=[omega])
start = {"omega": np.array(9.0)}
print("one start:", wb.solve(problem, start).values["omega"])
solution = wb.solve(problem, start, wb.Starts(20, draw=wb.Spread({"omega": 4.0})))
print("twenty starts:", solution.values["omega"])
print(solution.message)
hypothesis: wb.Hypothesis
for hypothesis in solution.hypotheses:
    found = f"omega {hypothesis.values['omega']:7.3f}, cost {hypothesis.cost:8.3g}"
    print(f"{found}, from starts {sorted(hypothesis.starts)}")
