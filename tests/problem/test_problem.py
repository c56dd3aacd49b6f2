"""Names in, a least-squares problem out: free, fixed, bounded, and its exact derivatives."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from tests.differences import assert_hessian, assert_jacobian, differences
from tests.tiers import few
from workbench import Block, Problem, Residual, residuals
from workbench.errors import (
    BadBounds,
    BadResidual,
    DuplicateResidual,
    MissingValue,
    NotNumbers,
    ShapeMismatch,
    TwoSymbolsOneName,
    UnknownName,
)

T = np.linspace(-1, 1, 9)
Y = 1 + 2 * T - 3 * T**2 + 0.01 * np.random.default_rng(0).normal(size=9)


def polynomial() -> Problem:
    w, t, y = Block("w", (3,)).symbol, Block("t", (9,)).symbol, Block("y", (9,)).symbol
    fit = Residual("fit", w[0] + w[1] * t + w[2] * t**2 - y, sigma=0.01)
    return Problem((fit,), ("w",))


def body_problem() -> tuple[Problem, dict[str, np.ndarray]]:
    """Vertices of a body against observed ones, with a prior on its shape."""
    body = random_body(n_vertices=12, n_joints=4)
    symbols = [block.symbol for block in body.blocks()]
    observed = Block("observed", (12, 3), "m").symbol
    problem = Problem(
        (
            residuals.vertices(body.points(*symbols), observed, sigma=0.1),
            residuals.gaussian(symbols[1]),
        ),
        ("pose", "betas", "trans"),
    )
    rng = np.random.default_rng(0)
    seen = body.vertices(0.3 * rng.normal(size=(4, 3)), rng.normal(size=3), rng.normal(size=3))
    return problem, body.start() | {"observed": seen + 0.05 * rng.normal(size=(12, 3))}


def test_step_of_a_polynomial_fit_is_polyfit() -> None:
    step = polynomial().linearize({"w": np.zeros(3), "t": T, "y": Y}).step()
    np.testing.assert_allclose(step, np.polyfit(T, Y, 2)[::-1], rtol=1e-12)


# Names.


def test_freeing_other_names_keeps_the_residuals() -> None:
    problem, values = body_problem()
    other = problem.freeing("trans", "observed")
    assert other.free.names == ("trans", "observed")
    assert set(other.fixed.names) == {"pose", "betas"}
    assert problem.free.names == ("pose", "betas", "trans")
    np.testing.assert_allclose(
        other.linearize(values).residual, problem.linearize(values).residual, rtol=1e-13
    )
    columns = problem.linearize(values).jacobian[:, problem.free.slices["trans"]]
    np.testing.assert_allclose(other.linearize(values).jacobian[:, :3], columns, atol=1e-13)


def test_rows_are_named_by_residuals() -> None:
    problem, values = body_problem()
    assert problem.rows == {"vertices(observed)": slice(0, 36), "gaussian(betas)": slice(36, 39)}
    assert problem.size == 39
    assert problem.row_label(35) == "vertices(observed)[35]"
    assert problem.row_label(36) == "gaussian(betas)[0]"
    with pytest.raises(IndexError):
        problem.row_label(39)
    r = problem.linearize(values | {"betas": np.array([1.0, 2.0, 3.0])}).residual
    np.testing.assert_array_equal(r[problem.rows["gaussian(betas)"]], [1, 2, 3])


def test_free_takes_a_name_or_names() -> None:
    problem, _ = body_problem()
    assert Problem(problem.residuals, "pose").free.names == ("pose",)
    names = (name for name in ("pose", "betas"))
    assert Problem(problem.residuals, names).free.names == ("pose", "betas")
    with pytest.raises(UnknownName, match="no block is called 'poze'"):
        Problem(problem.residuals, "poze")


def test_missing_and_misshapen_values_are_named() -> None:
    problem, values = body_problem()
    del values["observed"]
    with pytest.raises(MissingValue, match=r"'observed' \(12, 3\) was given no value"):
        problem.linearize(values)
    with pytest.raises(NotNumbers, match=r"block 'pose' must be an array of real .*, not text"):
        problem.linearize(values | {"pose": "tall"})
    with pytest.raises(ShapeMismatch, match=r"'pose' has shape \(4, 3\), but was given \(12,\)"):
        problem.linearize(values | {"pose": np.zeros(12)})


def test_two_symbols_may_not_share_a_name() -> None:
    one, other = Block("w", (2,)).symbol, Block("w", (2,)).symbol
    both = (residuals.gaussian(one, name="a"), residuals.gaussian(other, name="b"))
    with pytest.raises(TwoSymbolsOneName, match="two different symbols are called 'w'"):
        Problem(both, ("w",))


def test_two_residuals_may_not_share_a_name() -> None:
    w = Block("w", (2,)).symbol
    with pytest.raises(DuplicateResidual, match=r"two residuals are called 'gaussian\(w\)'"):
        Problem((residuals.gaussian(w), residuals.gaussian(w, mean=1.0)), ("w",))


def test_bad_bounds_are_refused() -> None:
    for bounds, error, text in [
        ({"y": (0, 1)}, BadBounds, "'y' has bounds but is fixed; free it or drop them"),
        ({"w": (2, 1)}, BadBounds, r"w\[0\] has the lower bound 2 and the upper bound 1"),
        ({"w": (np.nan, 1)}, BadBounds, r"w\[0\] has the lower bound nan"),
        (
            {"w": (0, 1, 2)},
            BadBounds,
            r"bounds of 'w' are a pair \(lower, upper\), not \(0, 1, 2\)",
        ),
        ({"w": ("a", "b")}, NotNumbers, "a bound of 'w' must be .*, not text"),
        ({"w": ([0, 0], 1)}, ShapeMismatch, r"'bounds of w' has shape \(3,\), but was given \(2,"),
    ]:
        with pytest.raises(error, match=text):
            Problem(polynomial().residuals, ("w",), bounds)


def test_bounds_are_numbers_or_arrays() -> None:
    problem = Problem(polynomial().residuals, ("w",), {"w": ([-1, -np.inf, 0], 2)})
    np.testing.assert_array_equal(problem.lower, [-1, -np.inf, 0])
    np.testing.assert_array_equal(problem.upper, [2, 2, 2])
    assert problem.bounded
    assert not polynomial().bounded


# Derivatives.


@pytest.mark.parametrize("angle", few([1e-9, 1.0, 0.0, 1e-3, np.pi, 2 * np.pi], 2))
def test_derivatives_match_differences_at_any_angle(angle: float) -> None:
    problem, values = body_problem()
    directions = np.random.default_rng(1).normal(size=(4, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    values |= {"pose": angle * directions, "betas": np.array([0.5, -1.0, 2.0])}
    x, fixed = problem.split(values)
    assert_jacobian(problem, x, fixed, 1e-9)
    assert_hessian(problem, x, fixed, 1e-9)


def test_hessian_is_gauss_newton_plus_curvature() -> None:
    """H = J'J + sum r_i H_i, the H_i by differences of the rows of the Jacobian."""
    problem, values = body_problem()
    x, fixed = problem.split(values)
    here = problem.linearize(values)
    m, n = here.jacobian.shape
    curvature = differences(lambda x: problem.linearize_at(x, fixed).jacobian.ravel(), x)
    left_out = np.einsum("m,mij->ij", here.residual, curvature.reshape(m, n, n))
    H = problem.hessian_at(x, fixed)
    assert np.abs(left_out).max() > 1
    np.testing.assert_allclose(H, here.normal + left_out, atol=1e-9 * np.abs(H).max())
    np.testing.assert_allclose(H, H.T, atol=1e-13 * np.abs(H).max())


def row_plus_scalar(row: cs.MX, scalar: cs.MX) -> cs.MX:
    return row.T + scalar


def plane(row: cs.MX, scalar: cs.MX) -> cs.MX:
    return cs.vertcat(row.T * scalar, row.T + scalar)


def test_more_unknowns_than_rows_keep_derivatives() -> None:
    """CasADi would go backwards here, and its backwards mode drops broadcast scalars."""
    for combine in [row_plus_scalar, plane]:
        row, scalar, more = Block("row", (3,)), Block("scalar"), Block("more", (20,))
        expression = cs.vec(combine(row.symbol + cs.sum1(more.symbol), scalar.symbol))
        problem = Problem((Residual("r", expression, 1.0),), ("row", "scalar", "more"))
        assert problem.size < problem.free.size
        x = np.random.default_rng(0).normal(size=problem.free.size)
        assert_jacobian(problem, x, np.zeros(0), 1e-10)
        assert_hessian(problem, x, np.zeros(0), 1e-10)


def test_without_a_residual_unread_blocks_are_not_free() -> None:
    a, b = Block("a", (2,)), Block("b", (3,))
    problem = Problem(
        [residuals.gaussian(a.symbol, name="one"), residuals.gaussian(b.symbol, name="two")],
        ("b", "a"),
        {"b": (0.0, 1.0)},
    )
    left = problem.without("two")
    assert left.free.names == ("a",)
    assert left.rows == {"one": slice(0, 2)}
    assert not left.bounded
    with pytest.raises(UnknownName, match="no residual is called 'three'; there are one, two"):
        problem.without("three")


BODY = wb.load_body("small")
POSE, BETAS, TRANS = (block.symbol for block in BODY.blocks())
JOINTS = BODY.joint_points(POSE, BETAS, TRANS)
SEEN_MM = wb.Block("seen", (24, 3), "mm")
SEEN = wb.Block("seen", (24, 3), "m")


def mine(expression: cs.MX) -> wb.Residual:
    return wb.Residual("mine", cs.vec(expression), sigma=0.01, unit="m", points=(JOINTS,))


def test_metres_minus_millimetres_are_refused() -> None:
    for residual in [
        wb.residuals.landmarks(JOINTS, SEEN_MM.symbol, sigma=0.01),
        mine(JOINTS.symbol - SEEN_MM.symbol),
        mine(2.0 * JOINTS.symbol[:, :3] - (1.0 + SEEN_MM.symbol[:, 3:6] - JOINTS.symbol[:, 1:4])),
        mine(cs.repmat(TRANS, 1, 24) - SEEN_MM.symbol + 0.0 * JOINTS.symbol),
    ]:
        with pytest.raises(
            BadResidual, match=r"in m?m, and '.*', in m?m; .* observed.symbol / 1000"
        ):
            wb.Problem([residual], free=["pose"], blocks=[SEEN_MM])


def test_converted_units_are_accepted() -> None:
    for expression, block in [
        (JOINTS.symbol - SEEN.symbol, SEEN),
        (JOINTS.symbol - SEEN_MM.symbol / 1000, SEEN_MM),
        (JOINTS.symbol - cs.diag(cs.DM([1e-3] * 3)) @ SEEN_MM.symbol, SEEN_MM),
        (cs.vertcat(JOINTS.symbol, SEEN_MM.symbol) - 1.0, SEEN_MM),
    ]:
        assert wb.Problem([mine(expression)], free=["pose"], blocks=[block]).size


def test_sines_of_degrees_are_refused() -> None:
    phase = wb.Block("phase", (), "deg")
    seen = np.linspace(0, 1, 5)
    wave = wb.Residual("wave", cs.sin(6 * seen + phase.symbol) - seen, sigma=0.1)
    with pytest.raises(BadResidual, match="takes the sine of 'phase', in deg; multiply it by pi"):
        wb.Problem([wave], ["phase"], blocks=[phase])
    turned = wb.Residual("wave", cs.cos(np.pi / 180 * phase.symbol) - seen, sigma=0.1)
    assert wb.Problem([turned], ["phase"], blocks=[phase]).size == 5


def test_units_of_constraints_are_checked() -> None:
    metres, seconds = wb.Block("a", (), "m"), wb.Block("b", (), "s")
    residual = wb.Residual("r", metres.symbol * seconds.symbol, sigma=1.0)
    limit = wb.Constraint("limit", metres.symbol - seconds.symbol, lower=0.0)
    with pytest.raises(BadResidual, match="constraint 'limit' adds or subtracts"):
        wb.Problem([residual], ["a"], blocks=[metres, seconds], constraints=[limit])


def test_keypoints_keep_units_and_labels_of_cameras() -> None:
    """They were lost, so that the diagnosis spoke of cam/translation[1] in no unit."""
    camera, seen = wb.Camera("cam/"), wb.Block("seen", (24, 2), "px")
    residual = wb.residuals.keypoints(JOINTS, camera, seen.symbol, np.ones(24), sigma=1.0)
    problem = wb.Problem([residual], ["pose", "cam/translation"], blocks=[seen])
    for which in (
        problem,
        problem.freeing("trans"),
        wb.sequence([problem] * 2, shared=["cam/translation"]),
    ):
        known = {block.name: block for block in (*which.free.blocks, *which.fixed.blocks)}
        for block in camera.blocks:
            assert (known[block.name].unit, known[block.name].labels) == (block.unit, block.labels)
    assert problem.free.label(problem.free.slices["cam/translation"].start + 1).endswith("[y]")


def test_blocks_that_nothing_reads_are_refused() -> None:
    x, y = wb.Block("x", (2,)), wb.Block("y", (2,))
    residual = wb.Residual("r", x.symbol - 1.0, sigma=1.0)
    with pytest.raises(
        wb.WorkbenchError, match="no residual and no constraint reads the block 'y'"
    ):
        wb.Problem([residual], ["x", "y"], blocks=[x, y])
    with pytest.raises(wb.WorkbenchError, match="can be neither free nor bounded"):
        wb.Problem([residual], ["x", "y"])
    with pytest.raises(BadResidual, match=r"give the Points themselves, as in points=\(points,\)"):
        wb.Residual("r", cs.vec(JOINTS.symbol - SEEN.symbol), sigma=1.0)


def test_composed_units_are_not_compared() -> None:
    a, b = wb.Block("a", (3,), "N m"), wb.Block("b", (3,), "J")
    residual = wb.Residual("r", a.symbol - b.symbol, sigma=1.0)
    assert wb.Problem([residual], ["a"], blocks=[a, b]).size == 3


def test_speed_times_one_second_is_accepted() -> None:
    """CasADi leaves the factor out."""
    start, speed = wb.Block("start", (), "m"), wb.Block("speed", (), "m/s")
    seen = [start.symbol + t * speed.symbol - 2.0 for t in (0.5, 1.0, 2.0)]
    residual = wb.Residual("seen", cs.vertcat(*seen), sigma=0.1, unit="m")
    problem = wb.Problem([residual], ["start", "speed"], blocks=[start, speed])
    assert wb.solve(problem, {"start": 0.0, "speed": 0.0}).cost < 1e-9
