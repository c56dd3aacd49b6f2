"""Files of motions as estimators and collections write them, made from what is published of each.

Each maker writes what `data/motions/keys.csv` cites for its name, of the motion that it is given.
"""

import io
import json
import pickle
import struct
import sys
import zipfile
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import joblib
import numpy as np
from scipy.spatial.transform import Rotation

from workbench import load_body
from workbench.arrays import Array
from workbench.bodies.files.joint_names import BODY, HANDS
from workbench.motions import Motion

SMALL = load_body("small")
NAMES = (*BODY, "jaw", "left_eye", "right_eye", *HANDS)
F = 12  # frames
BETAS = np.random.default_rng(5).normal(0, 1, 10)
ROOT = SMALL.joints(betas=BETAS[: SMALL.n_betas])[0]


def truth() -> Motion:
    """A motion of SMPL-X's joints at 30 frames a second, y up."""
    rng = np.random.default_rng(3)
    pose = np.cumsum(rng.normal(0, 0.03, (F, 55, 3)), axis=0)
    trans = np.cumsum(rng.normal(0, 0.02, (F, 3)), axis=0)
    return Motion(pose, trans, 30.0, NAMES, BETAS)


def matrices(pose: Array) -> Array:
    """Rotation matrices (..., 3, 3) of vectors (..., 3)."""
    flat = Rotation.from_rotvec(pose.reshape(-1, 3)).as_matrix()
    return flat.reshape(*pose.shape[:-1], 3, 3)


def rotations(motion: Motion, names: Sequence[str]) -> Array:
    """Those of the named joints, (T, K, 3, 3)."""
    return matrices(motion.pose[:, [motion.joint_names.index(name) for name in names]])


def flat(motion: Motion, K: int) -> Array:
    """Poses (T, 3 K) of SMPL with 24 joints, or of the first K of SMPL-X."""
    pose = motion.pose[:, :22]
    if K == 24:
        pose = np.concatenate([pose, np.zeros((len(motion), 2, 3))], axis=1)
    elif K == 52:
        pose = np.concatenate([pose, motion.pose[:, 25:]], axis=1)
    return (motion.pose if K == 55 else pose).reshape(len(motion), -1)


def smplx(m: Motion, rows: slice = slice(None), turned: bool = False) -> dict[str, Any]:
    """The arguments of smplx."""
    pose = matrices(m.pose) if turned else m.pose
    parts = {"global_orient": (0, 1), "body_pose": (1, 22), "jaw_pose": (22, 23)}
    parts |= {"leye_pose": (23, 24), "reye_pose": (24, 25)}
    parts |= {"left_hand_pose": (25, 40), "right_hand_pose": (40, 55)}
    T = len(m.pose[rows])
    shape = (T, -1, 3, 3) if turned else (T, -1)
    arrays = {key: pose[rows, a:b].reshape(shape) for key, (a, b) in parts.items()}
    betas = np.tile(m.betas, (T, 1))
    return {**arrays, "betas": betas, "transl": m.trans[rows], "expression": np.zeros((T, 10))}


def another(m: Motion, frames: int | None = None) -> Motion:
    """Somebody else, in fewer frames if that is asked for."""
    return Motion(m.pose[::-1][:frames] + 0.2, m.trans[:frames] + 1, m.fps, NAMES, m.betas + 1)


def smpl(m: Motion) -> dict[str, Any]:
    """Pose and shape as VIBE and its followers write them."""
    betas = np.tile(m.betas.astype(np.float32), (len(m), 1))
    return {"pose": flat(m, 24), "betas": betas, "frame_ids": np.arange(len(m))}


# ---- PyTorch's own formats, written without it --------------------------------------------------


class _Storage:
    def __init__(self, array: Array) -> None:
        self.array = np.ascontiguousarray(array, dtype="<f4")

    def __reduce__(self) -> Any:
        return sys.modules["torch.storage"]._load_from_bytes, (self._legacy(),)

    def _legacy(self) -> bytes:
        stream = io.BytesIO()
        for head in (0x1950A86A20F9469CFC6C, 1001, {"little_endian": True}):
            pickle.dump(head, stream, 2)
        _dump(self, stream, [])
        pickle.dump(["1"], stream, 2)
        return stream.getvalue() + struct.pack("<q", self.array.size) + self.array.tobytes()


class Tensor:
    """An array that is pickled as PyTorch pickles a tensor of float32."""

    def __init__(self, array: Array) -> None:
        self.array = array

    def __reduce__(self) -> Any:
        size = self.array.shape
        stride = tuple(int(np.prod(size[d + 1 :])) for d in range(len(size)))
        rebuild = sys.modules["torch._utils"]._rebuild_tensor_v2
        return rebuild, (_Storage(self.array), 0, size, stride, False, {})


def _dump(value: Any, stream: Any, storages: list[_Storage]) -> None:
    class Pickler(pickle.Pickler):
        def persistent_id(self, one: Any) -> Any:
            if not isinstance(one, _Storage):
                return None
            storages.append(one)
            kind = sys.modules["torch"].FloatStorage
            return ("storage", kind, str(len(storages) - 1), "cpu", one.array.size)

    Pickler(stream, 2).dump(value)


def _with_torch(write: Callable[[], None]) -> None:
    """Do it while names of PyTorch can be found, which pickle wants."""
    named = {"torch": "FloatStorage", "torch._utils": "_rebuild_tensor_v2"}
    named["torch.storage"] = "_load_from_bytes"
    before = {name: sys.modules.get(name) for name in named}
    for module, name in named.items():
        sys.modules[module] = ModuleType(module)
        made: Any = type(name, (), {"__module__": module})
        if name != "FloatStorage":
            exec(f"def {name}(): pass", made := {"__name__": module})
            made = made[name]
        setattr(sys.modules[module], name, made)
    try:
        write()
    finally:
        for name, known in before.items():
            del sys.modules[name]
            if known is not None:
                sys.modules[name] = known


def torch_file(path: Path, value: Any) -> None:
    """As torch.save writes it."""

    def write() -> None:
        stream, storages = io.BytesIO(), list[_Storage]()
        _dump(value, stream, storages)
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("results/data.pkl", stream.getvalue())
            for k, storage in enumerate(storages):
                archive.writestr(f"results/data/{k}", storage.array.tobytes())

    _with_torch(write)


# ---- one maker for each layout ------------------------------------------------------------------


def objects(value: Any) -> Any:
    """An array of no axes that holds any object."""
    array = np.empty((), dtype=object)
    array[()] = value
    return array


def _wham(path: Path, m: Motion) -> None:
    results: Any = defaultdict(dict)
    turn = Rotation.from_rotvec([0.3, 1.0, 0.2])
    for name, one in ((4, another(m, 5)), (7, m)):
        results[name] = {
            **smpl(one.turned(turn.as_matrix())),
            "trans": one.trans + 3,
            "pose_world": flat(one, 24),
            "trans_world": one.trans,
            "verts": np.zeros((len(one), 10, 3), np.float32),
        }
    joblib.dump(results, path)


def _vibe(path: Path, m: Motion) -> None:
    seen = np.r_[0:4, 5:F]
    person = {key: array[seen] for key, array in smpl(m).items()}
    joblib.dump({1: {**person, "pred_cam": np.zeros((F - 1, 3))}}, path)


def _pare(path: Path, m: Motion) -> None:
    pose = matrices(flat(m, 24).reshape(F, 24, 3)).astype(np.float32)
    joblib.dump({1: {**smpl(m), "pose": pose}, 2: smpl(another(m, 3))}, path, compress=3)


def _phalp(path: Path, m: Motion) -> None:
    frames, two = {}, (another(m), m)
    for t in range(F):
        people = [
            {
                "global_orient": matrices(one.pose[t, :1]),
                "body_pose": matrices(flat(one, 24)[t].reshape(24, 3)[1:]),
                "betas": one.betas,
            }
            for one in two[t > 2 :]
        ]
        frames[f"out/{t:06}.jpg"] = {
            "time": t,
            "tid": [3, 5][t > 2 :],
            "smpl": people,
            "pose": [np.zeros(229)] * len(people),
        }
    joblib.dump(frames, path)


def _tram(path: Path, m: Motion) -> None:
    pose = matrices(flat(m, 24).reshape(F, 24, 3))
    arrays: dict[str, Any] = {
        "pred_rotmat": pose,
        "pred_trans": m.trans[:, None],
        "pred_shape": np.tile(m.betas, (F, 1)),
    }
    tensors = {key: Tensor(array) for key, array in arrays.items()}
    _with_torch(lambda: np.save(path, tensors, allow_pickle=True))  # type: ignore[arg-type]


def _gvhmr(path: Path, m: Motion) -> None:
    keys = ("global_orient", "body_pose", "betas", "transl")
    world = {key: Tensor(smplx(m)[key]) for key in keys}
    camera = {key: Tensor(smplx(another(m))[key]) for key in keys}
    torch_file(path, {"smpl_params_incam": camera, "smpl_params_global": world})


def _romp(path: Path, m: Motion) -> None:
    frames = {
        f"{t:08}.png": {
            "smpl_thetas": np.stack([flat(one, 24)[t] for one in (m, another(m))]),
            "smpl_betas": np.stack([m.betas, m.betas + 1]),
            "cam_trans": np.stack([m.trans[t], m.trans[t] + 1]),
            "track_ids": np.array([2, 9]),
        }
        for t in range(F)
    }
    np.savez(path, results=objects(frames))


def _easymocap(path: Path, m: Motion) -> None:
    """Rh and Th turn and move the person who stands at rest, about the origin of the world."""
    path.mkdir()
    R = matrices(m.pose[:, 0])
    Th = m.trans - np.einsum("tij,j->ti", R - np.eye(3), ROOT)
    for t in range(F):
        one = {
            "id": 0,
            "Rh": m.pose[t, :1].tolist(),
            "Th": Th[t : t + 1].tolist(),
            "poses": [[0.0] * 3 + flat(m, 24)[t, 3:].tolist()],
            "shapes": [m.betas.tolist()],
        }
        (path / f"{t:06}.json").write_text(json.dumps([one, {**one, "id": 1, "Th": [[9, 9, 9]]}]))


def _aist(path: Path, m: Motion) -> None:
    scale = np.array([93.7])
    arrays = {"smpl_poses": flat(m, 24), "smpl_trans": scale * m.trans, "smpl_scaling": scale}
    path.write_bytes(pickle.dumps({**arrays, "smpl_loss": 1.2}))


def _mdm(path: Path, m: Motion) -> None:
    six = matrices(flat(m, 24).reshape(F, 24, 3))[..., :2, :].reshape(F, 24, 6)
    arrays = {"thetas": np.moveaxis(six, 0, -1), "root_translation": m.trans.T, "length": F}
    np.save(path, {**arrays, "text": "a person walks"}, allow_pickle=True)  # type: ignore[arg-type]


def _motion_x(path: Path, m: Motion) -> None:
    pose = m.pose.reshape(F, -1)
    parts = (pose[:, :66], pose[:, 75:], pose[:, 66:69], np.zeros((F, 150)), m.trans)
    np.save(path, np.hstack([*parts, np.tile(m.betas, (F, 1))]).astype(np.float32))


def _grab(path: Path, m: Motion) -> None:
    params = smplx(m) | {"fullpose": flat(m, 55), "left_hand_pose": np.zeros((F, 24))}
    params["right_hand_pose"] = params.pop("left_hand_pose")
    body = {"params": params, "vtemp": "tools/subject_meshes/female/s1.ply"}
    facts: dict[str, Any] = {"gender": "female", "framerate": 120.0, "sbj_id": "s1"}
    np.savez(path, body=objects(body), lhand=objects({"params": {}}), **facts)


def _3dpw(path: Path, m: Motion) -> None:
    two = (another(m), m)
    arrays = {
        "poses": [flat(one, 24) for one in two],
        "trans": [one.trans for one in two],
        "betas": [one.betas for one in two],
        "genders": ["m", "f"],
        "img_frame_ids": np.arange(F),
        "sequence": "downtown_walking_00",
    }
    path.write_bytes(pickle.dumps(arrays, 2))


def _slahmr(path: Path, m: Motion) -> None:
    two = (another(m), m)
    arrays: dict[str, Any] = {
        "trans": np.stack([one.trans for one in two]),
        "root_orient": np.stack([one.pose[:, 0] for one in two]),
        "pose_body": np.stack([one.pose[:, 1:22].reshape(F, 63) for one in two]),
        "betas": np.stack([one.betas for one in two]),
        "world_scale": np.ones((2, 1)),
    }
    np.savez(path, **arrays)


def _smpler_x(path: Path, m: Motion) -> None:
    path.mkdir()
    for t in range(F):
        arrays = smplx(m, slice(t, t + 1))
        for key in ("body_pose", "left_hand_pose", "right_hand_pose"):
            arrays[key] = arrays[key].reshape(-1, 3)
        np.savez(path / f"{t:05}_0.npz", **arrays)


def _human_data(path: Path, m: Motion) -> None:
    inner = smplx(m) | {"body_pose": m.pose[:, 1:22]}
    np.savez(path, smplx=objects(inner), meta=objects({"gender": ["f"] * F}), __data_len__=F)


def _codec(path: Path, m: Motion) -> None:
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            codecVersion=2,
            smplVersion=2,
            gender=2,
            shapeParameters=m.betas,
            frameCount=F,
            frameRate=50.0,
            bodyTranslation=m.trans,
            bodyPose=m.pose[:, :22],
            headPose=m.pose[:, 22:25],
            leftHandPose=m.pose[:, 25:40],
            rightHandPose=m.pose[:, 40:],
        )


def _dictionaries(path: Path, m: Motion) -> None:
    frames = np.array([smplx(m, slice(t, t + 1)) for t in range(F)], dtype=object)
    np.save(path, frames, allow_pickle=True)


def _intergen(path: Path, m: Motion) -> None:
    def one(of: Motion, gender: str) -> dict[str, Any]:
        body = of.pose[:, 1:22].reshape(F, 63)
        arrays = {"root_orient": of.pose[:, 0], "pose_body": body, "trans": of.trans}
        return {**arrays, "betas": of.betas, "gender": gender}

    two = {"person1": one(another(m), "male"), "person2": one(m, "female")}
    path.write_bytes(pickle.dumps({**two, "mocap_framerate": 59.94}))


def _fit3d(path: Path, m: Motion) -> None:
    """IMAR's SMPL-X parameters, in matrices."""
    path.write_text(json.dumps({key: one.tolist() for key, one in smplx(m, turned=True).items()}))


def _six(path: Path, m: Motion) -> None:
    rows = matrices(m.pose)[..., :2, :].reshape(F, 55, 6)
    arrays: dict[str, Any] = {
        "global_orient_6d": rows[:, 0],
        "body_pose_6d": rows[:, 1:22],
        "transl": m.trans,
    }
    np.savez(path, **arrays, fps=25)


def _varying(path: Path, m: Motion) -> None:
    betas = np.tile(m.betas, (F, 1))
    betas[:3] += 5
    arrays: dict[str, Any] = {"poses": flat(m, 52), "trans": m.trans, "betas": betas}
    np.savez(path, **arrays, mocap_framerate=120.0, gender=np.array("male", dtype=object))


def _named(path: Path, m: Motion) -> None:
    np.savez(path, **smplx(m))


def _down(path: Path, m: Motion) -> None:
    """In a camera whose y points down, as OpenCV's does."""
    there = m.turned(np.diag([1.0, -1, -1]), ROOT)
    joblib.dump({1: {**smpl(there), "trans": there.trans}}, path)


Maker = Callable[[Path, Motion], None]
# by name: the file, the maker, and what is expected: joints, frames a second, gender, the name of
# the person in most frames, how close rotations are, and words of the notes
RESULTS: dict[str, tuple[str, Maker, dict[str, Any]]] = {
    "smplx": ("a.npz", _named, {"K": 55, "said": "30 frames a second are taken"}),
    "betas vary": ("a.npz", _varying, {"K": 52, "fps": 120, "gender": "male", "said": "medians"}),
    "WHAM": ("wham_output.pkl", _wham, {"said": "of 2 people (4, 7) 7 is read"}),
    "VIBE": ("vibe_output.pkl", _vibe, {"still": True, "gap": 4, "said": "no translation"}),
    "PARE": ("pare_output.pkl", _pare, {"still": True, "said": "of 2 people (1, 2) 1 is read"}),
    "PHALP, 4D-Humans": ("demo.pkl", _phalp, {"still": True, "said": "of 2 people (3, 5) 5 is"}),
    "TRAM": ("hps_track_0.npy", _tram, {}),
    "GVHMR": ("hmr4d_results.pt", _gvhmr, {"K": 22}),
    "ROMP": ("video_results.npz", _romp, {"said": "of 2 people (2, 9) 2 is read"}),
    "EasyMocap": ("smpl", _easymocap, {"said": "of 2 people (0, 1) 0 is read"}),
    "AIST++": ("gBR.pkl", _aist, {"fps": 60, "said": "divided by smpl_scaling, 93.7"}),
    "MDM": ("sample00.npy", _mdm, {"fps": 20}),
    "Motion-X": ("000001.npy", _motion_x, {"K": 53}),
    "GRAB": ("mug_pass_1.npz", _grab, {"K": 55, "fps": 120, "gender": "female"}),
    "3DPW": ("downtown.pkl", _3dpw, {"person": "1", "gender": "female"}),
    "SLAHMR": ("world_results.npz", _slahmr, {"K": 22, "person": "1"}),
    "SMPLer-X": ("smplx", _smpler_x, {"K": 55}),
    "HumanData": ("human.npz", _human_data, {"K": 55, "gender": "female"}),
    "smplcodec": ("a.smpl", _codec, {"K": 55, "fps": 50, "gender": "female"}),
    "dictionaries": ("frames.npy", _dictionaries, {"K": 55}),
    "InterGen": (
        "1.pkl",
        _intergen,
        {"K": 22, "person": "person2", "fps": 59.94, "gender": "female"},
    ),
    "Fit3D": ("smplx.json", _fit3d, {"K": 55}),
    "six numbers": ("a.npz", _six, {"K": 22, "fps": 25}),
    "y down": ("results.pkl", _down, {"said": "-y is taken to be up"}),
}
