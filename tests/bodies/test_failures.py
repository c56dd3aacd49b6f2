"""How linear blending fails, against what can be computed by hand; and what repairs it."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from workbench.bodies.ablations import (
    ABLATIONS,
    without_pose_blend_shapes,
)
from workbench.errors import BadBody
from workbench.geometry.solids import lengths, mesh_edges
from workbench.lectures.material.limbs import Limb
from workbench.lectures.material.tubes import (
    linear_radius,
    tube,
)

TUBE = tube()
DUAL = replace(TUBE, skinning=wb.dual_quaternion_blend)
EVERY_10_DEGREES = np.radians(np.arange(0, 181, 10))
X, Z = np.eye(3)[0], np.eye(3)[2]


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


# Dual quaternions.


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
