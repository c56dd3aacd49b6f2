"""What models of the family have beside SMPL: names, expressions, hands, STAR's features."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies.laws import some_arguments
from tests.bodies.model_files import flame, smplh, smplx, star, written
from tests.bodies.paper import smpl, star_features
from tests.bodies.random_bodies import entries
from tests.tiers import few
from workbench.bodies import mirrored, pose_space, shape_space
from workbench.bodies.catalogue import load_body, load_skinned
from workbench.bodies.files.layouts import body_from
from workbench.bodies.files.saving import save_body, vertex_ids
from workbench.errors import BadArgument

# Shape and expression.


def test_expression_is_fitted_while_shape_is_held(tmp_path: Path) -> None:
    body = load_skinned(written(flame(), tmp_path / "m.pkl"))
    space = shape_space(body).first(4, 5)
    shape, expression = wb.Block("shape", (4,), "sd"), wb.Block("expression", (5,), "sd")
    pose, _, trans = body.blocks()
    truth = np.array([0.5, -1, 0.3, 2, 1])
    seen = body.vertices(None, space.numbers([1, 2, 3, 4], truth))
    betas = space.betas(shape.symbol, expression.symbol)
    points = body.points(pose.symbol, betas, trans.symbol)
    residual = wb.residuals.vertices(points, seen, sigma=0.001)
    problem = wb.Problem([residual], ["expression"], blocks=[shape, expression])
    start = {"pose": np.zeros((5, 3)), "trans": np.zeros(3), "expression": np.zeros(5)}
    found = wb.solve(problem, start | {"shape": np.array([1.0, 2, 3, 4])})
    np.testing.assert_allclose(found.values["expression"], truth, atol=1e-8)
    with pytest.raises(BadArgument, match="there are 5 coefficients of expression, and 6"):
        space.numbers([], np.zeros(6))
    with pytest.raises(BadArgument, match="ask for 0 to so many, not 9"):
        space.first(9)
    with pytest.raises(BadArgument, match=r"the shape is an expression \(4, 1\) here"):
        space.betas(expression.symbol)


# Hands.


@pytest.mark.parametrize("make", few([smplx, smplh], 1))
def test_each_hand_of_a_body_has_its_pose_space(tmp_path: Path, make: Any) -> None:
    raw = make()
    body = load_skinned(written(raw, tmp_path / "m.pkl"))
    both = pose_space(body)
    assert (
        both.joints == pose_space(body, side="left").joints + pose_space(body, side="right").joints
    )
    none = pose_space(
        replace(body, extras={**body.extras, "hands_componentsl": np.zeros((0, 45))}), side="left"
    )
    assert none.n_components == 0
    assert none.poses(body, []).shape == (body.n_joints, 3)  # the mean pose
    for hand in ("left", "right"):
        space, letter = pose_space(body, 4, hand), hand[0]
        z = np.array([1.0, -2, 0.5, 0])
        pose = space.poses(body, z)
        rows = [body.joint_names.index(name) for name in space.joints]
        expected = raw[f"hands_mean{letter}"] + z @ raw[f"hands_components{letter}"][:4]
        np.testing.assert_allclose(pose[rows].ravel(), expected, atol=1e-14)  # the mean, once
        assert not np.delete(pose, rows, axis=0).any()
        np.testing.assert_allclose(space.coefficients(body, pose), z, atol=1e-12)
        spread = raw[f"hands_coeffs{letter}"].std(axis=0)[:4]
        np.testing.assert_allclose(space.deviations, spread)
        rest = cs.DM(np.zeros((3, body.n_joints - 15)))
        found = cs.evalf(space.pose(body, cs.MX(cs.DM(z)), cs.MX(rest)))
        np.testing.assert_allclose(np.asarray(found).T, pose, atol=1e-14)


def test_vertices_that_smplx_appends_are_named(tmp_path: Path) -> None:
    body = load_body("default")
    save_body(body, tmp_path / "SMPL_NEUTRAL.pkl")
    ids = json.loads((tmp_path / "SMPL_NEUTRAL_vertex_ids.json").read_text())
    assert ids == vertex_ids(body)
    assert len(ids) == 21
    at = {name: body.template[i] for name, i in ids.items()}
    landmarks = dict(zip(body.landmark_names("coco"), body.landmark("coco"), strict=True))
    assert np.linalg.norm(at["nose"] - landmarks["nose"]) < 0.02
    assert np.linalg.norm(at["RHeel"] - landmarks["right_heel"]) < 0.03
    for left, right in (("lear", "rear"), ("LBigToe", "RBigToe"), ("lthumb", "rthumb")):
        np.testing.assert_allclose(at[left] * (-1, 1, 1), at[right], atol=0.005)
    bare = vertex_ids(replace(body, landmarks={}))  # nearest to joints
    for name, i in bare.items():
        assert np.linalg.norm(body.template[i] - at[name]) < 0.25, name
    assert max(vertex_ids(body_from(entries(), "b", "b")).values()) < 40


# STAR, by formulas that share no code with the package.


@pytest.mark.parametrize("n_betas", few([10, 300], 1))
def test_star_agrees_with_an_independent_formula(tmp_path: Path, n_betas: int) -> None:
    body = load_skinned(written(star(N=60, B=n_betas), tmp_path / "STAR_NEUTRAL.npz"))
    assert body.joint_names[23] == "right_hand"
    for seed in range(5):
        arguments = some_arguments(body, seed, scale=1.0)
        vertices, joints = smpl(body, *arguments, star_features)
        np.testing.assert_allclose(body.vertices(*arguments), vertices, rtol=0, atol=1e-12)
        np.testing.assert_allclose(body.joints(*arguments), joints, rtol=0, atol=1e-12)


def test_mirrored_body_exchanges_hands_and_landmarks(tmp_path: Path) -> None:
    """Also what is said of the corners of faces, which a mirrored face has in another order."""
    raw = smplx(B=20)
    body = load_skinned(written(raw, tmp_path / "m.npz"))
    other = mirrored(body, "other")
    left = pose_space(other, side="left")
    expected = raw["hands_meanr"].reshape(15, 3) * [1, -1, -1]
    np.testing.assert_array_equal(left.mean, expected)
    np.testing.assert_array_equal(other.extras["hands_coeffsl"], raw["hands_coeffsr"])
    z = np.array([1.0, -2, 0.5])
    pose = pose_space(body, 3, "right").poses(body, z)
    there = pose_space(other, 3, "left").poses(other, z)
    np.testing.assert_allclose(other.vertices(there), body.vertices(pose) * [-1, 1, 1], atol=1e-12)
    seen, found = (
        np.einsum(
            "lc,lcx->lx",
            one.extras["lmk_bary_coords"],
            one.template[one.faces[raw["lmk_faces_idx"].astype(int)]],
        )
        for one in (body, other)
    )
    np.testing.assert_allclose(found, seen * [-1, 1, 1], atol=1e-14)
