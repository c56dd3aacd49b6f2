"""STAR's features: quaternions of the joints, and beta_2."""

from dataclasses import replace
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies.random_bodies import entries
from tests.bodies.variants import varied
from tests.bodies_made_up import random_body, smpl_like_body
from workbench.bodies.ablations import ABLATIONS
from workbench.bodies.files.gltf import write_gltf
from workbench.bodies.files.saving import save_body
from workbench.bodies.forward.features import (
    Posture,
    count_features,
    quaternion_elements,
    star_features,
)
from workbench.bodies.unposing import unpose
from workbench.errors import BadBody, BadFile

RNG = np.random.default_rng(0)
BODY = varied(random_body(3), star_features, seed=1)
POSE, BETAS = 0.7 * RNG.standard_normal((5, 3)), np.array([0.4, -1.3, 0.8])
WITHOUT = replace(BODY, features=quaternion_elements, posedirs=BODY.posedirs[:, :, :-1])


def test_there_are_93_on_24_joints() -> None:
    assert count_features(star_features, 24, 10) == 93
    assert count_features(quaternion_elements, 24, 10) == 92


def test_they_are_half_angles_joint_by_joint_and_beta_2() -> None:
    found = star_features(Posture.of(cs.MX(POSE.T), cs.MX(3, 5), cs.MX(BETAS)))
    expected = []
    for theta in POSE[1:]:
        angle = np.linalg.norm(theta)
        expected += [*(np.sin(angle / 2) * theta / angle), np.cos(angle / 2) - 1]
    np.testing.assert_allclose(np.asarray(cs.evalf(found)).ravel(), [*expected, -1.3], atol=1e-14)


@pytest.mark.parametrize("rest_of_betas", [0.0, 1.0])
def test_without_beta_2_they_are_those_of_quaternions(rest_of_betas: float) -> None:
    betas = np.array([rest_of_betas, 0, -rest_of_betas])
    found, expected = (body.vertices(POSE, betas) for body in (BODY, WITHOUT))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
    assert np.abs(BODY.vertices(POSE, BETAS) - WITHOUT.vertices(POSE, BETAS)).max() > 1e-3


def test_beta_2_adds_a_shape_at_rest_and_moves_no_joint() -> None:
    moved = BODY.vertices(betas=BETAS) - WITHOUT.vertices(betas=BETAS)
    np.testing.assert_allclose(moved, -1.3 * BODY.posedirs[:, :, -1], atol=1e-14)
    np.testing.assert_array_equal(BODY.joints(POSE, BETAS), WITHOUT.joints(POSE, BETAS))


def test_symbols_give_the_numbers_of_the_body_and_their_slope_by_beta_2() -> None:
    pose, betas, trans = (block.symbol for block in BODY.blocks())
    points = BODY.points(pose, betas, trans).graph()
    slope = cs.jacobian(cs.vec(points), betas)[:, 1]
    of = cs.Function("of", [pose, betas, trans], [points, slope])
    found, by_beta_2 = (np.asarray(a) for a in of(POSE.T, BETAS, np.zeros(3)))
    np.testing.assert_allclose(found.T, BODY.vertices(POSE, BETAS), atol=1e-14)
    h = np.array([0, 1e-5, 0])
    rise = (BODY.vertices(POSE, BETAS + h) - BODY.vertices(POSE, BETAS - h)) / 2e-5
    np.testing.assert_allclose(by_beta_2.reshape(-1, 3), rise, atol=1e-9)


def test_a_batch_has_its_own_beta_2_each() -> None:
    several = np.array([[0, 0, 0], [0, 1, 0], [0, -2, 0.5]])
    found = BODY.vertices(POSE, several)
    each = [BODY.vertices(POSE, betas) for betas in several]
    np.testing.assert_array_equal(found, each)


def test_costs_of_many_points_see_beta_2() -> None:
    pose, betas, trans = (block.symbol for block in BODY.blocks())
    residual = wb.residuals.vertices(BODY.points(pose, betas, trans), BODY.template, sigma=0.1)
    problem = wb.Problem([residual], free=["betas"])
    start = BODY.start() | {"pose": POSE}
    x, fixed = problem.split(start)
    many = np.array([[0.0, 0, 0], [0, 1, 0], [0.3, -2, 0.5]])
    costs = [problem.linearize(start | {"betas": b}).cost for b in many]
    np.testing.assert_allclose(problem.costs(x, fixed)(many), costs, rtol=1e-12)
    assert len(x) == 3
    assert len(np.unique(np.round(costs, 9))) == 3


def test_shape_is_fitted_with_them() -> None:
    symbols = [block.symbol for block in BODY.blocks()]
    seen = BODY.vertices(0.5 * POSE, BETAS, [0.1, 0.2, 0.3])
    problem = wb.Problem(
        [wb.residuals.vertices(BODY.points(*symbols), seen, sigma=0.001)],
        ["pose", "betas", "trans"],
    )
    found = wb.solve(problem, BODY.start())
    assert found.converged
    np.testing.assert_allclose(found.values["betas"], BETAS, atol=1e-7)
    assert wb.diagnose(problem, BODY.start() | found.values).rank == problem.free.size


def test_their_blend_shapes_are_learned_linearly() -> None:
    """One step of least squares, once people and poses are known."""
    freed = replace(BODY, posedirs=0 * BODY.posedirs).freed("posedirs")
    rng, residuals, values = np.random.default_rng(5), [], {}
    for i in range(30):
        blocks = [wb.Block(f"{i}/{b.name}", b.shape, b.unit) for b in freed.blocks()]
        pose, betas = rng.standard_normal((5, 3)), rng.standard_normal(3)
        values |= dict(zip((b.name for b in blocks), (pose, betas, np.zeros(3)), strict=True))
        points = freed.points(*(block.symbol for block in blocks))
        seen = BODY.vertices(pose, betas)
        residuals.append(wb.residuals.vertices(points, seen, sigma=0.001, name=f"person {i}"))
    problem = wb.Problem(residuals, ["posedirs"])
    values["posedirs"] = np.zeros_like(BODY.posedirs)
    step = problem.linearize(values).step(0.0)
    found = freed.with_values({"posedirs": step.reshape(BODY.posedirs.shape)})
    assert found.features is star_features
    np.testing.assert_allclose(found.posedirs, BODY.posedirs, atol=1e-9)


def test_an_npz_keeps_them(tmp_path: Path) -> None:
    save_body(BODY, tmp_path / "star.npz")
    again = wb.load_body(tmp_path / "star.npz")
    assert isinstance(again, wb.SkinnedBody)
    assert again.features is star_features
    np.testing.assert_array_equal(again.vertices(POSE, BETAS), BODY.vertices(POSE, BETAS))


def test_a_file_in_stars_layout_is_read_and_smpls_stays_smpls(tmp_path: Path) -> None:
    raw = entries()
    np.savez(tmp_path / "smpl.npz", **raw)
    smpl = wb.load_body(tmp_path / "smpl.npz")
    assert isinstance(smpl, wb.SkinnedBody)
    assert smpl.is_smpl
    raw["posedirs"] = 0.01 * RNG.standard_normal((40, 3, 93))
    np.savez(tmp_path / "star.npz", **raw)
    body = wb.load_body(tmp_path / "star.npz")
    assert isinstance(body, wb.SkinnedBody)
    assert body.features is star_features
    assert (smpl.card["model"], body.card["model"]) == ("SMPL", "STAR")
    betas = np.array([0.0, 2.0])
    expected = raw["v_template"] + raw["shapedirs"][:, :, 1] * 2 + raw["posedirs"][:, :, 92] * 2
    np.testing.assert_allclose(body.vertices(betas=betas), expected, atol=1e-12)


def test_what_cannot_have_them_says_so(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="star_features, which the package smplx does not know"):
        save_body(BODY, tmp_path / "star.pkl")
    with pytest.raises(BadBody, match="cannot be unposed"):
        unpose(BODY, POSE, BODY.vertices(POSE))
    with pytest.raises(BadBody, match="not skinned as a glTF is"):
        write_gltf(tmp_path / "star.glb", BODY, POSE[None])
    slim = random_body(3, n_betas=1)
    with pytest.raises(BadBody, match="star_features need beta_2, and there is 1 of the betas"):
        replace(slim, features=star_features, posedirs=np.zeros((30, 3, 17)))


def test_everybody_is_the_mean_person_without_shape() -> None:
    body = varied(smpl_like_body(), star_features)
    mean = ABLATIONS["shape blend shapes"](body)
    np.testing.assert_array_equal(mean.vertices(betas=[1.0, 3.0]), mean.vertices())
    assert np.abs(body.vertices(betas=[1.0, 3.0]) - body.vertices()).max() > 1e-3
