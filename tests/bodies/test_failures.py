"""How linear blending fails, against what can be computed by hand; and what repairs it."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from workbench.bodies.ablations import (
    ABLATIONS,
    without_blend_weights,
    without_pose_blend_shapes,
)
from workbench.bodies.forward.skinning import blended
from workbench.errors import BadBody
from workbench.geometry.dual_quaternions import dual_quaternions
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.solids import lengths, mesh_edges, volume
from workbench.lectures.material.limbs import Limb, lids, piece_volume
from workbench.lectures.material.separate_parts import SeparateParts
from workbench.lectures.material.tubes import (
    linear_radius,
    tube,
    volume_lost_bent,
    volume_lost_twisted,
)

TUBE = tube()
DUAL = replace(TUBE, skinning=wb.dual_quaternion_blend)
EVERY_10_DEGREES = np.radians(np.arange(0, 181, 10))
X, Z = np.eye(3)[0], np.eye(3)[2]
BENDS = np.radians([15, 45, 90, 135, 170])


def area(around: int = 32, radius: float = 0.05) -> float:
    """Of a regular polygon."""
    return around / 2 * radius**2 * np.sin(2 * np.pi / around)


# The candy wrapper.


def test_rings_of_a_twisted_tube_have_the_known_radius() -> None:
    """Linear blending leaves the cosine of half the angle halfway, dual quaternions all."""
    w = TUBE.weights[:, 1]
    skin, half = TUBE.template[:, 1:].any(axis=1), w == 0.5
    assert half.sum() == 32
    np.testing.assert_allclose(linear_radius(w[half], 1.0), np.cos(0.5), atol=1e-15)
    for body, share in ((TUBE, linear_radius), (DUAL, lambda w, a: np.ones_like(w))):
        posed = Limb(body, "joint").posed(X, EVERY_10_DEGREES)
        found = np.linalg.norm(posed[:, skin, 1:], axis=2) / 0.05
        expected = np.array([share(w[skin], a) for a in EVERY_10_DEGREES])
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("bent", [True, False], ids=["bent", "twisted"])
def test_lost_volume_converges_to_the_integral(bent: bool) -> None:
    """As rings become more: at second order bent, at first twisted, where the diagonals turn."""
    axis, law, order = (Z, volume_lost_bent, 2) if bent else (X, volume_lost_twisted, 1)
    errors, kept = [], []
    for rings in (61, 121, 241):
        body = tube(rings=rings)
        full = volume(body.template, body.faces)
        assert full == pytest.approx(area() * 0.6, rel=1e-12)
        for skinning, into in ((wb.linear_blend, errors), (wb.dual_quaternion_blend, kept)):
            limb = Limb(replace(body, skinning=skinning), "joint")
            lost = full - np.array([volume(v, body.faces) for v in limb.posed(axis, BENDS)])
            expected = law(area(), 0.1, BENDS) if skinning is wb.linear_blend else 0
            into.append(np.abs(lost - expected).max())
    for found in (errors, kept):
        rates = np.log2(np.divide(found[:-1], found[1:]))
        assert (rates > order - 0.1).all()
        assert found[-1] < 0.03 * law(area(), 0.1, np.pi)


# Dual quaternions.


def test_signs_of_quaternions_change_nothing() -> None:
    body, rng = wb.load_body("small"), np.random.default_rng(0)
    G = body.kinematics.motion(rng.normal(scale=0.5, size=(24, 3)), np.zeros(10)).G
    dual = dual_quaternions([cs.DM(g) for g in G])
    weights = cs.MX(cs.sparsify(cs.DM(body.weights)))

    def motion(signs: np.ndarray) -> np.ndarray:
        signed = cs.MX(dual * cs.repmat(cs.DM(signs).T, 8, 1))
        found = np.asarray(cs.evalf(blended(signed, weights)))
        return found * np.sign(found[np.abs(found[:4]).argmax(axis=0), np.arange(369)])

    same = motion(np.ones(24))
    for _ in range(3):
        np.testing.assert_array_equal(motion(rng.choice([-1.0, 1.0], size=24)), same)
    pose = np.zeros((2, 3))
    for angle in (1.0, 3.0, np.pi + 0.1, 5.0):  # turning far round is turning back
        pose[1] = angle * X
        other = pose - [[0, 0, 0], 2 * np.pi * X]
        np.testing.assert_allclose(DUAL.vertices(pose), DUAL.vertices(other), atol=1e-14)


def test_dual_quaternions_move_every_vertex_rigidly() -> None:
    """Copies of one vertex's weights on a small solid: its shape is kept."""
    body = wb.load_body("small")
    solid = np.random.default_rng(0).normal(scale=0.05, size=(369, 3))
    vertex = int((body.weights > 0.2).sum(axis=1).argmax())
    alike = replace(
        body,
        template=solid,
        weights=np.tile(body.weights[vertex], (369, 1)),
        posedirs=0 * body.posedirs,
        mirror=None,
        skinning=wb.dual_quaternion_blend,
    )
    pose = np.random.default_rng(1).normal(scale=0.8, size=(24, 3))
    posed = alike.vertices(pose)
    pairs = mesh_edges(body.faces)
    np.testing.assert_allclose(lengths(posed, pairs), lengths(solid, pairs), atol=1e-13)
    linear = replace(alike, skinning=wb.linear_blend).vertices(pose)
    assert np.abs(lengths(linear, pairs) / lengths(solid, pairs) - 1).max() > 0.05


# Limbs of a real body.


def test_both_repairs_give_elbows_volume_back() -> None:
    whole = wb.load_body("default")
    linear = without_pose_blend_shapes(whole)
    dual = replace(linear, skinning=wb.dual_quaternion_blend)
    angles = np.radians([0, 30, 60, 90, 120])
    by_linear, by_dual, by_smpl = (
        Limb(body, "left_elbow").volumes([0, -1, 0], angles) for body in (linear, dual, whole)
    )
    assert (np.diff(by_linear) < 0).all()
    lost = by_linear[0] - by_linear
    assert lost[3] / by_linear[0] > 0.1
    for repaired in (by_dual, by_smpl):
        assert repaired[0] == pytest.approx(by_linear[0], rel=1e-12)
        assert repaired[0] - repaired[3] < 0.75 * lost[3]


def test_lids_close_a_piece_of_a_tube() -> None:
    straight = TUBE.faces[(TUBE.faces < 61 * 32).all(axis=1)]  # without its lids
    assert len(lids(TUBE.faces)) == 0
    assert sorted(len(lid) for lid in lids(straight)) == [32, 32]
    assert piece_volume(TUBE.template, straight) == pytest.approx(area() * 0.6, rel=1e-12)
    moved = TUBE.template @ matrix_from_vector([1.0, 2.0, 3.0]).T + 5.0
    assert piece_volume(moved, straight) == pytest.approx(area() * 0.6, rel=1e-10)


# Ablations.


def test_each_ablation_takes_one_thing_away() -> None:
    body, rng = wb.load_body("small"), np.random.default_rng(0)
    pose, betas = 0.4 * rng.normal(size=(24, 3)), rng.normal(size=10)
    rigid, unbent, alike = (ablation(body) for ablation in ABLATIONS.values())
    assert set(np.unique(rigid.weights)) == {0.0, 1.0}
    at_rest = body.vertices(betas=betas)
    np.testing.assert_allclose(unbent.vertices(betas=betas), at_rest, rtol=0, atol=1e-15)
    np.testing.assert_allclose(alike.vertices(pose, betas), body.vertices(pose), atol=1e-15)
    np.testing.assert_array_equal(alike.joints(pose, betas), body.joints(pose))
    for other in (rigid, unbent, alike):
        assert np.abs(other.vertices(pose, betas) - body.vertices(pose, betas)).max() > 1e-3
        assert other.name.startswith("small without ")
    parts = rigid.weights.argmax(axis=1)
    inside = (parts[body.faces] == parts[body.faces[:, :1]]).all(axis=1)
    posed, pairs = without_pose_blend_shapes(rigid).vertices(pose), mesh_edges(body.faces[inside])
    np.testing.assert_allclose(lengths(posed, pairs), lengths(body.template, pairs), atol=1e-14)
    freed = body.freed("weights", "posedirs", "shapedirs")
    for ablation in ABLATIONS.values():
        with pytest.raises(BadBody, match="are free"):
            ablation(freed)


# Separate parts.


def test_separate_parts_do_what_the_tree_does() -> None:
    body = wb.load_body("small")
    parts, rng = SeparateParts(body), np.random.default_rng(0)
    pose, trans = 0.6 * rng.normal(size=(24, 3)), [0.1, 0.2, 0.3]
    values = parts.articulated(pose, trans)
    assert parts.gaps(**values).max() < 1e-14
    rigid = without_pose_blend_shapes(without_blend_weights(body))
    expected = rigid.vertices(pose, trans=trans)
    np.testing.assert_allclose(parts.vertices(**values), expected, atol=1e-13)
    assert sum(block.size for block in parts.blocks) == 144
