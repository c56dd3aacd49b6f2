"""Trust regions that measure steps by the columns of the Jacobian."""

import casadi as cs
import numpy as np
import pytest

import workbench.solvers.trust_region as module
from workbench import Block, Linearization, Problem, Residual, TrustRegion
from workbench.solvers.scaling import Metric, columns


def test_steps_measured_by_columns_do_not_depend_on_units(monkeypatch: pytest.MonkeyPatch) -> None:
    """An attempt that measures steps by columns visits the same points in grams and in tons."""
    monkeypatch.setattr(module, "WAYS", ((columns, 0.1),))
    x, unit = Block("x", (2,)), np.array([1000.0, 0.01])
    ends = []
    for factors in (np.ones(2), unit):
        a, b = cs.vertsplit(x.symbol * cs.DM(factors))
        rows = cs.vertcat(10 * (b - a**2), 1 - a)
        problem = Problem((Residual("rosenbrock", rows, 1.0),), ("x",), blocks=(x,))
        ends.append(TrustRegion(attempts=1).solve(problem, {"x": np.array([-1.2, 1]) / factors}))
    costs, theirs = ([one.cost for one in end.trace] for end in ends)
    np.testing.assert_allclose(costs[:20], theirs[:20], rtol=1e-5)
    assert ends[1].converged
    solver, D = TrustRegion(first_radius=0.5, attempts=1), np.array([3.0, 4.0])
    assert solver._first_radius(np.ones(2), D) == pytest.approx(0.5 * 5 / np.sqrt(2))


def test_a_metric_never_gets_shorter() -> None:
    """Of a point whose columns have lengths of 3 and 1, then of one with 2 and 5."""
    metric = Metric(columns)
    for lengths, expected in (((3.0, 1.0), (3, 1)), ((2.0, 5.0), (3, 5)), ((0.0, 1.0), (3, 5))):
        np.testing.assert_array_equal(
            metric.at(Linearization(np.zeros(2), np.diag(lengths))), expected
        )
