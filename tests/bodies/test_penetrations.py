"""What is inside of what in a posed body."""

from dataclasses import replace

import numpy as np
import pytest

from workbench import load_body
from workbench.bodies import BodySolids, SkinnedBody, penetrations
from workbench.bodies.parts import solid_of
from workbench.errors import BadBody


def turned(body: SkinnedBody, **angles: tuple[float, float, float]) -> np.ndarray:
    """The vertices with some joints turned."""
    pose = np.zeros((body.n_joints, 3))
    for joint, angle in angles.items():
        pose[body.joint_names.index(joint)] = angle
    return body.vertices(pose)


@pytest.mark.parametrize("name", ["small", "default"])
def test_nothing_is_inside_of_anything_at_rest(name: str) -> None:
    body = load_body(name)
    assert penetrations(body, body.vertices()) == ()


def test_a_hand_within_the_torso_is_found_wherever_the_body_is() -> None:
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


def test_legs_crossed_are_within_each_other_and_bent_joints_are_not() -> None:
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


def test_a_triangle_of_two_parts_folds_with_both() -> None:
    body = load_body("small")
    solids = BodySolids.of(body)
    of_corner = np.array([solid_of(part) for part in solids.parts])[solids.corner_of]
    looked = zip(solids.skins, solids.looked, strict=True)
    for skin, groups in looked:
        own = solid_of(solids.parts[solids.part_of[skin[0]]])
        beside = {s for s in of_corner if frozenset((s, own)) in solids.joined} | {own}
        for faces in groups:
            reached = {*of_corner[body.faces[faces]].ravel()}
            assert "torso" in (own, *reached) or not reached & beside


def test_the_part_that_is_inside_is_that_of_the_nearest_corner() -> None:
    body = load_body("small")
    solids = BodySolids.of(body)
    through = turned(body, left_shoulder=(0, -1.2, 0), left_elbow=(0, -2.2, 0))
    for one in solids.penetrations(through):
        nearest = int(np.argmin(np.linalg.norm(through - one.place, axis=1)))
        there = solids.parts[solids.corner_of[nearest]]
        assert one.part == there or one.within == there


def test_what_is_no_such_body_is_refused() -> None:
    body = load_body("small")
    with pytest.raises(BadBody, match=r"\(369, 3\)"):
        penetrations(body, np.zeros((3, 3)))
    stranger = replace(body, joint_names=tuple(f"bone{k}" for k in range(24)), capsules=None)
    with pytest.raises(BadBody, match="none of the joints of SMPL"):
        penetrations(stranger, stranger.template)
