"""Units change no name, no verdict and no remedy; bounds and constraints stay in suggestions."""

from itertools import combinations

import casadi as cs
import numpy as np
import pytest

from tests.diagnostics.second_zoo import bearings_of_robots
from tests.diagnostics.zoo import three_cameras
from workbench import Block, Constraint, Diagnosis, Problem, Residual, Values, diagnose
from workbench.diagnostics.identifiability import EntryIdentifiability

METRES = {"um": 1e-6, "mm": 1e-3, "m": 1.0, "km": 1e3}


def in_unit(problem: Problem, at: Values, unit: str) -> tuple[Problem, Values]:
    """The same problem with all its lengths in another unit."""
    old = [block for block in problem.free.blocks if block.unit == "m"]
    new = {b.name: Block(b.name, b.shape, unit) for b in old}
    symbols = [b.symbol for b in old]
    metres = [new[b.name].symbol * METRES[unit] for b in old]
    seen = [
        Residual(r.name, cs.graph_substitute([r.expression], symbols, metres)[0], r.sigma, r.unit)
        for r in problem.residuals
    ]
    blocks = [new.get(b.name, b) for b in problem.free.blocks]
    there = {n: x / METRES[unit] if n in new else x for n, x in at.items()}
    return Problem(seen, problem.free.names, blocks=blocks), there


def turn_against_shift() -> tuple[Problem, Values]:
    """A turn by a radian moves by a centimetre what a translation moves too."""
    turn, place = Block("turn", (2,), "rad"), Block("place", (2,), "m")
    (a, b), (x, y) = cs.vertsplit(turn.symbol), cs.vertsplit(place.symbol)
    seen = cs.vertcat(0.01 * a + x, 2 * (0.01 * a + x) + b, b - y, b + y)
    problem = Problem([Residual("r", seen, 0.001, "m")], ("turn", "place"), blocks=(turn, place))
    return problem, {"turn": np.array([0.1, 0.2]), "place": np.array([0.3, 0.4])}


@pytest.mark.parametrize("unit", ["um", "mm", "km"])
def test_no_verdict_depends_on_a_unit(unit: str) -> None:
    problem, at = turn_against_shift()
    metres, other = diagnose(problem, at), diagnose(*in_unit(problem, at, unit))
    assert metres.identifiability.verdicts == other.identifiability.verdicts
    assert other.identifiability.verdicts[2] == EntryIdentifiability.NUMERICAL
    sizes = np.array([1, 1, METRES[unit], METRES[unit]])
    np.testing.assert_allclose(
        other.identifiability.sigma * sizes, metres.identifiability.sigma, rtol=1e-9
    )
    assert said(metres) == said(other)


def said(d: Diagnosis | object) -> list[str]:
    assert isinstance(d, Diagnosis)
    return [x.name for x in d.null_directions] + [s.what for s in d.suggestions if s.acts > 1]


@pytest.mark.parametrize("build", [three_cameras, bearings_of_robots])
@pytest.mark.parametrize("unit", ["um", "mm", "km"])
def test_no_gauge_and_no_remedy_depends_on_a_unit(build, unit: str) -> None:
    problem, at = build()
    assert said(diagnose(*in_unit(problem, at, unit))) == said(diagnose(problem, at))


def test_constraints_and_bounds_stay_in_suggestions() -> None:
    X, shift = Block("points", (5, 3), "m"), Block("shift", (3,), "m")
    apart = [cs.norm_2(X.symbol[:, i] - X.symbol[:, j]) for i, j in combinations(range(5), 2)]
    seen = [
        Residual("distances", cs.vertcat(*apart), 0.01, "m"),
        Residual("first", X.symbol[:, 0] - shift.symbol, 0.01, "m"),
        Residual("again", X.symbol[:, 0] - shift.symbol, 0.01, "m"),
    ]
    near = Constraint("near", X.symbol[:, 4] - shift.symbol, -9, 9, "m")
    high = Constraint("high", X.symbol[1, :].T, -9, 9, "m")
    bounds = {"points": (-20, 20), "shift": (-10, 10)}
    problem = Problem(seen, ("points", "shift"), bounds, (X, shift), (near, high))
    at = {"points": np.random.default_rng(0).normal(size=(5, 3)), "shift": np.zeros(3)}
    found = diagnose(problem, at)
    assert {s.kind for s in found.suggestions} >= {"least", "drop", "fix", "prior"}
    for suggestion in found.suggestions:
        after = suggestion.problem
        kept = {constraint.name for constraint in after.constraints}
        free = {name.partition("[")[0] for name in after.free.names}
        assert kept >= {c.name for c in problem.constraints if free & set(c.reads)}
        assert set(after.bounds) == free
        inside = np.isfinite(after.lower) & np.isfinite(after.upper)
        assert inside.all(), suggestion.what
