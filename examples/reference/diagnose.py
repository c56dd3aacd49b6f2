"""diagnose, Diagnosis: what a problem's data cannot see, in names."""

import numpy as np

import workbench as wb

a, b = wb.Block("a", (), "m"), wb.Block("b", (), "m")
total = wb.Residual("total", a.symbol + b.symbol - 3.0, sigma=0.1, unit="m")
problem = wb.Problem([total], free=["a", "b"], blocks=[a, b])
diagnosis: wb.Diagnosis = wb.diagnose(problem, {"a": np.array(1.0), "b": np.array(2.0)})
print(diagnosis.rank, "of", problem.free.size)
print(diagnosis)
