"""Winding numbers and depths within solids of shapes that are known, and within bodies."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from tests.tiers import few
from workbench import load_body
from workbench.bodies import SkinnedBody
from workbench.bodies.penetrations import (
    BodySolids,
    Patch,
    Solid,
    deepest,
    penetrations,
    winding_numbers,
)
from workbench.errors import BadBody


def solid(mesh: trimesh.Trimesh) -> Solid:
    """What a mesh of trimesh encloses."""
    return Patch.of(np.asarray(mesh.faces, dtype=np.int64)).solid(np.array(mesh.vertices))


def ball(x: float = 0.0, fine: int = 3) -> Solid:
    """The unit ball at (x, 0, 0); its surface is within 2 % of the sphere."""
    mesh = trimesh.creation.icosphere(fine)
    mesh.apply_translation([x, 0, 0])
    return solid(mesh)


def bar(size: tuple[float, float, float], at: tuple[float, float, float]) -> Solid:
    """A box of a size (m) with its middle somewhere, a vertex at each corner only."""
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(at)
    return solid(mesh)


def depth(inner: Solid, outer: Solid, tolerance: float = 1e-3) -> float:
    return deepest(inner.vertices[inner.skin], outer, tolerance).depth


def test_winding_number_counts_turns_around_a_point() -> None:
    one, two = ball(), ball(0.5)
    points = np.array([[0, 0, 0], [3, 0, 0], [0.3, 0.2, 0.1], [-0.8, 0, 0]], dtype=float)
    both = np.vstack([one.vertices, two.vertices])
    faces = np.vstack([one.faces, two.faces + len(one.vertices)])
    assert winding_numbers(points, both, faces) == pytest.approx([2, 0, 2, 1], abs=1e-12)
    inside_out = winding_numbers(points, both, faces[:, ::-1])
    assert inside_out == pytest.approx([-2, 0, -2, -1], abs=1e-12)
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.2, 1.2, (500, 3))
    mesh = trimesh.Trimesh(one.vertices, one.faces)
    offsets = np.einsum("fi,fi->f", mesh.triangles_center, mesh.face_normals)
    convex = (points @ mesh.face_normals.T <= offsets).all(axis=1)
    found = winding_numbers(points, one.vertices, one.faces)
    np.testing.assert_array_equal(found > 0.5, convex)


@pytest.mark.parametrize(("overlap", "known"), [(-0.5, 0), (0.5, 0.5), (1.5, 0.5)])
def test_depth_of_two_spheres(overlap: float, known: float) -> None:
    """The pole of one is `overlap` within the other, as long as it is not beyond the middle."""
    assert depth(ball(2 - overlap), ball()) == pytest.approx(known, abs=0.02)


def test_depth_of_a_bar_through_a_box() -> None:
    box = bar((1, 1, 1), (0, 0, 0))
    through = bar((0.2, 0.2, 3), (0.1, 0.05, 0))
    # a face of the bar contains the box's axis
    assert depth(through, box) == pytest.approx(0.5, abs=1e-3)
    # and the box's upper side is within the bar by half of its width
    assert depth(box, through) == pytest.approx(0.1, abs=1e-3)
    beside = bar((0.2, 0.2, 3), (0.61, 0, 0))
    assert depth(beside, box) == depth(box, beside) == 0


def test_deepest_place_and_nearest_face() -> None:
    found = deepest(ball(1.7, 4).vertices[ball(1.7, 4).skin], ball(0, 4), 1e-3)
    assert found.depth == pytest.approx(0.3, abs=0.01)
    assert found.place == pytest.approx([0.7, 0, 0], abs=0.03)
    assert ball(0, 4).vertices[ball(0, 4).skin[found.face]].mean(axis=0) == pytest.approx(
        [1, 0, 0], abs=0.1
    )
    nothing = deepest(ball(5).vertices[ball(5).skin], ball())
    assert nothing.depth == 0
    assert nothing.face == -1
    assert np.isnan(nothing.place).all()


def test_depth_ignores_faces_that_close_an_opening() -> None:
    """In a tube cut from a long bar the depth is measured to its sides, even next to the cut."""
    mesh = trimesh.creation.box((0.2, 0.2, 1.0))
    side = np.asarray(mesh.faces)[abs(mesh.face_normals[:, 2]) < 0.5]
    tube = Patch.of(side)
    assert [len(rim) for rim in tube.rims] == [4, 4]
    closed = tube.solid(np.array(mesh.vertices))
    assert trimesh.Trimesh(closed.vertices, closed.faces, process=False).volume == pytest.approx(
        0.04
    )
    needle = bar((0.02, 0.02, 0.4), (0.03, 0, 0.3))  # ends at the very cut
    assert depth(needle, closed) == pytest.approx(0.08, abs=1e-3)


@pytest.mark.thorough
def test_openings_that_share_a_vertex_are_closed() -> None:
    """Two pyramids without bases that share a corner."""
    base = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], dtype=float)
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    places = np.vstack([base, base - [1, 1, 0]])
    second = faces + 5
    second[second == 7] = 0  # the corner (1, 1, 0) of the second is the first one's origin
    patch = Patch.of(np.vstack([faces, second]))
    assert sorted(len(rim) for rim in patch.rims) == [4, 4]
    closed = patch.solid(places)
    assert trimesh.Trimesh(closed.vertices, closed.faces, process=False).volume == pytest.approx(
        2 / 3
    )


# What is inside of what in a posed body.


def turned(body: SkinnedBody, **angles: tuple[float, float, float]) -> np.ndarray:
    """The vertices with some joints turned."""
    pose = np.zeros((body.n_joints, 3))
    for joint, angle in angles.items():
        pose[body.joint_names.index(joint)] = angle
    return body.vertices(pose)


@pytest.mark.parametrize("name", few(["small", "default"], 1))
def test_bodies_at_rest_have_no_penetrations(name: str) -> None:
    body = load_body(name)
    assert penetrations(body, body.vertices()) == ()


def test_hand_within_the_torso_is_found() -> None:
    body = load_body("small")
    solids = BodySolids.of(body)
    through = turned(body, left_shoulder=(0, -1.2, 0), left_elbow=(0, -2.2, 0))
    found = solids.penetrations(through)
    assert found
    assert found[0].depth == max(one.depth for one in found) > 0.01
    assert {one.part for one in found} & {"left_hand", "left_forearm", "left_fingers"}
    moved = solids.penetrations(through + [3.0, -1.0, 2.0])
    assert [one.part for one in moved] == [one.part for one in found]
    assert np.allclose([a.depth for a in moved], [b.depth for b in found], atol=5e-4)


def test_crossed_legs_penetrate_and_bent_joints_do_not() -> None:
    body = load_body("small")
    solids = BodySolids.of(body)
    crossed = solids.penetrations(turned(body, left_hip=(0, 0, -0.35), right_hip=(0, 0, 0.35)))
    pairs = {frozenset((one.part, one.within)) for one in crossed}
    assert pairs & {
        frozenset(("left_shin", "right_shin")),
        frozenset(("left_thigh", "right_thigh")),
    }
    assert solids.penetrations(turned(body, left_elbow=(0, -1.5, 0))) == ()
    assert solids.penetrations(turned(body, left_knee=(1.2, 0, 0))) == ()


def test_vertices_of_another_body_are_refused() -> None:
    body = load_body("small")
    with pytest.raises(BadBody, match=r"\(369, 3\)"):
        penetrations(body, np.zeros((3, 3)))
    stranger = replace(body, joint_names=tuple(f"bone{k}" for k in range(24)), capsules=None)
    with pytest.raises(BadBody, match="none of the joints of SMPL"):
        penetrations(stranger, stranger.template)
