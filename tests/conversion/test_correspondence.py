"""Where the vertices of one body lie on another."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import workbench as wb
from tests.bodies_made_up import tube_body
from workbench.conversion import correspond
from workbench.conversion.sampled import counted, sampled_vertices
from workbench.errors import BadArgument

SMALL, DEFAULT = wb.load_body("small"), wb.load_body("default")


def test_the_same_triangles_correspond_one_to_one() -> None:
    found = correspond(DEFAULT, wb.load_body("default-male"))
    assert found.same
    assert found.matched.all()
    surface = DEFAULT.vertices()
    np.testing.assert_array_equal(found.of(surface), surface)
    assert str(found) == "the same triangles: 1229 vertices correspond one to one"


def test_vertices_of_a_coarse_mesh_lie_on_the_fine_one() -> None:
    found = correspond(DEFAULT, SMALL)
    assert found.matched.mean() > 0.95
    assert not found.same
    assert found.distances[found.matched].mean() < 2e-3
    np.testing.assert_allclose(found.places.sum(axis=1), 1.0)
    there = SMALL.vertices(*(found.rest[name] for name in ("pose", "betas", "trans")))
    off = np.linalg.norm(found.of(DEFAULT.vertices()) - there, axis=1)
    np.testing.assert_allclose(off, found.distances, atol=1e-5)


def test_closest_places_bring_the_surface_nearer_than_joints_alone() -> None:
    """By their joints alone, the surfaces of these two are 1.5 mm apart."""
    found = correspond(wb.load_body("full-male"), SMALL)
    assert found.distances[found.matched].mean() < 6e-4


def test_a_body_that_is_drawn_elsewhere_and_in_another_pose_is_found() -> None:
    """The target's rest pose has its arms down, and stands turned, in another place."""
    pose = np.zeros((24, 3))
    for side, sign in (("left", -1), ("right", 1)):
        pose[SMALL.joint_names.index(f"{side}_shoulder"), 2] = 0.6 * sign
    turn = Rotation.from_rotvec([0.0, 1.0, 0.0]).as_matrix()
    drawn = SMALL.vertices(pose) @ turn.T + [0.5, -0.2, 0.3]
    other = replace(SMALL, template=drawn, posedirs=0 * SMALL.posedirs, faces=SMALL.faces[::-1])
    plain, moved = correspond(DEFAULT, SMALL), correspond(DEFAULT, other)
    assert moved.matched.mean() > 0.95
    apart = np.linalg.norm((plain.places - moved.places) @ DEFAULT.template, axis=1)
    assert np.median(apart) < 0.008
    assert np.percentile(apart, 90) < 0.02


def test_bodies_without_common_joints_are_refused() -> None:
    with pytest.raises(BadArgument, match="'tube' have 0 joints of the same names"):
        correspond(DEFAULT, tube_body())


def test_some_vertices_stand_for_all_of_each_joint() -> None:
    some = sampled_vertices(DEFAULT, 300)
    assert (np.diff(some) > 0).all()
    owner = DEFAULT.weights.argmax(axis=1)
    of_all, of_some = (np.bincount(o, minlength=24) for o in (owner, owner[some]))
    assert (of_some >= np.minimum(of_all, 20)).all()
    weights = counted(DEFAULT, some)
    assert weights.mean() == pytest.approx(1.0)
    shares = np.bincount(owner[some], weights, minlength=24) / weights.sum()
    np.testing.assert_allclose(shares, of_all / of_all.sum())
