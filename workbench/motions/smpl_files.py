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
from workbench.motions.people import FACTS, POSES, People, Track, lines_of
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
OWN = ("joint_names", "up_axis", "origin", "notes")  # that we add to AMASS's layout
BONES = ("bone_parents", "bone_offsets", "end_parents", "end_offsets")
IMPLIED = ("surface_model_type", "smplVersion", "codecVersion", "frameCount")  # by the arrays
SAME_ROTATION = 1e-3  # rad, between a pose and a part of it that stands beside it
CLEARLY_UP = 0.5  # of how clearly the root's own y must point along an axis to say that it is up
LARGEST_NUMBER = 1e6  # rad or m
LONGEST_VECTOR = 4 * np.pi  # rad: what is turned by more in a vector is perhaps in degrees
FASTEST_ROOT = 15.0  # m/s, of a root on average
MOST_GAPS = 10  # times as many frames as there are, with those between
ADVICE = "give a file with poses, or global_orient and body_pose, and a translation"


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
    with taken_for(path, "motion", ADVICE), contents_of(Path(path)) as contents:
        people = People(contents)
        track, notes = _chosen(people, person)
        own = {key: contents.texts(track.facts.get(key)) for key in OWN}
        pose, names = _pose(track, own["joint_names"])
        gender = _gender(contents, track)
        if not own["joint_names"]:
            of = f" of the gender {some([gender])}" if gender else ""
            notes.append(f"made for {family(len(names))}{of}")
        passed_over = {*OWN, *BONES, *IMPLIED, *(line.key for p in FACTS for line in lines_of(p))}
        if unread := {key for key, read in people.met.items() if not read} - passed_over:
            notes.append(f"not read are {some(sorted(unread))}")
        rates = [contents.numbers(track.facts.get(line.key)) for line in lines_of("rate")]
        declared = [float(x) for array in rates if array is not None for x in array.flat[:2]]
        rate, rate_notes = rate_of(fps, declared, track.usual_rate)
        notes += [*rate_notes, *track.notes]
        betas = _betas(track, notes)
        pose, trans = _placed(track, pose, betas, body, notes)
        if unit is not None:
            trans = trans * UNITS[unit]
            notes.append(f"the unit {unit} of trans was given")
        pose, lines = _spread(track, pose, trans, notes)
        try:
            pose, lines, filled = without_gaps(pose, lines)
            motion = Motion(
                pose,
                lines["trans"],
                rate,
                names,
                betas,
                lines.get("expression"),
                _bones(contents, track),
                "".join(own["origin"][:1]) or Path(path).name,
                (*own["notes"], *filled),
                gender,
                lines.get("dmpls"),
            )
        except BadArgument as error:
            raise BadFile(str(error)) from error
    longest = float(np.linalg.norm(motion.pose, axis=-1).max(initial=0.0))
    if longest > LONGEST_VECTOR:
        notes.append(
            f"rotations are up to {longest:.3g} rad long, {longest / (2 * np.pi):.3g} whole turns; "
            "if they are in degrees, multiply them by pi / 180"
        )
    declared_up = "".join(own["up_axis"][:1])
    distance = np.linalg.norm(np.diff(motion.trans, axis=0), axis=1).sum()
    if not declared_up and distance > FASTEST_ROOT * len(motion) / rate:
        speed = distance * rate / len(motion)
        notes.append(
            f"the root moves at {speed:.3g} m/s on average, as no person does; give the unit of "
            "trans, or the rate"
        )
    return _upright(motion, up, declared_up, body, notes)


def _chosen(people: People, person: str | None) -> tuple[Track, list[str]]:
    """The track of a person, and a note if there are several."""
    tracks = people.tracks
    if not tracks and people.misfits:
        raise BadFile(f"it has no pose: {some(people.misfits)} has that of no frame")
    if not tracks:
        keys = [line.key for part in POSES for line in lines_of(part)[:15:5]]
        holds = listed(people.met) if people.met else "nothing that has a name"
        raise BadFile(f"it has no pose: no {', no '.join(keys)} nor the like; it holds {holds}")
    if person is not None and person not in tracks:
        raise BadFile(f"it holds no person {person!r:.40}; there are {listed(tracks)}")
    frame_counts = {
        name: int(np.isfinite(next(iter(track.turns.values()))).all(axis=(1, 2)).sum())
        for name, track in tracks.items()
    }
    chosen = max(tracks, key=lambda name: frame_counts[name]) if person is None else person
    if len(tracks) == 1:
        return tracks[chosen], []
    why = "in most frames; name another one (--person)" if person is None else "as was asked"
    count = frame_counts[chosen]
    note = f"of {len(tracks)} people ({some(tracks)}) {chosen} is read, {count} frames, {why}"
    return tracks[chosen], [note]


def _gender(contents: Contents, track: Track) -> str:
    """The gender as the file says it, spelled out."""
    for line in lines_of("gender"):
        node = track.facts.get(line.key)
        several, number = contents.texts(node), contents.numbers(node)
        if number is not None and number.size == 1:
            several = (f"{number.flat[0]:g}",)
        if several:
            text = several[track.which if track.which < len(several) else 0]
            return GENDERS.get(text.lower(), text)
    return ""


def _bones(contents: Contents, track: Track) -> Bones | None:
    """The skeleton, in a file of our own."""
    arrays = [contents.numbers(track.facts.get(key)) for key in BONES]
    parents, offsets, end_parents, end_offsets = (
        np.zeros((0, 3)) if array is None or not np.isfinite(array).all() else array
        for array in arrays
    )
    if not parents.size or not offsets.size:
        return None
    tree, ends = (tuple(int(k) for k in array.reshape(-1)) for array in (parents, end_parents))
    return Bones(tree, offsets, ends, end_offsets)


def _pose(track: Track, own_names: tuple[str, ...]) -> tuple[Array, tuple[str, ...]]:
    """The pose (T, K, 3) and the names of joints; poses and their parts must say the same."""
    joints: dict[str, Array] = {}
    if "pose" in track.turns:
        pose = track.turns["pose"]
        K = pose.shape[1]
        usual = {22: BODY, 21: BODY[1:], 23: SMPL[1:]}.get(K) or joint_names(K)
        if own_names and len(own_names) != K:
            raise BadFile(f"poses has {K} joints, and joint_names {len(own_names)}")
        joints = dict(zip(own_names or usual, pose.swapaxes(0, 1), strict=False))
        if len(joints) < K:
            raise BadFile("two of its joint_names are the same")
    count = len(joints)
    for part, names in PARTS.items():
        if part not in track.turns or track.used[part].form == "origin":
            continue
        for name, turns in zip(names, track.turns[part].swapaxes(0, 1), strict=False):
            known = joints.setdefault(name, turns)
            if not np.allclose(known, turns, atol=SAME_ROTATION, equal_nan=True):
                raise BadFile(
                    f"{track.used['pose'].key} and {track.used[part].key} say different things"
                )
    if len(joints) == count:
        return track.turns["pose"], tuple(joints)
    joints.setdefault("pelvis", np.zeros((len(track), 3)))
    joints = {name: joints[name] for name in ORDER if name in joints}
    return np.stack([*joints.values()], axis=1), tuple(joints)


def _placed(
    track: Track, pose: Array, betas: Array, body: Body | None, notes: list[str]
) -> tuple[Array, Array]:
    """The pose and trans (T, 3) m of SMPL, which turns about its root joint."""
    T = len(pose)
    trans = track.numbers.get("trans", np.zeros((1, 3)))
    if "trans" not in track.numbers:
        notes.append("it holds no translation, so that the root stays in its place")
    if trans.shape[1] != 3:
        raise BadFile(f"{track.used['trans'].key} has {trans.shape[1]} columns, and needs 3")
    if "scale" in track.numbers:
        scale, key = float(track.numbers["scale"].flat[0]), track.used["scale"].key
        if not 0 < scale < np.inf:
            raise BadFile(f"{key} is {scale:g}, and trans can only be divided by a number above 0")
        trans = trans / scale
        notes.append(f"trans is divided by {key}, {scale:.4g}")
    trans = np.broadcast_to(trans, (T, 3))
    line = track.used.get("root")
    if line is None or line.form != "origin":
        return pose, trans
    # it turns about the origin: R (V - J_0) + J_0 + t = R V + Th with t = Th + (R - I) J_0
    R, pose = np.full((T, 3, 3), np.nan), pose.copy()
    whole = np.isfinite(track.turns["root"][:, 0] + pose[:, 0]).all(axis=1)
    R[whole] = matrix_from_vector(track.turns["root"][whole, 0])
    pose[whole, 0] = (
        Rotation.from_matrix(R[whole]) * Rotation.from_rotvec(pose[whole, 0])
    ).as_rotvec()
    pose[~whole] = np.nan
    if body is None:
        notes.append(
            f"{line.key} turns the world about its origin, and trans lacks (R - I) J_0 in each "
            "frame, up to half a metre; give the body to correct it"
        )
        return pose, trans
    return pose, trans + _root(betas, body) @ (R - np.eye(3)).swapaxes(1, 2)


def _spread(
    track: Track, pose: Array, trans: Array, notes: list[str]
) -> tuple[Array, dict[str, Array]]:
    """Pose and lines by their names, with NaN in frames that the file leaves out by their numbers.

    Raises BadFile for numbers that are no motion.
    """
    T = len(pose)
    lines = {"pose": pose, "trans": trans}
    for part in {"expression", "dmpls"} & {*track.numbers}:
        lines[part] = np.broadcast_to(track.numbers[part], (T, track.numbers[part].shape[1]))
    for name, line in lines.items():
        if max(np.nanmax(line, initial=0.0), -np.nanmin(line, initial=0.0)) >= LARGEST_NUMBER:
            key = track.used[name].key if name in track.used else name
            raise BadFile(f"{key} holds numbers beyond {LARGEST_NUMBER:g}, which are no motion")
    frames = track.numbers.get("frames", np.zeros((0, 1)))[:, 0]
    rising = len(frames) == T and (np.diff(frames) >= 1).all()
    if rising and T <= frames[-1] - frames[0] < MOST_GAPS * T:
        index = (frames - frames[0]).astype(np.int64)
        notes.append(f"{index[-1] + 1 - T} frames are not among its {track.used['frames'].key}")
        for name, line in lines.items():
            lines[name] = np.full((index[-1] + 1, *line.shape[1:]), np.nan)
            lines[name][index] = line
    return lines.pop("pose"), lines


def _betas(track: Track, notes: list[str]) -> Array:
    """One shape, which is the median of those of the frames."""
    rows = track.numbers.get("betas", np.zeros((1, 0)))
    rows = rows[np.isfinite(rows).all(axis=1)]
    if not len(rows):
        raise BadFile(f"{track.used['betas'].key} is nan in every frame")
    if not np.ptp(rows, axis=0).max(initial=0.0) > 0:
        return np.asarray(rows[0])
    median = np.median(rows, axis=0)
    deviations = np.abs(rows - median)
    notes.append(
        f"{track.used['betas'].key} change from frame to frame, and their medians are taken; they "
        f"are {deviations.mean():.2g} from these on average, and {deviations.max():.2g} at most"
    )
    return np.asarray(median)


def _root(betas: Array, body: Body) -> Array:
    """The root of the person at rest, (3,) m."""
    return np.asarray(body.joints(np.zeros((body.n_joints, 3)), betas[: body.n_betas])[0])


def _upright(
    motion: Motion, up: str | None, declared: str, body: Body | None, notes: list[str]
) -> Motion:
    """The motion with y up, and the notes on it before its own."""
    if up is not None:
        axis = up.removeprefix("+")
        notes.append(f"the axis {axis} was given as up")
    elif declared in UP_TO_Y:
        axis = declared
    else:
        axis, clear = motion.up
        if clear < CLEARLY_UP:
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
    upright = motion if axis == "y" else motion.turned(UP_TO_Y[axis], root)
    return replace(upright, notes=(*notes, *upright.notes))


MODELS = {"smpl": SMPL, "smplh": NAMES[52][1], "smplx": NAMES[55][1]}  # by their numbers' order
ARRAYS: dict[str, dict[str, tuple[str, ...]]] = {  # of parts in each layout; `people` has sources
    "amass": {
        **{"root_orient": BODY[:1], "pose_body": BODY[1:], "pose_hand": HANDS},
        **{"pose_jaw": FACE[:1], "pose_eye": FACE[1:]},
    },
    "smplx": {
        **{"global_orient": BODY[:1], "body_pose": BODY[1:], "jaw_pose": FACE[:1]},
        **{"leye_pose": FACE[1:2], "reye_pose": FACE[2:]},
        **{"left_hand_pose": HANDS[:15], "right_hand_pose": HANDS[15:]},
    },
    "smpl": {
        **{"bodyPose": BODY, "headPose": FACE},
        **{"leftHandPose": HANDS[:15], "rightHandPose": HANDS[15:]},
    },
}
LAYOUTS = ("amass", "smplx")  # of an .npz


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
    layout = "smpl" if suffix == ".smpl" else layout
    joints = {*motion.joint_names}
    model = next((model for model, names in MODELS.items() if joints <= {*names}), None)
    if model is None and layout != "amass":
        raise BadFile(
            f"{path} has places for the joints of SMPL and its relatives, and the motion has "
            f"{some(motion.joint_names)}; write .npz in the layout amass, or convert it"
        )
    if layout == "smplx":
        arrays = _smplx_arrays(motion, model)
    elif layout == "smpl":
        arrays = _smpl_arrays(motion, model)
    else:
        arrays = _amass_arrays(motion, model)
    write_arrays(path, arrays)


def _smplx_arrays(motion: Motion, model: str | None) -> dict[str, NDArray[Any]]:
    T = len(motion)
    rows = {key: part.reshape(T, -1) for key, part in _parts(motion, "smplx", model).items()}
    betas = motion.betas if len(motion.betas) else np.zeros(10)
    rows |= {"betas": np.tile(betas, (T, 1)), "transl": motion.trans}
    rows |= {"expression": _expression(motion)} if model == "smplx" else {}
    arrays: dict[str, NDArray[Any]] = {key: row.astype(np.float32) for key, row in rows.items()}
    return {**arrays, "gender": np.array(motion.gender or "neutral"), "fps": np.array(motion.fps)}


def _smpl_arrays(motion: Motion, model: str | None) -> dict[str, NDArray[Any]]:
    rows = _parts(motion, "smpl", model)
    rows |= {"shapeParameters": motion.betas, "bodyTranslation": motion.trans}
    rows |= {"expressionParameters": _expression(motion)} if model == "smplx" else {}
    arrays: dict[str, NDArray[Any]] = {key: row.astype(np.float32) for key, row in rows.items()}
    numbers = {name: int(number) for number, name in GENDERS.items() if number.isdigit()}
    facts = {"codecVersion": 2, "smplVersion": [*MODELS].index(str(model))}
    facts |= {"frameCount": len(motion), "gender": numbers.get(motion.gender or "neutral", 0)}
    arrays["frameRate"] = np.array(motion.fps)
    return arrays | {key: np.array(fact) for key, fact in facts.items()}


def _amass_arrays(motion: Motion, model: str | None) -> dict[str, NDArray[Any]]:
    T, fps = len(motion), np.array(motion.fps)
    arrays: dict[str, NDArray[Any]] = {
        "poses": motion.pose.reshape(T, -1),
        "trans": motion.trans,
        "betas": motion.betas,
        "mocap_framerate": fps,
        "gender": np.array(motion.gender or "neutral"),
        "joint_names": np.array(motion.joint_names),
        "up_axis": np.array("y"),
        "origin": np.array(motion.origin),
        "notes": np.array(motion.notes, dtype=np.str_),
    }
    if model is not None and motion.joint_names == MODELS[model]:
        parts = _parts(motion, "amass", model)
        arrays |= {key: part.reshape(T, -1) for key, part in parts.items()}
        arrays |= {"mocap_frame_rate": fps, "surface_model_type": np.array(model)}
    if motion.expression is not None:
        arrays["expression"] = motion.expression
    if motion.dmpls is not None:
        arrays["dmpls"] = motion.dmpls
    if (bones := motion.bones) is not None:
        arrays["bone_parents"] = np.array(bones.parents, np.int64)
        arrays["bone_offsets"] = bones.offsets
        arrays["end_parents"] = np.array(bones.end_parents, np.int64)
        arrays["end_offsets"] = bones.end_offsets
    return arrays


def _expression(motion: Motion) -> Array:
    return np.zeros((len(motion), 10)) if motion.expression is None else motion.expression


def _parts(motion: Motion, layout: str, model: str | None) -> dict[str, Array]:
    """The rotation vectors (T, J, 3) of each part of a layout that the model has."""
    parts = {}
    for key, names in ARRAYS[layout].items():
        if model is None or not {*names} <= {*MODELS[model]}:
            continue
        hands = SMPL[22:] if len(names) > 20 and model == "smpl" else ()
        parts[key] = _turns(motion, (*names, *hands))
    return parts


def _turns(motion: Motion, names: tuple[str, ...]) -> Array:
    """The rotation vectors (T, J, 3) of some joints, zero for those that the motion lacks."""
    vectors = np.zeros((len(motion), len(names), 3))
    for j, name in enumerate(names):
        if name in motion.joint_names:
            vectors[:, j] = motion.pose[:, motion.joint_names.index(name)]
    return vectors
