"""compare, Comparison, Budget: solvers on the same problem, from the same starts."""

import workbench as wb

comparison: wb.Comparison = wb.compare(
    "nist-misra1a",
    ["levenberg-marquardt", "dogleg"],
    seeds=2,
    budget=wb.Budget(max_evaluations=500, max_seconds=30.0),
)
print(comparison.solvers, len(comparison.records), "runs")
for (instance, solver), record in comparison.records.items():
    print(instance, solver, record.ending.name, f"{record.cost:.3e}")
