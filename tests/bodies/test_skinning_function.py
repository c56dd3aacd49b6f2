"""W(T, J, weights, theta) as a function of all four; and bodies whose joints are free or given."""

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies.laws import assert_chain_rule_is_graph
from tests.bodies_made_up import random_body
from workbench.bodies import skin, skin_vertices
from workbench.bodies.files.saving import save_body
from workbench.bodies.triangles.body import blend_scape
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
NUMBERS = AT_REST.T, REGRESSED.T, BODY.weights, POSE.T
GIVEN = replace(BODY, rest_joints=JOINTS, name="given")
SYMBOLS = [block.symbol for block in BODY.blocks()]


def four(kind: Any) -> tuple[Any, ...]:
    shapes = {"T": (3, N), "J": (3, K), "weights": (N, K), "theta": (3, K)}
    return tuple(kind.sym(name, *shape) for name, shape in shapes.items())


@pytest.mark.parametrize("kind", [cs.MX, cs.SX])
def test_skinning_function_gives_the_vertices_of_a_body(kind: Any) -> None:
    expected, symbols = BODY.vertices(POSE, BETAS), four(kind)
    W = cs.Function("W", list(symbols), [skin(*symbols, BODY.parents)])
    np.testing.assert_allclose(np.asarray(W(*NUMBERS)).T, expected, atol=1e-12)
    found = skin_vertices(AT_REST, REGRESSED, BODY.weights, POSE, BODY.parents)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_turning_the_root_by_hand_turns_about_it() -> None:
    turn = np.zeros((K, 3))
    turn[0] = 0.0, np.pi / 2, 0.0
    found = skin_vertices(AT_REST, JOINTS, BODY.weights, turn, BODY.parents)
    away = AT_REST - JOINTS[0]
    expected = np.stack([away[:, 2], away[:, 1], -away[:, 0]], axis=1) + JOINTS[0]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_shapes_and_kinds_that_do_not_fit_are_refused() -> None:
    wrong = [
        (1, np.zeros((3, 5)), "J has shape"),
        (2, np.zeros((K, N)), "weights has shape"),
        (3, cs.MX.sym("theta", 12), "theta has shape"),
    ]
    for which, value, words in wrong:
        given = list(NUMBERS)
        given[which] = value
        with pytest.raises(BadArgument, match=words):
            skin(*given, BODY.parents)
    with pytest.raises(BadArgument, match="MX and SX"):
        skin(*four(cs.MX)[:2], *four(cs.SX)[2:], BODY.parents)
    with pytest.raises(BadArgument, match="three columns"):
        skin_vertices(AT_REST.T, JOINTS, BODY.weights, POSE, BODY.parents)


# Joints that are free, or given.


def problem_of(body: wb.SkinnedBody, *free: str) -> wb.Problem:
    points, joints = body.points(*SYMBOLS), body.joint_points(*SYMBOLS)
    terms = [
        wb.residuals.vertices(points, np.zeros((N, 3)), sigma=1.0),
        wb.residuals.landmarks(joints, np.zeros((K, 3)), sigma=1.0),
    ]
    return wb.Problem(terms, free)


def test_free_joints_take_the_place_of_the_regressor() -> None:
    problem = problem_of(BODY.freed("joints"), "joints", "pose")
    values = {"pose": POSE, "betas": BETAS, "trans": np.zeros(3), "joints": JOINTS}
    assert problem.free.unit(0) == "m"
    found = problem.linearize(values).residual.reshape(-1, 3)
    posed = skin_vertices(AT_REST, JOINTS, BODY.weights, POSE, BODY.parents)
    np.testing.assert_allclose(found[:N], posed, atol=1e-12)
    np.testing.assert_allclose(found[N:], GIVEN.joints(POSE), atol=1e-12)
    np.testing.assert_allclose(posed, GIVEN.vertices(POSE, BETAS), atol=1e-12)
    start = BODY.freed("joints").start()["joints"]
    np.testing.assert_allclose(start, BODY.J_regressor @ BODY.template, atol=1e-15)


def test_given_joints_do_not_follow_the_shape() -> None:
    np.testing.assert_array_equal(GIVEN.joints(betas=BETAS), GIVEN.joints())
    np.testing.assert_allclose(GIVEN.joints(), JOINTS, atol=1e-15)
    np.testing.assert_allclose(GIVEN.vertices(), GIVEN.template, atol=1e-14)
    problem = problem_of(GIVEN, "pose", "betas", "trans")
    values = {"pose": POSE, "betas": BETAS, "trans": JOINTS[0]}
    assert_chain_rule_is_graph(problem, values)
    J = problem.linearize(values).jacobian
    assert not J[3 * N :, problem.free.slices["betas"]].any()


def test_joints_and_their_regressor_are_not_free_together() -> None:
    for body, names in ((BODY, ["joints", "J_regressor"]), (GIVEN, ["J_regressor"])):
        with pytest.raises(BadBody, match="nothing would read J_regressor"):
            body.freed(*names)
    with pytest.raises(BadBody, match="nothing would read J_regressor"):
        BODY.freed("J_regressor").freed("joints")


def test_given_joints_are_kept_where_they_can_be(tmp_path: Path) -> None:
    save_body(GIVEN, tmp_path / "given.npz")
    for back in (pickle.loads(pickle.dumps(GIVEN)), wb.load_body(tmp_path / "given.npz")):
        np.testing.assert_array_equal(back.rest_joints, JOINTS)
        np.testing.assert_array_equal(back.vertices(POSE, BETAS), GIVEN.vertices(POSE, BETAS))
    with pytest.raises(BadFile, match="joints at rest"):
        save_body(GIVEN, tmp_path / "given.pkl")
    with pytest.raises(BadBody, match="is given its joints"):
        blend_scape(GIVEN)
