"""What every way of skinning and every kind of features must keep."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import workbench as wb
from tests.bodies.variants import SKINNINGS, variants, varied
from tests.bodies_made_up import random_body, smpl_like_body
from tests.differences import assert_hessian, assert_jacobian
from workbench import SkinnedBody
from workbench.bodies.forward.features import CLASSICAL, Features, rotation_elements, star_features
from workbench.errors import BadBody, BadFile
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix

VARIANTS = variants()
EACH = pytest.mark.parametrize("body", VARIANTS.values(), ids=list(VARIANTS))
SMALL = {
    name: body
    for name, body in variants(n_vertices=4, n_joints=3, n_betas=2).items()
    if body.bound_in is None and body.posedirs.size
}
EACH_SMALL = pytest.mark.parametrize("body", SMALL.values(), ids=list(SMALL))
WHERE = ("zero", "near zero", "pi", "all but pi between two joints", "a full turn", "anywhere")


def arguments(body: SkinnedBody, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    pose = rng.normal(scale=0.7, size=(body.n_joints, 3))
    return pose, rng.normal(size=body.n_betas), rng.normal(size=3)


def pose_at(where: str, K: int) -> np.ndarray:
    """At exactly pi between two joints blending dual quaternions jumps: both ways are as long."""
    rng = np.random.default_rng(5)
    pose = rng.normal(size=(K, 3))
    angles = np.linalg.norm(pose, axis=1, keepdims=True)
    match where:
        case "zero":
            return 0 * pose
        case "near zero":
            return 1e-7 * pose / angles
        case "pi" | "a full turn":
            pose *= 0.7 / angles
            pose[0] *= (np.pi if where == "pi" else 2 * np.pi) / 0.7
        case "all but pi between two joints":
            pose *= (np.arange(K) == 1)[:, None] * (np.pi - 0.05) / angles
        case _:
            pose *= 0.7 / angles
    return pose


@EACH
def test_the_bind_pose_leaves_the_template_alone(body: SkinnedBody) -> None:
    np.testing.assert_allclose(body.vertices(), body.template, atol=1e-14)
    betas = arguments(body)[1]
    shaped = body.template + body.shapedirs @ betas
    if body.features is star_features:
        shaped += betas[1] * body.posedirs[:, :, -1]
    np.testing.assert_allclose(body.vertices(betas=betas), shaped, atol=1e-13)


@EACH
def test_turning_the_root_turns_everything_about_the_pelvis(body: SkinnedBody) -> None:
    pose, betas, trans = arguments(body)
    before, turn = body.vertices(pose, betas), matrix_from_vector([0.5, -1.0, 2.0])
    pelvis = body.joints(pose, betas)[0]
    turned = pose.copy()
    turned[0] = vector_from_matrix(turn @ matrix_from_vector(pose[0]))
    expected = (before - pelvis) @ turn.T + pelvis + trans
    np.testing.assert_allclose(body.vertices(turned, betas, trans), expected, atol=1e-13)


@EACH
def test_one_hot_weights_make_it_rigid_parts(body: SkinnedBody) -> None:
    part = np.arange(body.n_vertices) % body.n_joints
    rigid = replace(body, weights=np.eye(body.n_joints)[part])
    pose, betas, _ = arguments(body)
    linear = replace(rigid, skinning=wb.linear_blend)
    np.testing.assert_allclose(
        rigid.vertices(pose, betas), linear.vertices(pose, betas), rtol=0, atol=1e-12
    )


@EACH
def test_symbols_and_numbers_agree_in_batches(body: SkinnedBody) -> None:
    pose, betas, trans = arguments(body)
    both = body.vertices(np.stack([pose, 0.3 * pose]), betas, trans)
    symbols = [block.symbol for block in body.blocks()]
    some = body.points(*symbols, vertices=[5, 0, 17])
    target = wb.Block("target", (3, 3), "m")
    residual = wb.residuals.vertices(some, target.symbol, sigma=1.0)
    problem = wb.Problem([residual], free=["pose"], blocks=[target])
    values = {"betas": betas, "trans": trans, "target": np.zeros((3, 3))}
    for expected, theta in zip(both, (pose, 0.3 * pose), strict=True):
        x, fixed = problem.split({**values, "pose": theta})
        found = problem.residual(x, fixed).reshape(3, 3)
        np.testing.assert_allclose(found, expected[[5, 0, 17]], atol=1e-13)


@cache
def problem_of(body: SkinnedBody) -> wb.Problem:
    symbols = [block.symbol for block in body.blocks()]
    target = wb.Block("target", (body.n_vertices, 3), "m")
    residual = wb.residuals.vertices(body.points(*symbols), target.symbol, sigma=0.5)
    return wb.Problem([residual], free=["pose", "betas", "trans"], blocks=[target])


@EACH_SMALL
@pytest.mark.parametrize("where", WHERE)
def test_jacobian_and_hessian_are_those_of_differences(body: SkinnedBody, where: str) -> None:
    pose = pose_at(where, body.n_joints)
    rng = np.random.default_rng(1)
    problem = problem_of(body)
    values = {
        "pose": pose,
        "betas": rng.normal(size=body.n_betas),
        "trans": rng.normal(size=3),
        "target": body.vertices(0.8 * pose),
    }
    x, fixed = problem.split(values)
    assert_jacobian(problem, x, fixed, 1e-8)
    assert_hessian(problem, x, fixed, 1e-6)


@pytest.mark.parametrize("skinning", SKINNINGS)
def test_it_is_fitted_like_smpl(skinning: wb.bodies.Skinning) -> None:
    body = replace(random_body(6), skinning=skinning)
    pose, betas, trans = arguments(body, 3)
    truth = {"pose": 0.5 * pose, "betas": betas, "trans": trans}
    symbols = [block.symbol for block in body.blocks()]
    seen = body.vertices(**truth)
    problem = wb.Problem(
        [wb.residuals.vertices(body.points(*symbols), seen, sigma=0.001)],
        free=["pose", "betas", "trans"],
    )
    solution = wb.solve(problem, body.start())
    assert solution.converged
    for name, value in truth.items():
        np.testing.assert_allclose(solution.values[name], value, atol=1e-8)
    assert wb.diagnose(problem, body.start() | solution.values).rank == problem.free.size


# Features: how they differ.


def periodic(features: Features, angle: float) -> float:
    """By how much a surface changes where theta goes once round, m."""
    body = varied(random_body(3), features)
    pose = np.zeros((5, 3))
    axis = np.array([1.0, 2.0, 2.0]) / 3
    pose[2] = angle * axis
    once_round = pose.copy()
    once_round[2] = (angle - 2 * np.pi) * axis
    return float(np.abs(body.vertices(pose) - body.vertices(once_round)).max())


@pytest.mark.parametrize("angle", [1e-3, 1.0, np.pi, 4.0])
def test_only_rotation_elements_are_the_same_after_a_full_turn(angle: float) -> None:
    by_name = {features.__name__: periodic(features, angle) for features in CLASSICAL}
    assert by_name["rotation_elements"] < 1e-12
    assert by_name["rotation_vectors"] > 1e-2  # 2 pi times a direction of 1 cm
    if angle != np.pi:
        assert by_name["quaternion_elements"] > 1e-3


def test_quaternion_elements_are_the_same_after_two_turns() -> None:
    body = varied(random_body(3), CLASSICAL[2])
    pose = np.zeros((5, 3))
    pose[2] = [0.4, 0, 0.3]
    twice = pose.copy()
    twice[2] *= (0.5 + 4 * np.pi) / 0.5
    np.testing.assert_allclose(body.vertices(twice), body.vertices(pose), atol=1e-12)


def test_rotation_vectors_grow_without_bounds_and_the_others_do_not() -> None:
    body, pose = random_body(3), np.zeros((5, 3))
    pose[2, 0] = 1.0
    moved = {}
    for features in CLASSICAL:
        person = replace(varied(body, features), weights=np.eye(5)[np.zeros(30, dtype=int)])
        far = [person.vertices(turns * 2 * np.pi * pose + pose) for turns in (0, 1, 10, 100)]
        moved[features.__name__] = [np.abs(v - person.template).max() for v in far]
    grown = moved["rotation_vectors"]
    assert grown[3] == pytest.approx(grown[0] * (1 + 200 * np.pi), rel=1e-9)
    for name in ("rotation_elements", "quaternion_elements"):
        assert max(moved[name]) < 0.2


# Mistakes.


def test_posedirs_must_fit_the_features() -> None:
    body = smpl_like_body()
    with pytest.raises(BadBody, match=r"posedirs has shape .* but must be \(60, 3, 69\)"):
        replace(body, features=CLASSICAL[1])
    with pytest.raises(
        BadBody, match="its features cannot be made of a pose of 24 joints and 4 betas"
    ):
        replace(body, features=lambda at: at.nothing)  # type: ignore[attr-defined]


def test_files_hold_features_of_smpl_and_star_alone(tmp_path) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(BadFile, match="go neither by rotation_elements nor by star_features"):
        wb.save_body(varied(random_body(), CLASSICAL[1]), tmp_path / "body.npz")
    wb.save_body(varied(random_body(), rotation_elements), tmp_path / "body.npz")
