"""Criterion, Quantity, d_optimal, a_optimal, e_optimal, sd_of: what should be known better by the
next measurement.
"""

import casadi as cs
import numpy as np

import workbench as wb

w = wb.Block("w", (3,), "m")


def seen_at(t: float) -> wb.Residual:
    """A parabola's value at t, measured to 1 cm."""
    return wb.Residual(f"at {t:g}", cs.DM(np.vander([t], 3)) @ w.symbol, sigma=0.01, unit="m")


problem = wb.Problem([seen_at(t) for t in (0.0, 0.4, 0.5, 0.6)], free=["w"], blocks=[w])
candidates = {f"at {t:g}": seen_at(t) for t in (-0.5, 0.2, 0.5, 1.0)}
beyond = wb.Quantity("the value at 1.5", cs.DM(np.vander([1.5], 3)) @ w.symbol, "m")
criteria: list[wb.Criterion] = [wb.d_optimal, wb.a_optimal, wb.e_optimal]
criteria += [wb.d_optimal.over("w[0]"), wb.sd_of("w[2]"), wb.sd_of(beyond)]
for criterion in criteria:
    one = wb.design(problem, candidates, {"w": np.zeros(3)}, criterion=criterion)
    print(f"{criterion.name}: {one.best}, {one.before.sd:.3g} -> {one.after.sd:.3g} {one.unit}")
