"""Bounds and constraints that hold at a point decide directions, and a diagnosis says so."""

import casadi as cs
import numpy as np
import pytest

from workbench import (
    Block,
    Constraint,
    Diagnosis,
    Problem,
    Residual,
    Sqp,
    diagnose,
    solve,
)
from workbench.diagnostics.identifiability import EntryIdentifiability

X = Block("x", (2,))
SUM = Residual("sum", X.symbol[0] + X.symbol[1] - 1, 0.1)


def at(*constraints: Constraint, x: tuple[float, float] = (0.5, 0.5)) -> Diagnosis:
    return diagnose(Problem([SUM], "x", constraints=constraints), {"x": np.array(x)})


def test_an_equation_supplies_a_direction() -> None:
    d = at(Constraint("equal", X.symbol[0] - X.symbol[1], 0, 0))
    assert d.rank == d.structural_rank == 2
    assert d.null_directions == ()
    assert d.condition == pytest.approx(1.0)  # one direction is left
    # x + y is known to 0.1, and x = y: each to 0.05
    np.testing.assert_allclose(d.identifiability.sigma, 0.05, rtol=1e-12)
    assert d.identifiability.verdicts == (EntryIdentifiability.IDENTIFIED,) * 2
    assert not d.warnings
    for said in (str(d), d.report()):
        assert "active constraints (equal) fix 1 direction" in said
        assert "equal" in said


def test_an_inequality_counts_where_it_holds() -> None:
    """x - y <= 0: on the limit it holds; away from it, it says nothing."""
    below = Constraint("below", X.symbol[0] - X.symbol[1], upper=0)
    assert at(below).rank == 2
    assert at(below, x=(0.4, 0.6)).rank == 1
    assert at(below, x=(0.6, 0.4)).rank == 2  # violated: it will have to hold


def test_sigmas_are_those_on_the_constraint_surface() -> None:
    """The same surface in two ways: on the constraint, and with the constraint solved for."""
    rng = np.random.default_rng(0)
    x, y = Block("x", (4,)), Block("y", (3,))
    A, b = rng.normal(size=(6, 4)), rng.normal(size=6)
    free = Residual("r", cs.DM(A) @ x.symbol - b, 0.3)
    norm = Constraint("norm", cs.sumsqr(x.symbol), 1, 1)
    # x = (y, sqrt(1 - |y|^2))
    last = cs.sqrt(1 - cs.sumsqr(y.symbol))
    solved = Residual("r", cs.DM(A) @ cs.vertcat(y.symbol, last) - b, 0.3)
    v = np.array([0.1, 0.3, -0.5])
    values = {"x": np.append(v, np.sqrt(1 - v @ v)), "y": v}
    d = diagnose(Problem([free], "x", constraints=[norm]), values)
    other = diagnose(Problem([solved], "y"), values)
    assert (d.rank, other.rank) == (4, 3)
    np.testing.assert_allclose(d.identifiability.sigma[:3], other.identifiability.sigma, rtol=1e-9)


def test_null_directions_keep_to_the_constraints() -> None:
    x = Block("x", (4,))
    r = Residual("r", x.symbol[0], 1.0)
    c = Constraint("c", x.symbol[1] + x.symbol[2], 0, 0)
    d = diagnose(Problem([r], "x", constraints=[c]), {"x": np.zeros(4)})
    assert d.rank == 2
    vectors = np.column_stack([direction.vector for direction in d.null_directions])
    assert vectors.shape == (4, 2)
    np.testing.assert_allclose(vectors[0], 0, atol=1e-12)
    np.testing.assert_allclose(vectors[1] + vectors[2], 0, atol=1e-12)
    # what only the constraint reads is decided by it together with others, not by nobody
    assert "no residual and no active constraint depends on x[3]" in d.report()


def test_suggestions_keep_constraints_and_bounds() -> None:
    x, y = Block("x", (2,)), Block("y", ())
    r = Residual("r", x.symbol[0] + y.symbol, 1.0)
    cap = Constraint("cap", cs.sumsqr(x.symbol), upper=4)
    bounds = {"x": (-1, 1), "y": (0, 3)}
    problem = Problem([r], ("x", "y"), bounds, constraints=[cap])
    d = diagnose(problem, {"x": np.array([0.5, 0.1]), "y": np.array(1.0)})
    assert {s.kind for s in d.suggestions} == {"least", "fix", "prior"}
    for suggestion in d.suggestions:
        suggested = suggestion.problem
        kept = [c.name for c in suggested.constraints]
        assert kept == (["cap"] if "x" in suggested.free.names else []), suggestion.what
        assert suggested.bounds == {n: bounds[n] for n in suggested.free.names}
    # the whole prior ends where the constraint allows it
    prior = next(s for s in d.suggestions if s.kind == "prior" and s.cured)
    solution = solve(prior.problem, d.values, Sqp())
    assert float(solution.values["x"] @ solution.values["x"]) <= 4 + 1e-6


# Bounds.


def bounded(
    lower: float, upper: float, x: tuple[float, float], *constraints: Constraint
) -> Diagnosis:
    """x + y is known to 0.1; y has bounds, x has none."""
    bounds = {"x": ([-np.inf, lower], [np.inf, upper])}
    return diagnose(Problem([SUM], "x", bounds, constraints=constraints), {"x": np.array(x)})


@pytest.mark.parametrize(
    ("y", "said"),
    [
        (0.0, "x[1] >= 0"),
        (1e-9, "x[1] >= 0"),  # where solvers end that stay inside
        (-0.2, "x[1] >= 0"),  # violated: it will have to hold
        (2.0, "x[1] <= 2"),
    ],
)
def test_an_active_bound_counts_towards_the_rank(y: float, said: str) -> None:
    d = bounded(0.0, 2.0, (1.0, y))
    assert d.rank == d.structural_rank == 2
    assert d.null_directions == ()
    np.testing.assert_allclose(d.identifiability.sigma, [0.1, 0.0], rtol=1e-12)
    assert not d.warnings
    sentence = f"active bounds ({said}) fix 1 direction, which counts towards the rank"
    assert sentence in str(d)
    assert sentence in d.report()
    assert d.data()["held"] == [said]


def test_bounds_and_the_same_limits_as_constraints_are_one() -> None:
    """Ranks, sigmas and directions of random problems, whichever way limits are written."""
    rng = np.random.default_rng(0)
    x = Block("x", (6,))
    for count in (1, 2, 4):
        A = rng.normal(size=(3, 6))
        r = Residual("r", cs.DM(A) @ x.symbol, 0.3)
        tie = Constraint("tie", cs.DM(rng.normal(size=6)).T @ x.symbol, 0, 0)
        on = rng.permutation(6)[:count]
        lower = np.full(6, -np.inf)
        lower[on] = 0.0
        limit = Constraint("limit", x.symbol[on.tolist()], 0.0)
        values = {"x": np.where(np.isfinite(lower), 0.0, rng.normal(size=6))}
        one = diagnose(Problem([r], "x", {"x": (lower, np.inf)}, constraints=[tie]), values)
        other = diagnose(Problem([r], "x", constraints=[tie, limit]), values)
        assert one.rank == other.rank == min(6, 3 + count + 1)
        assert one.structural_rank == other.structural_rank
        assert one.constrained.count == other.constrained.count == count + 1
        np.testing.assert_allclose(
            one.singular_values, other.singular_values, rtol=1e-9, atol=1e-13
        )
        sigmas = one.identifiability.sigma, other.identifiability.sigma
        np.testing.assert_array_equal(np.isinf(sigmas[0]), np.isinf(sigmas[1]))
        known = np.isfinite(sigmas[0])
        np.testing.assert_allclose(sigmas[0][known], sigmas[1][known], rtol=1e-9, atol=1e-13)
        assert one.ranks_nearby == other.ranks_nearby
        assert len(one.null_directions) == len(other.null_directions) == 6 - one.rank


def test_an_unknown_on_its_bound_is_not_unread() -> None:
    x = Block("x", (3,))
    r = Residual("r", x.symbol[0], 1.0)
    d = diagnose(Problem([r], "x", {"x": ([-9, 0, -9], [9, 9, 9])}), {"x": np.zeros(3)})
    assert d.rank == d.structural_rank == 2
    assert "no residual and no active bound depends on x[2]" in d.report()
    verdicts = d.identifiability.verdicts
    assert verdicts == (
        EntryIdentifiability.PRACTICAL,
        EntryIdentifiability.IDENTIFIED,
        EntryIdentifiability.STRUCTURAL,
    )


def test_a_fit_that_ends_on_its_bounds_is_told_so() -> None:
    """Nonnegative least squares: what is held has a sigma of 0, the rest the smaller problem's."""
    rng = np.random.default_rng(1)
    A, b, x = rng.normal(size=(8, 5)), rng.normal(size=8), Block("x", (5,))
    problem = Problem([Residual("r", cs.DM(A) @ x.symbol - b, 0.2)], "x", {"x": (0.0, np.inf)})
    solution = solve(problem, {"x": np.ones(5)})
    on = solution.values["x"] < 1e-7
    assert 0 < on.sum() < 5
    d = diagnose(problem, solution.values)
    np.testing.assert_array_equal(d.active.bounded, on)
    sigma = np.zeros(5)
    sigma[~on] = 0.2 * np.sqrt(np.diag(np.linalg.inv(A[:, ~on].T @ A[:, ~on])))
    np.testing.assert_allclose(d.identifiability.sigma, sigma, rtol=1e-9)
