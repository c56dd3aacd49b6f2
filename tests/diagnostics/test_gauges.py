"""Gauges that are declared, gauges that are broken, and remedies in words of the problem."""

from collections import Counter

import casadi as cs
import numpy as np
import pytest

from tests.diagnostics.second_zoo import equal_rates_at_a_point
from tests.diagnostics.zoo import (
    SIMILARITY,
    distances_in_space,
    joints_of_a_body,
    rows_and_columns,
    spatial_arm,
    three_cameras,
    two_exponentials,
)
from workbench import Block, Diagnosis, Problem, Residual, Values, diagnose, residuals
from workbench.diagnostics import Gauge
from workbench.errors import BadArgument


def flat_network() -> tuple[Problem, Values]:
    """Five points in the plane as a vector of ten numbers, which nobody can take for points."""
    x = Block("x", (10,), "m")
    ends = [(i, j) for i in range(5) for j in range(i)]
    apart = [
        cs.norm_2(x.symbol[[2 * i, 2 * i + 1]] - x.symbol[[2 * j, 2 * j + 1]]) for i, j in ends
    ]
    problem = Problem([Residual("r", cs.vertcat(*apart), 0.01, "m")], ("x",), blocks=(x,))
    return problem, {"x": np.random.default_rng(0).normal(size=10)}


def turned(values: Values) -> Values:
    x = values["x"].reshape(5, 2)
    return {"x": np.column_stack([-x[:, 1], x[:, 0]]).ravel()}


def test_a_declared_gauge_gets_its_name() -> None:
    problem, at = flat_network()
    turn = Gauge("a rotation of the plane", turned)
    without, found = diagnose(problem, at), diagnose(problem, at, gauges=[turn])
    named = [d.name for d in found.null_directions if d.kind == "gauge"]
    assert named == ["a rotation of the plane of x"]
    assert not any(d.kind == "gauge" for d in without.null_directions)
    assert found.rank == without.rank == 7
    assert len(found.null_directions) == 3


def test_a_declared_gauge_that_is_none_is_a_warning() -> None:
    problem, at = flat_network()
    growth = Gauge("a change of scale", lambda values: {"x": values["x"]})
    found = diagnose(problem, at, gauges=[growth])
    assert any("a change of scale is declared" in f.text for f in found.warnings)
    assert not any(d.kind == "gauge" for d in found.null_directions)
    with pytest.raises(BadArgument, match="gauges"):
        diagnose(problem, at, gauges=["a change of scale"])  # type: ignore[list-item]


def test_one_distance_takes_the_scale_away() -> None:
    problem, at = three_cameras()
    X = problem.free["points"].symbol
    known = Residual("tape", cs.norm_2(X[:, 0] - X[:, 1]) - 1.0, 0.01, "m")
    more = Problem((*problem.residuals, known), problem.free.names, blocks=problem.free.blocks)
    kinds = [d.kind for d in diagnose(more, at).null_directions]
    assert kinds == ["translation"] * 3 + ["rotation"] * 3


def test_a_point_that_is_held_leaves_rotations_about_it() -> None:
    problem, at = distances_in_space()
    some = tuple(f"points[{row}]" for row in range(1, 8))
    names = [d.name for d in diagnose(problem.freeing(*some), at).null_directions]
    assert len(names) == 3
    assert all(name.startswith("a rotation about ") and " through (" in name for name in names)


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_units_change_no_gauge_and_no_count_of_a_remedy(factor: float) -> None:
    unit = "mm" if factor > 1 else "km"
    points = Block("points", (6, 3), unit)
    ends = [(i, j) for i in range(6) for j in range(i)]
    apart = [cs.norm_2(points.symbol[:, i] - points.symbol[:, j]) for i, j in ends]
    r = Residual("r", cs.vertcat(*apart), 0.01 * factor, unit)
    problem = Problem([r], ("points",), blocks=(points,))
    found = diagnose(problem, {"points": factor * np.random.default_rng(0).normal(size=(6, 3))})
    assert [d.kind for d in found.null_directions] == ["translation"] * 3 + ["rotation"] * 3
    assert (found.suggestions[0].acts, found.suggestions[0].numbers) == (4, 6)


def test_fewer_numbers_never_suffice() -> None:
    """Each number of a least remedy is needed: without it, something is unknown again."""
    problem, at = three_cameras()
    first = diagnose(problem, at).suggestions[0]
    left = set(range(problem.free.size))
    held = [i for i in left if problem.free.label(i) not in first.problem.free.single_labels]
    assert len(held) == first.numbers == 7
    for again in held:
        free = problem.free.chosen(sorted(left - set(held) | {again})).spelled()
        after = diagnose(problem.freeing(*free), at)
        assert after.rank == after.shape[1] - 1


def test_of_a_robot_no_words_for_bodies_are_used() -> None:
    said = diagnose(*spatial_arm()).report()
    assert not any(word in said for word in ("pose", "bone", "joint", "body", "shape of"))


def test_terms_of_different_kinds_are_not_exchanged() -> None:
    problem, at = two_exponentials()
    assert diagnose(problem, at).exchanges == (("amount", "rate"),)
    x = problem.free["rate"].symbol
    prior = Residual("slow first", x[0] - 0.1, 1.0, "1/s")
    more = Problem((*problem.residuals, prior), problem.free.names, blocks=problem.free.blocks)
    assert diagnose(more, at).exchanges == ()


def held_loosely(problem: Problem, at: Values, sigma: float) -> Diagnosis:
    """A problem with a wide prior on every block."""
    loose = [
        residuals.gaussian(
            b.symbol, mean=np.ravel(at[b.name]), covariance=sigma**2, unit=b.unit, name=b.name
        )
        for b in problem.free.blocks
    ]
    free = problem.free
    found = diagnose(Problem((*problem.residuals, *loose), free.names, blocks=free.blocks), at)
    assert isinstance(found, Diagnosis)
    return found


def test_gauges_that_only_wide_priors_hold_are_named_among_weak_directions() -> None:
    d = held_loosely(*three_cameras(), 10.0)
    assert d.rank == d.shape[1]
    kinds = sorted(one.kind for one in d.weak_directions)
    assert kinds == ["rotation"] * 3 + ["scale"] + ["translation"] * 3
    assert d.weak_count == len(d.weak_directions)
    for one in d.weak_directions:
        assert one.change == pytest.approx(0.1, rel=1e-3), one.name  # a metre of ten


def test_weak_directions_are_weak_and_no_null_direction_is_among_them() -> None:
    problem, at = joints_of_a_body()
    far = [Residual(r.name, r.expression, 0.5, r.unit, points=r.points) for r in problem.residuals]
    d = diagnose(Problem(far, problem.free.spelled()), at)
    assert isinstance(d, Diagnosis)
    assert d.weak_count == len(d.weak_directions) > 3
    assert all(1e-3 < one.change < 1 for one in d.weak_directions)
    W = np.column_stack([one.vector for one in d.weak_directions])
    N = np.column_stack([one.vector for one in d.null_directions])
    assert np.linalg.matrix_rank(np.column_stack([W, N]), tol=1e-6) == len(W.T) + len(N.T)


def test_a_prior_is_put_on_the_fewest_blocks() -> None:
    d = diagnose(*rows_and_columns())
    priors = [s for s in d.suggestions if s.kind == "prior"]
    assert [s.acts for s in priors] == [1, 1]
    assert all(s.cured for s in priors)
    both = [s for s in diagnose(*equal_rates_at_a_point()).suggestions if s.kind == "prior"]
    assert [s.what.partition(" (")[0] for s in both] == ["add a Gaussian prior on amount and rate"]
    assert both[0].acts == 2
    assert both[0].cured


def test_a_point_that_one_camera_sees_is_not_called_a_scale() -> None:
    """It slides along its ray, while the others and the cameras keep their seven gauges."""
    problem, at = three_cameras()
    first, *others = problem.residuals
    seen = [first, *(Residual(r.name, r.expression[:-2], 1.0, "px") for r in others)]
    free = problem.free
    found = diagnose(Problem(seen, free.names, blocks=free.blocks), at).null_directions
    last = found[-1]
    assert Counter(d.kind for d in found[:-1]) == SIMILARITY
    assert last.kind == "trade-off"
    assert last.name.startswith("a trade-off within points:")
    assert np.count_nonzero(abs(last.vector) > 1e-9) == 3
