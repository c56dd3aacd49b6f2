"""Every way of skinning and every kind of features: the laws that all of them keep."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.bodies.laws import (
    assert_bind_pose_leaves_template,
    assert_root_turns_everything_about_pelvis,
    some_arguments,
)
from tests.bodies.random_bodies import entries
from tests.bodies_made_up import random_body
from workbench import SkinnedBody
from workbench.bodies.ablations import without_shape_blend_shapes
from workbench.bodies.files.gltf import write_gltf
from workbench.bodies.forward.posing import unpose
from workbench.bodies.forward.surface import (
    Features,
    count_features,
    quaternion_elements,
    rotation_elements,
    rotation_vectors,
    star_features,
)
from workbench.errors import BadBody, BadFile

SKINNINGS = (wb.linear_blend, wb.dual_quaternion_blend)
FEATURES: tuple[Features, ...] = (
    rotation_elements,
    rotation_vectors,
    quaternion_elements,
    star_features,
)


def varied(body: SkinnedBody, features: Features, seed: int = 0) -> SkinnedBody:
    """The body with other features, and random directions for them."""
    F = count_features(features, body.n_joints, body.n_betas)
    made = np.random.default_rng(seed).normal(scale=0.01, size=(body.n_vertices, 3, F))
    return replace(body, features=features, posedirs=made)


@cache
def variants(n_vertices: int = 30, n_joints: int = 5, n_betas: int = 3) -> dict[str, SkinnedBody]:
    """One body skinned in every way, with every kind of features, and bound in two poses."""
    found = {}
    for bound in (False, True):
        body = random_body(
            3, bound=bound, n_vertices=n_vertices, n_joints=n_joints, n_betas=n_betas
        )
        for features in FEATURES:
            for skinning in SKINNINGS:
                name = f"{skinning.__name__} of {features.__name__}{', bound' * bound}"
                found[name] = replace(varied(body, features), skinning=skinning)
    return found


# Laws.


@pytest.mark.parametrize("features", FEATURES)
def test_variants_keep_the_laws_of_bodies(features: Features) -> None:
    bodies = [body for body in variants().values() if body.features is features]
    assert len(bodies) == 4  # skinned in two ways and bound in two poses
    for body in bodies:
        assert_bind_pose_leaves_template(body)
        assert_root_turns_everything_about_pelvis(body)
        pose, betas, trans = some_arguments(body)
        shaped = body.template + body.shapedirs @ betas
        if features is star_features:
            shaped += betas[1] * body.posedirs[:, :, -1]
        np.testing.assert_allclose(body.vertices(betas=betas), shaped, atol=1e-13)
        part = np.arange(body.n_vertices) % body.n_joints  # rigid parts: skinning matters no more
        rigid = replace(body, weights=np.eye(body.n_joints)[part])
        linear = replace(rigid, skinning=wb.linear_blend)
        expected = linear.vertices(pose, betas)
        np.testing.assert_allclose(rigid.vertices(pose, betas), expected, rtol=0, atol=1e-12)
        both = body.vertices(np.stack([pose, 0.3 * pose]), betas, trans)
        for one, theta in zip(both, (pose, 0.3 * pose), strict=True):
            np.testing.assert_allclose(one, body.vertices(theta, betas, trans), atol=1e-13)


# How features differ.


# STAR: half angles of the joints, and beta_2.

STAR = varied(random_body(3), star_features, seed=1)
POSE = 0.7 * np.random.default_rng(0).standard_normal((5, 3))
BETAS = np.array([0.4, -1.3, 0.8])


def test_beta_2_of_star_adds_a_shape_and_moves_no_joint() -> None:
    without = replace(STAR, features=quaternion_elements, posedirs=STAR.posedirs[:, :, :-1])
    np.testing.assert_allclose(
        STAR.vertices(POSE, [1.0, 0, -1]), without.vertices(POSE, [1.0, 0, -1]), atol=1e-14
    )
    moved = STAR.vertices(betas=BETAS) - without.vertices(betas=BETAS)
    np.testing.assert_allclose(moved, -1.3 * STAR.posedirs[:, :, -1], atol=1e-14)
    np.testing.assert_array_equal(STAR.joints(POSE, BETAS), without.joints(POSE, BETAS))
    mean = without_shape_blend_shapes(STAR)
    np.testing.assert_array_equal(mean.vertices(POSE, BETAS), mean.vertices(POSE))
    several = np.array([[0, 0, 0], [0, 1, 0], [0, -2, 0.5]])
    each = [STAR.vertices(POSE, betas) for betas in several]
    np.testing.assert_array_equal(STAR.vertices(POSE, several), each)


def test_files_of_star_are_told_from_smpls(tmp_path: Path) -> None:
    raw = entries()
    np.savez(tmp_path / "smpl.npz", **raw)
    raw["posedirs"] = 0.01 * np.random.default_rng(0).standard_normal((40, 3, 93))
    np.savez(tmp_path / "star.npz", **raw)
    smpl, star = wb.load_body(tmp_path / "smpl.npz"), wb.load_body(tmp_path / "star.npz")
    assert (smpl.features, star.features) == (rotation_elements, star_features)
    assert (smpl.card["model"], star.card["model"]) == ("SMPL", "STAR")
    expected = raw["v_template"] + raw["shapedirs"][:, :, 1] * 2 + raw["posedirs"][:, :, 92] * 2
    np.testing.assert_allclose(star.vertices(betas=[0.0, 2.0]), expected, atol=1e-12)
    wb.save_body(STAR, tmp_path / "ours.npz")
    again = wb.load_body(tmp_path / "ours.npz")
    assert again.features is star_features
    np.testing.assert_array_equal(again.vertices(POSE, BETAS), STAR.vertices(POSE, BETAS))


def test_star_features_are_refused_where_they_mean_nothing(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="star_features, which smplx does not know"):
        wb.save_body(STAR, tmp_path / "star.pkl")
    with pytest.raises(BadBody, match="cannot be unposed"):
        unpose(STAR, POSE, STAR.vertices(POSE))
    with pytest.raises(BadBody, match="not skinned as a glTF is"):
        write_gltf(tmp_path / "star.glb", STAR, POSE[None])
    slim = random_body(3, n_betas=1)
    with pytest.raises(BadBody, match="star_features need beta_2"):
        replace(slim, features=star_features, posedirs=np.zeros((30, 3, 17)))
