"""Motions of SMPL and its relatives in files: AMASS's, those of estimators, and our own.

AMASS: Mahmood, Ghorbani, Troje, Pons-Moll and Black, Archive of Motion Capture as Surface Shapes,
2019. What others call their arrays is the table of `people`.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.files.joint_names import BODY, HANDS, NAMES, family, joint_names
from workbench.errors import BadArgument, BadFile, listed, some
from workbench.geometry.guesses import UNITS, UP_TO_Y, check_given, rate_of
from workbench.geometry.rotation import matrix_from_vector
from workbench.motions.bones import Bones
from workbench.motions.contents import Contents, contents_of
from workbench.motions.motion import Motion, without_gaps
from workbench.motions.people import MAIN, People, Track, lines_of
from workbench.reading.arrays import taken_for
from workbench.writing import write_arrays

SMPL, FACE = NAMES[24][1], ("jaw", "left_eye", "right_eye")
PARTS: dict[str, tuple[str, ...]] = {  # the joints of each part; a body may have SMPL's two hands
    **{"root": BODY[:1], "body": (*BODY[1:], *SMPL[22:]), "head": FACE, "jaw": FACE[:1]},
    **{"eyes": FACE[1:], "left_eye": FACE[1:2], "right_eye": FACE[2:]},
    **{"left_hand": HANDS[:15], "right_hand": HANDS[15:], "hands": HANDS},
}
ORDER = (*SMPL, *FACE, *HANDS)  # of the joints of a pose that is put together
GENDERS = {"0": "neutral", "1": "male", "2": "female", "m": "male", "f": "female", "n": "neutral"}
AGREE = 1e-3  # rad, between a pose and a part of it that stands beside it
SURE = 0.5  # of how clearly the root's own y must point along an axis to say that it is up
LARGEST = 1e6  # rad or m
FASTEST = 15.0  # m/s, of a root on average
SPARSEST = 10  # times as many frames as there are, with those between
INSTEAD = "give a file with poses, or global_orient and body_pose, and a translation"


def read_amass(
    path: str | Path,
    *,
    unit: str | None = None,
    up: str | None = None,
    fps: float | None = None,
    body: Body | None = None,
    person: str | None = None,
) -> Motion:
    """Read a motion of SMPL or a relative: of AMASS, of an estimator, or as `save_motion` writes.

    A file is .npz, .npy, .pkl (of joblib too), .pt, .json or .smpl, or a folder with a file for
    each frame; nothing in it is run. Its arrays may have any of the names in the table of `people`,
    and hold vectors, matrices or six numbers for each rotation. Of several people the one in most
    frames is read, or the `person` of that name. Betas of each frame become their median. Frames
    that hold NaN, or are missing, are filled.

    The motion is turned so that y is up; which axis it was is guessed from where the root's own y
    axis points, unless it is given. The body turns about its root joint, so that turning the world
    moves trans by (R - I) J_0: give the `body` for which the motion was made, or else the whole
    motion is displaced by this constant. `fps` takes the place of the file's rate, and `unit` is
    that of trans if it is not m. `notes` say what was taken, and what was not read. Raises BadFile,
    and UnknownName for a unit or an axis.
    """
    check_given(unit, up)
    with taken_for(path, "motion", INSTEAD), contents_of(Path(path)) as contents:
        people = People(contents)
        track, notes = _chosen(people, person)
        facts = _Facts(contents, track)
        pose, names = _pose(track, facts.texts("joint_names"))
        gender = facts.gender()
        if not facts.texts("joint_names"):
            of = f" of the gender {some([gender])}" if gender else ""
            notes.append(f"made for {family(len(names))}{of}")
        rate, said = rate_of(fps, facts.rates(), track.usual_rate)
        notes += [*said, *track.notes]
        pose, trans = _placed(track, pose, body, notes)
        if unit is not None:
            trans = trans * UNITS[unit]
            notes.append(f"the unit {unit} of trans was given")
        lines = {"trans": trans} | {
            part: track.numbers[part] for part in ("expression", "dmpls") if part in track.numbers
        }
        pose, lines = _spread(track, pose, lines, notes)
        try:
            pose, lines, filled = without_gaps(pose, lines)
            betas = _betas(track, notes)
            motion = Motion(
                pose,
                lines["trans"],
                rate,
                names,
                betas,
                lines.get("expression"),
                facts.bones(),
                facts.text("origin") or Path(path).name,
                (*facts.texts("notes"), *filled),
                gender,
                lines.get("dmpls"),
            )
        except BadArgument as error:
            raise BadFile(str(error)) from error
        declared = facts.text("up_axis")
        speed = np.linalg.norm(np.diff(motion.trans, axis=0), axis=1).sum() / len(motion)
        if not declared and speed * rate > FASTEST:
            notes.append(
                f"the root moves at {speed * rate:.3g} m/s on average, as no person does; give the "
                "unit of trans, or the rate"
            )
        if unread := [key for key, read in people.met.items() if not read | (key in facts.read)]:
            notes.insert(1, f"not read are {some(sorted(unread))}")
    return _upright(motion, up, declared, body, notes)


def _chosen(people: People, person: str | None) -> tuple[Track, list[str]]:
    """The track of a person, and a note if there are several."""
    tracks = people.tracks
    if not tracks and people.misfits:
        raise BadFile(f"it has no pose: {some(people.misfits)} has that of no frame")
    if not tracks:
        pose = [line.key for part in MAIN for line in lines_of(part)]
        raise BadFile(
            f"it has no pose: none of {', '.join(dict.fromkeys(pose[:6]))} and other names; it "
            f"holds {listed(people.met) if people.met else 'nothing with a name'}"
        )
    if person is not None and person not in tracks:
        raise BadFile(f"it holds no person {person!r:.40}; there are {listed(tracks)}")
    seen = {
        name: int(np.isfinite(next(iter(track.turns.values()))).all(axis=(1, 2)).sum())
        for name, track in tracks.items()
    }
    name = max(tracks, key=lambda one: seen[one]) if person is None else person
    if len(tracks) == 1:
        return tracks[name], []
    which = "is read, as was asked" if person is not None else "is read, in most frames"
    note = f"of {len(tracks)} people ({some(tracks)}) {name} {which}: {seen[name]} frames"
    return tracks[name], [f"{note}; name another one (--person)" if person is None else note]


class _Facts:
    """What stands in a file beside the arrays of a person."""

    def __init__(self, contents: Contents, track: Track) -> None:
        self._contents, self._facts, self._which = contents, track.facts, track.which
        self.read: set[str] = set()

    def _values(self, part: str) -> list[tuple[str, object]]:
        keys = [line.key for line in lines_of(part) if line.key in self._facts]
        self.read |= {*keys}
        return [(key, self._contents.plain(self._facts[key])) for key in keys]

    def text(self, key: str) -> str:
        """A text; empty if it is none."""
        self.read.add(key)
        return self._contents.text(self._facts.get(key))

    def texts(self, key: str) -> tuple[str, ...]:
        """An array or a list of texts; empty if it is none."""
        self.read.add(key)
        value = self._contents.plain(self._facts.get(key))
        value = value.tolist() if isinstance(value, np.ndarray) else value
        several = isinstance(value, list) and all(isinstance(one, str) for one in value)
        return tuple(value) if several else ()

    def gender(self) -> str:
        """The gender as the file says it, spelled out."""
        for key, value in self._values("gender"):
            several = value if isinstance(value, list) else np.ravel(np.asarray(value)).tolist()
            one = several[self._which if self._which < len(several) else 0] if several else None
            text = str(one) if isinstance(one, int) else self._contents.text(one)
            if text:
                return GENDERS.get(text.lower(), text)
            self.read.discard(key)
        return ""

    def rates(self) -> list[float]:
        """The frames a second that it states. Raises BadFile if they are none."""
        found = [self._contents.numbers(value) for _, value in self._values("rate")]
        if any(one is None or one.size != 1 for one in found):
            raise BadFile("its rate is not one number of frames a second")
        return [float(one.reshape(-1)[0]) for one in found if one is not None]

    def bones(self) -> Bones | None:
        """The skeleton, in a file of our own."""
        found = {}
        for name in ("bone_parents", "bone_offsets", "end_parents", "end_offsets"):
            self.read.add(name)
            array = self._contents.numbers(self._facts.get(name))
            if array is not None and np.isfinite(array).all():
                found[name] = array
        if "bone_parents" not in found or "bone_offsets" not in found:
            return None
        parents, ends = (
            tuple(int(k) for k in found.get(name, np.zeros(0)).reshape(-1))
            for name in ("bone_parents", "end_parents")
        )
        return Bones(
            parents, found["bone_offsets"], ends, found.get("end_offsets", np.zeros((0, 3)))
        )


def _pose(track: Track, own: tuple[str, ...]) -> tuple[Array, tuple[str, ...]]:
    """The pose (T, K, 3) and the names of joints; poses and their parts must say the same."""
    joints: dict[str, Array] = {}
    if "pose" in track.turns:
        pose = track.turns["pose"]
        K = pose.shape[1]
        usual = {22: BODY, 21: BODY[1:], 23: SMPL[1:]}.get(K) or joint_names(K)
        if own and len(own) != K:
            raise BadFile(f"poses has {K} joints, and joint_names {len(own)}")
        joints = dict(zip(own or usual, pose.swapaxes(0, 1), strict=False))
        if len(joints) < K:
            raise BadFile("two of its joint_names are the same")
    whole = len(joints)
    for part, names in PARTS.items():
        if part not in track.turns or track.used[part].form == "origin":
            continue
        for name, turns in zip(names, track.turns[part].swapaxes(0, 1), strict=False):
            if not np.allclose(joints.setdefault(name, turns), turns, atol=AGREE, equal_nan=True):
                raise BadFile(
                    f"{track.used['pose'].key} and {track.used[part].key} say different things"
                )
    if len(joints) > whole:
        joints.setdefault("pelvis", np.zeros((len(track), 3)))
        joints = {name: joints[name] for name in ORDER if name in joints}
    return np.stack([*joints.values()], axis=1), tuple(joints)


def _placed(track: Track, pose: Array, body: Body | None, notes: list[str]) -> tuple[Array, Array]:
    """The pose and trans (T, 3) m of SMPL, which turns about its root joint."""
    T = len(pose)
    trans = track.numbers.get("trans", np.zeros((1, 3)))
    if "trans" not in track.numbers:
        notes.append("it holds no translation, so that the root stays in its place")
    if trans.shape[1] != 3:
        raise BadFile(f"{track.used['trans'].key} has {trans.shape[1]} columns, and needs 3")
    if "scale" in track.numbers:
        trans = trans / (scale := float(track.numbers["scale"].flat[0]))
        notes.append(f"trans is divided by {track.used['scale'].key}, {scale:.4g}")
    trans = np.broadcast_to(trans, (T, 3))
    line = track.used.get("root")
    if line is None or line.form != "origin":
        return pose, trans
    # it turns about the origin: R (V - J_0) + J_0 + t = R V + Th with t = Th + (R - I) J_0
    R, pose = np.full((T, 3, 3), np.nan), pose.copy()
    seen = np.isfinite(track.turns["root"][:, 0] + pose[:, 0]).all(axis=1)
    R[seen] = matrix_from_vector(track.turns["root"][seen, 0])
    pose[seen, 0] = (
        Rotation.from_matrix(R[seen]) * Rotation.from_rotvec(pose[seen, 0])
    ).as_rotvec()
    pose[~seen] = np.nan
    if body is None:
        notes.append(
            f"{line.key} turns the world about its origin, and trans lacks (R - I) J_0 in each "
            "frame, up to half a metre; give the body to correct it"
        )
        return pose, trans
    return pose, trans + _root(_betas(track, []), body) @ (R - np.eye(3)).swapaxes(1, 2)


def _spread(
    track: Track, pose: Array, lines: dict[str, Array], notes: list[str]
) -> tuple[Array, dict[str, Array]]:
    """Pose and lines with NaN in frames that the file leaves out, by their numbers."""
    T = len(pose)
    lines = {part: np.broadcast_to(line, (T, line.shape[1])) for part, line in lines.items()}
    for name, line in (("pose", pose), *lines.items()):
        if np.abs(line[np.isfinite(line)]).max(initial=0) >= LARGEST or np.isinf(line).any():
            name = track.used[name].key if name in track.used else name
            raise BadFile(f"{name} holds numbers beyond {LARGEST:g}, which are no motion")
    at = track.numbers.get("frames", np.zeros((0, 1)))[:, 0]
    if len(at) != T or not (np.diff(at) >= 1).all() or at[-1] - at[0] > SPARSEST * T:
        return pose, lines
    place = (at - at[0]).astype(np.int64)
    if place[-1] == T - 1:
        return pose, lines
    notes.append(f"{place[-1] + 1 - T} frames are not among its {track.used['frames'].key}")
    apart = {}
    for name, line in (("pose", pose), *lines.items()):
        apart[name] = np.full((place[-1] + 1, *line.shape[1:]), np.nan)
        apart[name][place] = line
    return apart.pop("pose"), apart


def _betas(track: Track, notes: list[str]) -> Array:
    """One shape, which is the median of those of the frames."""
    every = track.numbers.get("betas", np.zeros((1, 0)))
    every = every[np.isfinite(every).all(axis=1)]
    if not len(every):
        raise BadFile(f"{track.used['betas'].key} is nan in every frame")
    if not np.ptp(every, axis=0).max(initial=0.0) > 0:
        return np.asarray(every[0])
    middle = np.median(every, axis=0)
    away = np.abs(every - middle)
    notes.append(
        f"{track.used['betas'].key} change from frame to frame, and their medians are taken; they "
        f"are {away.mean():.2g} from these on average, and {away.max():.2g} at most"
    )
    return np.asarray(middle)


def _root(betas: Array, body: Body) -> Array:
    """The root of the person at rest, (3,) m."""
    few = betas[: body.n_betas]
    return np.asarray(body.joints(np.zeros((body.n_joints, 3)), few)[0])


def _upright(
    motion: Motion, given: str | None, declared: str, body: Body | None, notes: list[str]
) -> Motion:
    """The motion with y up, and the notes on it before its own."""
    if given is not None:
        axis = given.removeprefix("+")
        notes.append(f"the axis {axis} was given as up")
    elif declared in UP_TO_Y:
        axis = declared
    else:
        axis, clear = motion.up
        if clear < SURE:
            axis = "z"
            notes.append("z is taken to be up, as in AMASS; where the root points does not tell")
        else:
            notes.append(f"{axis} is taken to be up, along which the root's own y axis points")
    root = None
    if axis != "y" and motion.bones is None:
        if body is None:
            notes.append(
                "trans is displaced by (R - I) J_0, the same in all frames, where J_0 is the root "
                "of the body at rest and R turns the world; give the body to correct it"
            )
        else:
            root = _root(motion.betas, body)
    found = motion if axis == "y" else motion.turned(UP_TO_Y[axis], root)
    return replace(found, notes=(*notes, *found.notes))


LAYOUTS = ("amass", "smplx")


def save_motion(path: str | Path, motion: Motion, layout: str = "amass") -> None:
    """Write a motion with y up, as .npz or as Meshcapade's .smpl, whole or not at all.

    `read_amass` reads all of them; only `amass`, the layout of an .npz, keeps everything. It has
    the arrays of AMASS's older layout in float64, and those of the newer one for a motion of SMPL,
    SMPL-H or SMPL-X: what tools for AMASS, smplcodec and Meshcapade's add-on for Blender (there as
    "Blender (Z-up)") open. Programs that expect AMASS's z up find the axis in `up_axis`. The layout
    `smplx` has float32 arrays with the names of smplx's arguments, all of T rows, for a model that
    was made with use_pca=False and flat_hand_mean=True.

    Raises BadFile for another suffix or layout, and for joints that a layout has no place for.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".npz", ".smpl"):
        raise BadFile(f"a motion is saved as .npz or .smpl, and {path} ends otherwise")
    if layout not in LAYOUTS:
        raise BadFile(f"there is no layout {layout!r:.40}; there are {listed(LAYOUTS)}")
    if suffix == ".smpl" or layout == "smplx":
        write_arrays(path, (_codec if suffix == ".smpl" else _arguments)(motion))
        return
    K = len(motion.joint_names)
    arrays: dict[str, NDArray[Any]] = {
        "poses": motion.pose.reshape(-1, 3 * K),
        "trans": motion.trans,
        "betas": motion.betas,
        "mocap_framerate": np.array(motion.fps),
        "gender": np.array(motion.gender or "neutral"),
        "joint_names": np.array(motion.joint_names),
        "up_axis": np.array("y"),
        "origin": np.array(motion.origin),
        "notes": np.array(motion.notes, dtype=np.str_),
    }
    kind = next((K for K, (_, names) in NAMES.items() if names == motion.joint_names), 0)
    if kind in MODELS:
        arrays["mocap_frame_rate"] = arrays["mocap_framerate"]
        arrays["surface_model_type"] = np.array(MODELS[kind])
        for key, names in NEWER.items():
            if {*names} <= {*motion.joint_names}:
                arrays[key] = _of(motion, names).reshape(len(motion), -1)
    for name in ("expression", "dmpls"):
        if getattr(motion, name) is not None:
            arrays[name] = getattr(motion, name)
    if motion.bones is not None:
        arrays["bone_parents"] = np.array(motion.bones.parents, dtype=np.int64)
        arrays["bone_offsets"] = motion.bones.offsets
        arrays["end_parents"] = np.array(motion.bones.end_parents, dtype=np.int64)
        arrays["end_offsets"] = motion.bones.end_offsets
    write_arrays(path, arrays)


MODELS = {24: "smpl", 52: "smplh", 55: "smplx"}
NEWER = {"root_orient": BODY[:1], "pose_body": BODY[1:], "pose_hand": HANDS}
NEWER |= {"pose_jaw": FACE[:1], "pose_eye": FACE[1:]}


def _of(motion: Motion, names: tuple[str, ...]) -> Array:
    """The rotation vectors (T, J, 3) of some joints, zero for those that the motion lacks."""
    found = np.zeros((len(motion), len(names), 3))
    for j, name in enumerate(names):
        if name in motion.joint_names:
            found[:, j] = motion.pose[:, motion.joint_names.index(name)]
    return found


def _has(motion: Motion, names: tuple[str, ...]) -> bool:
    return any(name in motion.joint_names for name in names)


def _check_layout(motion: Motion, what: str) -> None:
    """Raise BadFile unless the motion is one of SMPL or a relative."""
    if not {*BODY} <= {*motion.joint_names} <= {*ORDER}:
        raise BadFile(
            f"{what} has places for the joints of SMPL and its relatives, and the motion has "
            f"{some(motion.joint_names)}; write .npz in the layout amass, or convert it"
        )


def _arguments(motion: Motion) -> dict[str, NDArray[Any]]:
    """The arguments of smplx's models (github.com/vchoutas/smplx, smplx/body_models.py)."""
    _check_layout(motion, "the layout smplx")
    fingers = _has(motion, (*FACE, *HANDS))
    parts = {"global_orient": BODY[:1], "body_pose": BODY[1:] if fingers else SMPL[1:]}
    if fingers:
        parts |= {"left_hand_pose": HANDS[:15], "right_hand_pose": HANDS[15:]}
    face = len(motion.joint_names) == 55
    if face:
        parts |= {"jaw_pose": FACE[:1], "leye_pose": FACE[1:2], "reye_pose": FACE[2:]}
    T = len(motion)
    rows = {key: _of(motion, names).reshape(T, -1) for key, names in parts.items()}
    rows |= {"betas": np.tile(motion.betas, (T, 1)), "transl": motion.trans}
    if face:
        rows["expression"] = np.zeros((T, 10)) if motion.expression is None else motion.expression
    return {key: array.astype(np.float32) for key, array in rows.items()} | {
        "gender": np.array(motion.gender or "neutral"),
        "fps": np.array(motion.fps),
    }


def _codec(motion: Motion) -> dict[str, NDArray[Any]]:
    """The entries of a .smpl file (github.com/Meshcapade/smplcodec, codec.py)."""
    _check_layout(motion, "a .smpl")
    fingers, face = _has(motion, HANDS), _has(motion, FACE)
    genders = {name: number for number, name in GENDERS.items() if number.isdigit()}
    arrays: dict[str, Any] = {
        "codecVersion": 2,
        "smplVersion": 2 if face else 1 if fingers else 0,
        "gender": int(genders.get(motion.gender, 0)),
        "shapeParameters": motion.betas.astype(np.float32),
        "frameCount": len(motion),
        "frameRate": motion.fps,
        "bodyTranslation": motion.trans.astype(np.float32),
        "bodyPose": _of(motion, BODY if face or fingers else SMPL).astype(np.float32),
    }
    if face:
        arrays["headPose"] = _of(motion, FACE).astype(np.float32)
    if face or fingers:
        arrays["leftHandPose"] = _of(motion, HANDS[:15]).astype(np.float32)
        arrays["rightHandPose"] = _of(motion, HANDS[15:]).astype(np.float32)
    if motion.expression is not None:
        arrays["expressionParameters"] = motion.expression.astype(np.float32)
    return {key: np.asarray(value) for key, value in arrays.items()}
