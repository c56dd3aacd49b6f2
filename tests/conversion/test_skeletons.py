"""Skeletons of many kinds become motions of a body by the names of their joints."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import workbench as wb
from tests.clips_made_up import clip
from tests.conversion.made_skeletons import KINDS, Kind, still, write_skeleton
from workbench.bodies.files.joint_names import BODY, HANDS
from workbench.conversion import PointFit, motion_from_points, motion_from_skeleton
from workbench.errors import BadArgument
from workbench.motions import Motion, read_bvh
from workbench.motions.skeleton_names import reading, readings, skeletons, words_of

SMALL, MALE = wb.load_body("small"), wb.load_body("default-male")
QUICK = ("CMU (cgspeed)", "Bandai-Namco", "Unreal mannequin")


def person(frames: int, seed: int) -> Motion:
    """A man who stands upright and moves, at 30 frames a second."""
    made_up = clip(MALE, frames, seed)
    pose = made_up.pose.copy()
    pose[:, 0] = [0.05, seed, 0.0]
    return replace(made_up, pose=pose)


def fitted(folder: Path, kind: Kind, motion: Motion, target: wb.SkinnedBody) -> PointFit:
    """The fit to a file of this kind, whose joints are read where they were."""
    path = folder / "walk.bvh"
    at = write_skeleton(path, motion, MALE, kind)
    found = read_bvh(path)
    names = [name for name, *_ in kind.tree()]
    own = [names.index(name) for name in found.joint_names]
    np.testing.assert_allclose(found.joints(), at[:, own], atol=1e-6)
    return motion_from_skeleton(found, target)


def moves(motion: Motion, body: wb.SkinnedBody) -> float:
    """How far joints move about the root, root mean square in m."""
    at = motion.joints(body)
    about = Rotation.from_rotvec(motion.pose[:, :1].repeat(at.shape[1], axis=1).reshape(-1, 3))
    inner = about.inv().apply((at - at[:, :1]).reshape(-1, 3)).reshape(at.shape)
    return float(np.sqrt(np.mean((inner - inner.mean(axis=0)) ** 2)))


def check(fit: PointFit, kind: Kind, motion: Motion, target: wb.SkinnedBody, name: str) -> None:
    assert f"by the names of {name}" in fit.motion.notes[0]
    assert {*fit.names} == {joint for _, _, joint in kind.tree() if joint}
    assert 1e3 * np.nanmean(fit.errors) < 10
    assert moves(fit.motion, target) == pytest.approx(moves(still(motion, kind), MALE), rel=0.25)


@pytest.mark.parametrize("name", QUICK)
def test_skeleton_is_known_by_its_names(tmp_path: Path, name: str) -> None:
    motion = person(4, seed=1)
    check(fitted(tmp_path, KINDS[name], motion, SMALL), KINDS[name], motion, SMALL, name)


@pytest.mark.thorough
@pytest.mark.parametrize("name", KINDS)
def test_ten_clips_of_each_kind_of_skeleton(tmp_path: Path, name: str) -> None:
    target = wb.load_body("default")
    for seed in range(10):
        motion = person(25, seed)
        fit = fitted(tmp_path, KINDS[name], motion, target)
        check(fit, KINDS[name], motion, target, name)


def test_heads_turn_as_in_the_skeleton(tmp_path: Path) -> None:
    """Places do not tell that a head is shaken."""
    motion = clip(MALE, 1, seed=2)
    pose = np.repeat(motion.pose, 6, axis=0)
    head = MALE.joint_names.index("head")
    shaken = np.radians([0, 20, 40, 20, -20, -60])
    pose[:, head] = shaken[:, None] * [0.0, 1.0, 0.0]
    shaking = replace(motion, pose=pose, trans=np.repeat(motion.trans, 6, axis=0))
    found = fitted(tmp_path, KINDS["LAFAN1"], shaking, SMALL).motion
    k = SMALL.joint_names.index("head")
    turns = Rotation.from_rotvec(found.pose[:, k])
    np.testing.assert_allclose((turns * turns[0].inv()).magnitude(), abs(shaken), atol=0.02)


def test_names_are_read_however_they_are_spelt() -> None:
    for label, name in [
        ("LeftUpLeg", "left upleg"),
        ("leftUpLeg", "left upleg"),
        ("left_up_leg", "left upleg"),
        ("UpLeg.L", "left upleg"),
        ("up-leg_l", "left upleg"),
        ("L_UpLeg", "left upleg"),
        ("L UpLeg", "left upleg"),
        ("lUpLeg", "left upleg"),
        ("LUpLeg", "left upleg"),
        ("RHJC", "right hjc"),
        ("rightbigtoe", "right bigtoe"),
        ("rhip", "right hip"),
        ("spine_01", "spine1"),
        ("Spine.001", "spine1"),
        ("L5", "l5"),
        ("LittleProximal_R", "right pinkyproximal"),
    ]:
        assert name in reading(words_of(label)), label
    assert reading(words_of("Root"))[0] == "root"


@pytest.mark.parametrize("prefix", ["mixamorig:", "mixamorig", "Subject01_", "Bip001 ", "a|b|C:"])
def test_prefixes_do_not_matter(prefix: str) -> None:
    there = readings([prefix + name for name in ("Hips", "LeftUpLeg", "RightUpLeg", "Spine1")])
    assert {"hips": [0], "left upleg": [1], "spine1": [3]}.items() <= there.items()


def test_table_of_names_is_whole() -> None:
    assert len(skeletons()) >= 15
    for kind in skeletons():
        assert kind.source
        assert {*kind.joints} <= {*BODY, *HANDS}
        for limb in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist"):
            assert kind.joints[f"left_{limb}"]
    assert {*KINDS} <= {kind.name for kind in skeletons()}


OPENSIM = "pelvis {0} hip {0} knee {0} ankle {0} mtp {0} acromial {0} elbow {0} radius_hand"
BODIES = "pelvis {0} femur {0} tibia {0} talus {0} toes {0} humerus {0} ulna {0} hand"
JOINTS = "pelvis {0} hip {0} knee {0} ankle {0} foot {0} shoulder {0} elbow {0} wrist"


@pytest.mark.parametrize("names", [OPENSIM, BODIES])
def test_points_of_opensim_are_known(names: str) -> None:
    motion = clip(SMALL, 3, seed=4)
    own, *limbs = names.split(" {0} ")
    joints = JOINTS.split(" {0} ")[1:]
    labels = [own] + [f"{limb}_{side}" for limb in limbs for side in "rl"]
    known = ["pelvis"] + [f"{side}_{limb}" for limb in joints for side in ("right", "left")]
    places = motion.joints(SMALL)[:, [SMALL.joint_names.index(name) for name in known]]
    found = motion_from_points(places, labels, SMALL, 30)
    assert "by the names of OpenSim" in found.motion.notes[0]
    assert {*found.names} == {*known}
    assert 1e3 * found.errors.mean() < 10


def test_joints_of_smpl_and_keypoints_of_coco_are_known() -> None:
    motion = clip(SMALL, 3, seed=5)
    first = [n.replace("left_", "L_").replace("right_", "R_").title() for n in SMALL.joint_names]
    found = motion_from_points(motion.joints(SMALL), first, SMALL, 30)
    assert "24 of 24 points are joints of body 'small'" in found.motion.notes
    smplx = (*SMALL.joint_names[:22], "jaw", "left_eye_smplhf", "left_index1")
    places = np.concatenate([motion.joints(SMALL)[:, :22], np.zeros((3, 3, 3))], axis=1)
    assert motion_from_points(places, smplx, SMALL, 30).names == SMALL.joint_names[:22]
    coco = SMALL.landmark_names("coco")[:17]
    seen = motion.landmark(SMALL, "coco")[:, :17]
    assert motion_from_points(seen, coco, SMALL, 30).names == coco


def test_skeletons_of_unknown_names_are_refused(tmp_path: Path) -> None:
    write_skeleton(tmp_path / "walk.bvh", clip(MALE, 2, seed=6), MALE, KINDS["LAFAN1"])
    found = read_bvh(tmp_path / "walk.bvh")
    unknown = [f"Bone{k:02}" for k in range(len(found.joint_names))]
    with pytest.raises(BadArgument, match=r"has 0 among .* \(--names\)"):
        motion_from_skeleton(found, SMALL, names=unknown)
    few = ["left_hip", "left_knee", "right_hip", "neck", *unknown[4:]]
    with pytest.raises(BadArgument, match="the body would be a statue"):
        motion_from_skeleton(found, SMALL, names=few)
