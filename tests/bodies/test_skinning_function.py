"""W(T, J, weights, theta) as a function of all four; and bodies whose joints are free or given."""

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from workbench.bodies import skin, skin_vertices
from workbench.bodies.files.saving import save_body
from workbench.bodies.triangles.recipes import blend_scape
from workbench.bodies.unposing import unpose
from workbench.errors import BadArgument, BadBody, BadFile

N, K = 20, 4
BODY = random_body(5, n_vertices=N, n_joints=K, n_betas=2)
RNG = np.random.default_rng(0)
POSE, BETAS = RNG.normal(size=(K, 3)), RNG.normal(size=2)
JOINTS = RNG.normal(size=(K, 3))
AT_REST = (
    BODY.template
    + BODY.shapedirs @ BETAS
    + BODY.posedirs @ BODY.kinematics.motion(POSE, BETAS).features
)
REGRESSED = BODY.J_regressor @ (BODY.template + BODY.shapedirs @ BETAS)


def four(kind: Any) -> tuple[Any, ...]:
    shapes = {"T": (3, N), "J": (3, K), "weights": (N, K), "theta": (3, K)}
    return tuple(kind.sym(name, *shape) for name, shape in shapes.items())


NUMBERS = AT_REST.T, REGRESSED.T, BODY.weights, POSE.T


def test_a_body_is_the_skinning_function_of_what_is_at_rest() -> None:
    found = skin_vertices(AT_REST, REGRESSED, BODY.weights, POSE, BODY.parents)
    np.testing.assert_allclose(found, BODY.vertices(POSE, BETAS), atol=1e-12)


@pytest.mark.parametrize("kind", [cs.MX, cs.SX])
def test_symbols_of_either_kind_say_the_numbers(kind: Any) -> None:
    symbols = four(kind)
    W = cs.Function("W", list(symbols), [skin(*symbols, BODY.parents)])
    np.testing.assert_allclose(np.asarray(W(*NUMBERS)).T, BODY.vertices(POSE, BETAS), atol=1e-12)


@pytest.mark.parametrize("which", range(4))
def test_derivatives_by_each_of_the_four_are_those_of_differences(which: int) -> None:
    symbols, h = four(cs.SX), 1e-6
    J = cs.jacobian(cs.vec(skin(*symbols, BODY.parents)), cs.vec(symbols[which]))
    slopes = np.asarray(cs.Function("J", list(symbols), [J])(*NUMBERS))
    for i in range(0, NUMBERS[which].size, 3):
        ends = []
        for sign in (1, -1):
            flat = NUMBERS[which].ravel(order="F").copy()
            flat[i] += sign * h
            moved = list(NUMBERS)
            moved[which] = flat.reshape(NUMBERS[which].shape, order="F")
            ends.append(np.asarray(skin(*moved, BODY.parents)).ravel(order="F"))
        np.testing.assert_allclose(slopes[:, i], (ends[0] - ends[1]) / (2 * h), atol=1e-7)


def test_it_is_linear_in_all_but_the_pose() -> None:
    symbols = four(cs.MX)
    posed = cs.vec(skin(*symbols, BODY.parents))
    assert [cs.is_linear(posed, symbol) for symbol in symbols] == [True, True, True, False]


def test_a_turn_of_the_root_turns_about_the_root() -> None:
    turn = np.zeros((K, 3))
    turn[0] = 0.0, np.pi / 2, 0.0
    found = skin_vertices(AT_REST, JOINTS, BODY.weights, turn, BODY.parents)
    away = AT_REST - JOINTS[0]
    expected = np.stack([away[:, 2], away[:, 1], -away[:, 0]], axis=1) + JOINTS[0]
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("which", "wrong", "text"),
    [
        (1, np.zeros((3, 5)), r"J has shape \(3, 5\), but must be \(3, 4\) for 20 points"),
        (2, np.zeros((K, N)), r"weights has shape \(4, 20\), but must be \(20, 4\)"),
        (3, cs.MX.sym("theta", 12), r"theta has shape \(12, 1\), but must be \(3, 4\)"),
    ],
)
def test_shapes_that_do_not_fit_are_named(which: int, wrong: Any, text: str) -> None:
    given = list(NUMBERS)
    given[which] = wrong
    with pytest.raises(BadArgument, match=text):
        skin(*given, BODY.parents)


def test_symbols_of_two_kinds_are_refused() -> None:
    T, J, *_ = four(cs.MX)
    _, _, weights, theta = four(cs.SX)
    with pytest.raises(BadArgument, match="symbols of one kind, and was given MX and SX"):
        skin(T, J, weights, theta, BODY.parents)


def test_rows_are_points_in_numbers() -> None:
    with pytest.raises(BadArgument, match=r"T has shape \(3, 20\), but must have three columns"):
        skin_vertices(AT_REST.T, JOINTS, BODY.weights, POSE, BODY.parents)


# Joints that are free, or given.


def symbols_of(body: wb.SkinnedBody) -> list[cs.MX]:
    return [block.symbol for block in body.blocks()]


def test_free_joints_stand_in_for_the_regressor() -> None:
    student = BODY.freed("joints")
    points, joints = student.points(*symbols_of(BODY)), student.joint_points(*symbols_of(BODY))
    values = {"pose": POSE, "betas": BETAS, "trans": np.zeros(3), "joints": JOINTS}
    terms = [
        wb.residuals.vertices(points, np.zeros((N, 3)), sigma=1.0),
        wb.residuals.landmarks(joints, np.zeros((K, 3)), sigma=1.0),
    ]
    problem = wb.Problem(terms, ("joints", "pose"))
    assert problem.free.unit(0) == "m"
    found = problem.linearize(values).residual.reshape(-1, 3)
    posed = skin_vertices(AT_REST, JOINTS, BODY.weights, POSE, BODY.parents)
    np.testing.assert_allclose(found[:N], posed, atol=1e-12)
    given = replace(BODY, rest_joints=JOINTS)
    np.testing.assert_allclose(found[N:], given.joints(POSE), atol=1e-12)
    np.testing.assert_allclose(posed, given.vertices(POSE, BETAS), atol=1e-12)


def test_they_start_where_the_regressor_has_them() -> None:
    start = BODY.freed("joints").start()
    np.testing.assert_allclose(start["joints"], BODY.J_regressor @ BODY.template, atol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        BODY.array("joints")[0] = 0.0


def test_joints_are_trained_like_other_arrays() -> None:
    teacher = replace(BODY, rest_joints=BODY.joints() + 0.02 * RNG.normal(size=(K, 3)))
    poses = 0.6 * RNG.normal(size=(4, K, 3))
    student = BODY.freed("joints")
    terms = []
    for i, pose in enumerate(poses):
        points = student.points(cs.MX(cs.DM(pose.T)), *symbols_of(BODY)[1:])
        terms.append(wb.residuals.vertices(points, teacher.vertices(pose), sigma=1e-3, name=f"{i}"))
    solution = wb.solve(wb.Problem(terms, "joints"), student.start())
    trained = student.with_values(solution.values)
    assert not trained.free
    np.testing.assert_allclose(trained.rest_joints, teacher.rest_joints, atol=1e-8)
    np.testing.assert_allclose(trained.vertices(poses), teacher.vertices(poses), atol=1e-8)
    assert trained.J_regressor.nnz == BODY.J_regressor.nnz


GIVEN = replace(BODY, rest_joints=JOINTS, name="given")


def test_given_joints_do_not_follow_the_shape() -> None:
    np.testing.assert_array_equal(GIVEN.joints(betas=BETAS), GIVEN.joints())
    np.testing.assert_allclose(GIVEN.joints(), JOINTS, atol=1e-15)
    np.testing.assert_allclose(GIVEN.vertices(), GIVEN.template, atol=1e-14)


def test_a_mesh_is_unposed_about_given_joints() -> None:
    rest = GIVEN.template + GIVEN.shapedirs @ BETAS
    found = unpose(GIVEN, POSE, GIVEN.vertices(POSE, BETAS))
    np.testing.assert_allclose(found.vertices, rest, atol=1e-9)
    assert found.rank_deficiency == 0


def test_given_joints_keep_the_fast_way_and_the_graph_together() -> None:
    points, joints = GIVEN.points(*symbols_of(GIVEN)), GIVEN.joint_points(*symbols_of(GIVEN))
    terms = [
        wb.residuals.vertices(points, np.zeros((N, 3)), sigma=1.0),
        wb.residuals.landmarks(joints, np.zeros((K, 3)), sigma=1.0),
    ]
    problem = wb.Problem(terms, ("pose", "betas", "trans"))
    x, fixed = problem.split({"pose": POSE, "betas": BETAS, "trans": JOINTS[0]})
    here = problem.linearize_at(x, fixed)
    r, J = (np.asarray(part) for part in problem.derivative(x, fixed))
    np.testing.assert_allclose(here.residual, r.ravel(), atol=1e-12)
    np.testing.assert_allclose(here.jacobian, J, atol=1e-11)
    assert not here.jacobian[3 * N :, problem.free.slices["betas"]].any()


@pytest.mark.parametrize(
    "free",
    [
        lambda: BODY.freed("joints", "J_regressor"),
        lambda: BODY.freed("J_regressor").freed("joints"),
        lambda: BODY.freed("joints").freed("J_regressor"),
        lambda: GIVEN.freed("J_regressor"),
    ],
)
def test_joints_and_their_regressor_are_not_free_together(free: Any) -> None:
    with pytest.raises(BadBody, match="nothing would read J_regressor where the joints are free"):
        free()


@pytest.mark.parametrize("wrong", [np.zeros((K + 1, 3)), np.full((K, 3), np.nan), np.zeros((K, 2))])
def test_joints_that_fit_no_tree_are_refused(wrong: np.ndarray) -> None:
    with pytest.raises(BadBody, match=r"rest_joints must be finite places \(4, 3\) m, not an arr"):
        replace(BODY, rest_joints=wrong)


def test_given_joints_travel_and_are_kept_on_disk(tmp_path: Path) -> None:
    save_body(GIVEN, tmp_path / "given.npz")
    for back in (pickle.loads(pickle.dumps(GIVEN)), wb.load_body(tmp_path / "given.npz")):
        np.testing.assert_array_equal(back.rest_joints, JOINTS)
        np.testing.assert_array_equal(back.vertices(POSE, BETAS), GIVEN.vertices(POSE, BETAS))


def test_what_cannot_hold_given_joints_says_so(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"is given its joints at rest, which a \.pkl .* cannot say"):
        save_body(GIVEN, tmp_path / "given.pkl")
    with pytest.raises(BadBody, match="is given its joints, and a triangle body finds them on"):
        blend_scape(GIVEN)
