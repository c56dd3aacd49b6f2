"""compare, Comparison, Budget, Record, TargetOutcome: solvers on the same problem, from the
same starts.
"""

import workbench as wb

comparison: wb.Comparison = wb.compare(
    "nist-misra1a",
    ["levenberg-marquardt", "dogleg"],
    seeds=2,
    budget=wb.Budget(max_evaluations=500, max_seconds=30.0),
)
print(comparison.solvers, len(comparison.records), "runs")
for (instance, solver), outcome in comparison.outcomes.items():
    record: wb.Record = comparison.records[instance, solver]
    missed = outcome is not wb.TargetOutcome.REACHED
    print(instance, solver, f"{record.cost:.3e}", "missed" if missed else "reached the target")
