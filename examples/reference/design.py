"""design, MeasurementDesign, Candidate: what to measure next, and how well everything will be
known then.
"""

import casadi as cs
import numpy as np

import workbench as wb

w = wb.Block("w", (3,), "m")


def seen_at(t: float) -> wb.Residual:
    """A parabola's value at t, measured to 1 cm."""
    return wb.Residual(f"at {t:g}", cs.DM(np.vander([t], 3)) @ w.symbol, sigma=0.01, unit="m")


problem = wb.Problem([seen_at(t) for t in (0.0, 0.4, 0.5, 0.6)], free=["w"], blocks=[w])
candidates = {f"at {t:g}": seen_at(t) for t in (0.2, 0.8, 1.0)}
candidates["both ends"] = wb.Candidate((seen_at(0.0), seen_at(1.0)))
found: wb.MeasurementDesign = wb.design(problem, candidates, {"w": np.zeros(3)}, choose=2)
print(found.report())
