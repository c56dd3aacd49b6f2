"""Files of AMASS and of estimators, the workbench's own, and what is refused."""

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import workbench as wb
from tests.bodies.model_files import MODELS, written
from tests.motions import made_results
from tests.motions.made_files import amass_entries, newer_entries, random_motion
from workbench.arrays import Array
from workbench.bodies.files.joint_names import BODY, HANDS, joint_names
from workbench.errors import BadFile
from workbench.motions import Bones, Motion, read_motion, save_motion

SMALL = wb.load_body("small")
XNAMES = (*BODY, "jaw", "left_eye", "right_eye", *HANDS)


def walk() -> Motion:
    return random_motion(SMALL.n_joints, SMALL.joint_names)


def saved(folder: Path, entries: dict[str, Any]) -> Path:
    path = folder / "walk.npz"
    np.savez(path, **entries)
    return path


def with_z_up(motion: Motion) -> dict[str, Array]:
    """What AMASS would hold of it, for the small body: its root included."""
    root = SMALL.joints(betas=motion.betas)[0]
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    there = motion.turned(turn, root)
    return amass_entries(motion) | {"poses": there.pose.reshape(-1, 72), "trans": there.trans}


def test_older_layout_is_turned_about_the_root(tmp_path: Path) -> None:
    """Trans differs by (R - I) J_0, so that the body has to be known."""
    motion = walk()
    path = saved(tmp_path, with_z_up(motion))
    read = read_motion(path, body=SMALL)
    np.testing.assert_allclose(read.vertices(SMALL), motion.vertices(SMALL), atol=1e-12)
    assert read.fps == motion.fps
    assert read.joint_names == SMALL.joint_names
    said = " ".join(read.notes)
    assert "made for SMPL of the gender female" in said
    assert "z is taken to be up, along which the root's own y axis points" in said
    alone = read_motion(path)
    apart = alone.vertices(SMALL) - motion.vertices(SMALL)
    np.testing.assert_allclose(apart, np.broadcast_to(apart[0, 0], apart.shape), atol=1e-12)
    assert any("give the body to correct it" in note for note in alone.notes)


@pytest.mark.parametrize("name", made_results.RESULTS)
def test_results_of_others_are_read(name: str, tmp_path: Path) -> None:
    """Rotations, translations, rate, gender, and who was chosen."""
    file, make, expected = made_results.RESULTS[name]
    true = made_results.truth()
    make(tmp_path / file, true)
    motion = read_motion(tmp_path / file, body=SMALL, person=expected.get("person"))
    assert len(motion.joint_names) == expected.get("K", 24)
    assert motion.fps == expected.get("fps", 30.0)
    assert motion.gender == expected.get("gender", "")
    assert expected.get("said", "") in " | ".join(motion.notes)
    if motion.betas.size:
        np.testing.assert_allclose(motion.betas, true.betas, atol=1e-6)
    if expected.get("still"):
        true = replace(true, trans=0 * true.trans)
    shared = [name for name in motion.joint_names if name in made_results.NAMES]
    there, here = (made_results.rotations(one, shared) for one in (true, motion))
    seen = np.arange(len(true)) != expected.get("gap", -1)
    assert len(shared) >= 22
    np.testing.assert_allclose(here[seen], there[seen], atol=1e-6)
    np.testing.assert_allclose(motion.trans[seen], true.trans[seen], atol=1e-6)


def test_newer_layout_is_read_whole_and_in_parts(tmp_path: Path) -> None:
    motion = random_motion(55, XNAMES)
    entries = newer_entries(motion)
    whole = read_motion(saved(tmp_path, entries))
    assert whole.joint_names == XNAMES
    np.testing.assert_allclose(whole.pose, motion.pose, atol=1e-12)
    parts = read_motion(saved(tmp_path, {k: v for k, v in entries.items() if k != "poses"}))
    assert parts.joint_names == XNAMES
    np.testing.assert_array_equal(parts.pose, whole.pose)
    assert any("not read are num_betas" in note for note in parts.notes)
    few = {k: v for k, v in entries.items() if k not in ("poses", "pose_hand", "pose_eye")}
    assert read_motion(saved(tmp_path, few)).joint_names == (*BODY, "jaw")


def test_motion_survives_its_file(tmp_path: Path) -> None:
    bones = Bones((-1, 0), np.array([[0.0, 1, 0], [0, 0.5, 0]]), (1,), np.array([[0, 0.2, 0.0]]))
    pose = np.random.default_rng(0).normal(0, 1, (5, 2, 3))
    motion = Motion(
        pose,
        pose[:, 0],
        59.94,
        ("hips", "chest"),
        (0.5,),  # type: ignore[arg-type]
        np.ones((5, 3)),
        bones,
        "made up",
        ("a sentence",),
    )
    save_motion(tmp_path / "walk.npz", motion)
    read = read_motion(tmp_path / "walk.npz")
    assert read.notes == motion.notes
    for name in ("pose", "trans", "betas", "expression"):
        np.testing.assert_array_equal(getattr(read, name), getattr(motion, name))
    assert (read.fps, read.joint_names) == (59.94, ("hips", "chest"))
    assert (read.origin, read.notes) == ("made up", ("a sentence",))
    assert read.bones is not None
    np.testing.assert_array_equal(read.joints(), motion.joints())
    np.testing.assert_array_equal(read.bones.end_offsets, bones.end_offsets)
    many = random_motion(66, [f"joint{k}" for k in range(66)])  # 198 numbers, as of 22 matrices
    save_motion(tmp_path / "many.npz", many)
    np.testing.assert_array_equal(read_motion(tmp_path / "many.npz").pose, many.pose)
    with np.load(tmp_path / "walk.npz") as arrays:  # AMASS's names
        assert arrays["poses"].shape == (5, 6)
        assert {"trans", "betas", "mocap_framerate", "gender"} <= set(arrays)
        assert str(arrays["gender"]) == "neutral"
    with pytest.raises(BadFile, match=r"a motion is saved as \.npz"):
        save_motion(tmp_path / "walk.txt", motion)


@pytest.mark.parametrize("to", ["amass.npz", "smplx.npz", "amass.smpl"])
@pytest.mark.parametrize("K", [24, 52, 55])
def test_layouts_are_read_back(K: int, to: str, tmp_path: Path) -> None:
    motion, name = in_layout(K), tmp_path / to
    save_motion(name, motion, name.stem)
    again = read_motion(name, up="y")
    assert (again.joint_names, again.gender, again.fps) == (motion.joint_names, "female", 30.0)
    np.testing.assert_allclose(again.pose, motion.pose, atol=1e-6)
    np.testing.assert_allclose(again.trans, motion.trans, atol=1e-6)
    np.testing.assert_allclose(again.betas, motion.betas, atol=1e-6)
    with pytest.raises(BadFile, match="has places for the joints of SMPL and its relatives"):
        save_motion(tmp_path / "b.smpl", Motion(motion.pose[:, :1], motion.trans, 30.0, ("tail",)))


def in_layout(K: int) -> Motion:
    """A motion of SMPL, SMPL-H or SMPL-X."""
    motion = random_motion(K, joint_names(K))
    face = np.ones((len(motion), 10)) if K == 55 else None
    return replace(motion, fps=30.0, gender="female", expression=face)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["SMPL", "SMPL-H", "SMPL-X"])
def test_saved_motions_move_models_of_smplx(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    smplx = pytest.importorskip("smplx", reason="models of smplx; pip install smplx torch")
    torch = pytest.importorskip("torch", reason="models of smplx; pip install smplx torch")
    make, suffix = MODELS[kind]
    body = wb.load_body(written(make(40), tmp_path / f"model{suffix}"))
    known = smplx.body_models.VERTEX_IDS  # of whole models, of which this one has 40 vertices
    few = {kind: dict.fromkeys(ids, 0) for kind, ids in known.items()}
    monkeypatch.setattr(smplx.body_models, "VERTEX_IDS", few)
    more = {} if kind == "SMPL" else {"use_pca": False, "flat_hand_mean": True}
    model = getattr(smplx, kind.replace("-", ""))(
        str(tmp_path / f"model{suffix}"), ext=suffix[1:], num_betas=10, **more
    )
    motion = in_layout(body.n_joints)
    save_motion(tmp_path / "a.npz", motion, "smplx")
    with np.load(tmp_path / "a.npz") as arrays:
        tensors = {k: torch.from_numpy(arrays[k]) for k in arrays if arrays[k].dtype == np.float32}
    moved = model(**tensors).vertices.detach().numpy()
    np.testing.assert_allclose(moved, motion.vertices(body), atol=1e-5)


def test_facts_survive_saving(tmp_path: Path) -> None:
    entries = amass_entries(walk())
    entries["dmpls"][:] = np.random.default_rng(1).normal(0, 1, (6, 8))
    motion = read_motion(saved(tmp_path, entries))
    save_motion(tmp_path / "again.npz", motion.resampled(5.0)[:3].named(SMALL))
    again = read_motion(tmp_path / "again.npz")
    assert (motion.gender, again.gender) == ("female", "female")
    assert motion.dmpls is not None
    assert again.dmpls is not None
    np.testing.assert_array_equal(motion.dmpls, entries["dmpls"])
    np.testing.assert_array_equal(again.dmpls, motion.resampled(5.0).dmpls[:3])  # type: ignore[index]


def test_frames_of_nan_are_filled(tmp_path: Path) -> None:
    entries = amass_entries(walk())
    entries["poses"][2, 5] = np.nan
    entries["trans"][0] = np.nan
    motion = read_motion(saved(tmp_path, entries))
    assert len(motion) == len(walk()) - 1
    assert "1 of 6 frames were not found, and are interpolated" in motion.notes
    assert "1 of 6 frames at the ends were not found, and are left out" in motion.notes


def without(name: str) -> dict[str, Any]:
    return {k: v for k, v in amass_entries(walk()).items() if k != name}


OLD = amass_entries(walk())


def test_damaged_motions_are_refused(tmp_path: Path) -> None:
    for entries, said in [
        (without("poses"), "it has no pose: no pose_world, .*; it holds betas, dmpls, gender"),
        (OLD | {"mocap_framerate": np.array(0.0)}, "rate is not one number of frames"),
        (OLD | {"fps": np.array(30.0)}, "rate is not one number of frames"),
        (OLD | {"trans": np.zeros((7, 3))}, "trans|poses"),
        (OLD | {"poses": np.zeros((6, 71))}, "poses has 71 columns, and three belong to each"),
        (OLD | {"poses": np.zeros((6, 24, 4))}, "quaternions are not read"),
        (
            OLD | {"poses": np.zeros((0, 72)), "trans": np.zeros((0, 3))},
            r"poses of shape \(0, 72\) has that of no frame",
        ),
        (OLD | {"poses": np.full((6, 72), 1e9)}, "poses holds numbers beyond 1e.06"),
        (OLD | {"betas": np.full(10, np.nan)}, "betas is nan"),
        (OLD | {"poses": np.array([None])}, "it has no pose"),
        (
            newer_entries(random_motion(55, XNAMES)) | {"pose_body": np.ones((6, 63))},
            "poses and pose_body say different things",
        ),
        *(
            (OLD | {"smpl_scaling": np.array([scale])}, "smpl_scaling is .*, and trans can only be")
            for scale in (0.0, -1.0, np.inf)
        ),
        (OLD | {"joint_names": np.array(["a", "a"])}, "poses has 24 joints, and joint_names 2"),
    ]:
        with pytest.raises(BadFile, match=said) as refused:
            read_motion(saved(tmp_path, entries))
        assert "walk.npz is no motion (" in str(refused.value)


@pytest.mark.thorough
def test_pickles_that_say_the_same_again_and_again_are_refused(tmp_path: Path) -> None:
    many: list[Any] = [0.5] * 1000
    for _ in range(8):
        many = [many] * 100
    endless: list[Any] = []
    endless.append(endless)
    person = {"poses": np.zeros((2000, 72))}
    for value, said in [
        ({"poses": many}, "would take more than 8 times"),
        ({"poses": endless}, "lists nested more than 12 deep"),
        ({str(i): person for i in range(20_000)}, "would take more than 8 times"),
        ({"a": {"b": [{}] * 200_000}}, "it holds more than 2,000,000 values"),
    ]:
        (tmp_path / "walk.pkl").write_bytes(pickle.dumps(value))
        with pytest.raises(BadFile, match=said):
            read_motion(tmp_path / "walk.pkl")


def test_folders_of_motions_are_not_taken_for_frames(tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        np.savez(tmp_path / name, **OLD)  # type: ignore[arg-type]
    with pytest.raises(BadFile, match="it holds motions, one of 6 frames"):
        read_motion(tmp_path)


def test_arrays_of_places_are_no_motions(tmp_path: Path) -> None:
    places = walk().joints(SMALL)[:, :22]
    for array, said in [
        (places, "its numbers are places of joints of HumanML3D"),
        (np.zeros((9, 263)), "its numbers are 263 features of HumanML3D"),
    ]:
        np.save(tmp_path / "000001.npy", array)
        with pytest.raises(BadFile, match=said):
            read_motion(tmp_path / "000001.npy")


def test_rotations_in_degrees_are_noted(tmp_path: Path) -> None:
    turned = np.zeros((6, 72))
    turned[:, 3] = 90.0
    for poses, noted in ((turned, True), (np.radians(turned), False)):
        np.savez(tmp_path / "a.npz", **OLD | {"poses": poses})
        notes = " ".join(read_motion(tmp_path / "a.npz").notes)
        assert ("up to 90 rad long, 14.3 whole turns" in notes) == noted


def test_rate_and_axis_can_be_given(tmp_path: Path) -> None:
    path = saved(tmp_path, without("mocap_framerate"))
    motion = read_motion(path, fps=12.0, up="y")
    assert motion.fps == 12.0
    assert read_motion(path, unit="cm", up="y").trans[1, 0] == pytest.approx(
        OLD["trans"][1, 0] / 100
    )
    np.testing.assert_array_equal(motion.trans, OLD["trans"])
    with pytest.raises(BadFile, match=r"that ends in \.bvh, \.glb"):
        read_motion(tmp_path / "walk.fbx")
    with pytest.raises(BadFile, match=r"there is no file .*walk2\.npz"):
        read_motion(tmp_path / "walk2.npz")
