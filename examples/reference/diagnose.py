"""diagnose, Diagnosis, Direction, Finding, Suggestion: what a problem's data cannot see, in
names.
"""

import numpy as np

import workbench as wb

a, b = wb.Block("a", (), "m"), wb.Block("b", (), "m")
total = wb.Residual("total", a.symbol + b.symbol - 3.0, sigma=0.1, unit="m")
problem = wb.Problem([total], free=["a", "b"], blocks=[a, b])
diagnosis: wb.Diagnosis = wb.diagnose(problem, {"a": np.array(1.0), "b": np.array(2.0)})
print(diagnosis.rank, "of", problem.free.size)
unseen: wb.Direction = diagnosis.null_directions[0]
print(unseen.name, unseen.vector.round(3))
finding: wb.Finding = diagnosis.findings[0]
print("warning:" if finding.warning else "note:", finding.text)
advice: wb.Suggestion = diagnosis.suggestions[0]
print(advice.what, "- rank", advice.before.rank, "of", advice.before.unknowns, "before, and after:")
print(advice.after.rank, "of", advice.after.unknowns)
