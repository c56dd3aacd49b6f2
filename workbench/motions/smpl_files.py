"""Motions in .npz files: AMASS in both of its layouts, and those that the workbench writes.

Mahmood, Ghorbani, Troje, Pons-Moll and Black, AMASS: Archive of Motion Capture as Surface Shapes,
2019. The older layout has `poses` (T, 3 K), `trans`, `betas` and `mocap_framerate`. The newer one
has `mocap_frame_rate`, and the parts of a pose beside the whole.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.bodies.files.joint_names import BODY, HANDS, family, joint_names
from workbench.errors import BadArgument, BadFile, some
from workbench.geometry.guesses import UP_TO_Y, check_given
from workbench.motions.bones import Bones
from workbench.motions.motion import Motion, without_gaps
from workbench.reading.arrays import (
    Archive,
    Expected,
    Kind,
    any_reals,
    opened,
    optional,
    read_expected,
    reals,
    texts,
    wholes,
)
from workbench.writing import write_arrays

number = Kind("a number", frozenset({"f4", "f8", "i", "u"}), reals.read)
word = Kind("text", frozenset({"U", "S"}), lambda array: array.astype(np.str_))
RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
PARTS: dict[str, tuple[str, ...]] = {  # in the order in which a whole pose has them
    "root_orient": BODY[:1],
    "pose_body": BODY[1:],
    "pose_jaw": ("jaw",),
    "pose_eye": ("left_eye", "right_eye"),
    "pose_hand": HANDS,
}
OWN = {  # that the workbench adds to the older layout
    "joint_names": optional(texts("K")),
    "expression": optional(any_reals("T", "E")),
    "up_axis": optional(texts()),
    "origin": optional(texts()),
    "notes": optional(texts("notes")),
    "bone_parents": optional(wholes("J")),
    "bone_offsets": optional(reals("J", 3)),
    "end_parents": optional(wholes("E ends")),
    "end_offsets": optional(reals("E ends", 3)),
}
SURE = 0.5  # of how clearly the root's own y must point along an axis to say that it is up
LARGEST = 1e6  # rad or m
MOST_NUMBERS = 30_000_000
INSTEAD = "give an .npz in one of AMASS's layouts, with poses or pose_body, and trans"


def read_amass(
    path: str | Path,
    *,
    up: str | None = None,
    fps: float | None = None,
    body: Body | None = None,
) -> Motion:
    """Read a motion from an .npz in either of AMASS's layouts, or as `save_motion` writes it.

    AMASS has z up. Here the motion is turned so that y is; which axis it was is guessed from where
    the root's own y axis points, unless it is given. The body turns about its root joint, so that
    turning the world moves trans by (R - I) J_0: give the `body` for which the motion was made, or
    else the whole motion is displaced by this constant, which `notes` say. `fps` takes the place
    of the file's rate. Frames that hold NaN are filled, and entries that are not read are named in
    `notes`. Raises BadFile, and UnknownName for an axis.
    """
    check_given(None, up)
    with opened(path, "motion", INSTEAD) as archive:
        arrays = read_expected(archive, _expected(archive))
        for name in ("poses", "trans", "betas", "expression", *PARTS):
            if name in arrays and np.nanmax(np.abs(arrays[name]), initial=0) >= LARGEST:
                raise BadFile(f"{name} holds numbers beyond {LARGEST:g}, which are no motion")
        pose, names = _pose(arrays)
        gender, read = _gender(archive)
        notes = []
        if "joint_names" not in arrays:
            of = f" of the gender {some([gender])}" if gender else ""
            notes.append(f"made for {family(len(names))}{of}")
        unread = {*archive.headers} - {*arrays, *read}
        if others := [*sorted(unread), *archive.others]:
            notes.append(f"not read are {some(others)}")
        rate = _rate(arrays) if fps is None else fps
        try:
            pose, trans, expression, filled = without_gaps(
                pose, arrays["trans"], arrays.get("expression")
            )
            motion = Motion(
                pose,
                trans,
                rate,
                names,
                _one_person(arrays),
                expression,
                _bones(arrays),
                str(arrays.get("origin", Path(path).name)) or Path(path).name,
                (*map(str, arrays.get("notes", ())), *filled),
                gender,
            )
        except BadArgument as error:
            raise BadFile(str(error)) from error
    declared = str(arrays["up_axis"]) if "up_axis" in arrays else None
    return _upright(motion, up, declared, body, notes)


def _expected(archive: Archive) -> dict[str, Expected]:
    headers = archive.headers
    expected: dict[str, Expected] = {"trans": any_reals("T", 3), **OWN}
    if "poses" in headers:
        solid = len(headers["poses"].shape) == 3
        expected["poses"] = any_reals("T", "K", 3) if solid else any_reals("T", "3 K")
    if "pose_body" in headers or "poses" not in headers:
        for name, joints in PARTS.items():
            needed = any_reals("T", 3 * len(joints))
            expected[name] = needed if name == "pose_body" else optional(needed)
    if "betas" in headers:
        one = len(headers["betas"].shape) == 1
        expected["betas"] = reals("B") if one else reals("T or 1", "B")
    for name in RATES:
        if name in headers:
            expected[name] = number(*headers[name].shape)
    longest = max((headers[n].count for n in expected if n in headers), default=0)
    if longest > MOST_NUMBERS:
        raise BadFile(
            f"it has an array of {longest:,} numbers, which is too long; split the motion"
        )
    return expected


def _pose(arrays: Mapping[str, NDArray[Any]]) -> tuple[Array, tuple[str, ...]]:
    """The pose (T, K, 3) and the names of joints; poses and their parts must say the same."""
    parts = [name for name in PARTS if name in arrays]
    assembled = [arrays[name].reshape(len(arrays[name]), -1, 3) for name in parts]
    if "poses" not in arrays:
        T = len(arrays["pose_body"])
        root = [] if "root_orient" in arrays else [np.zeros((T, 1, 3))]
        names = tuple(
            n for name in PARTS if name in parts or name == "root_orient" for n in PARTS[name]
        )
        return np.concatenate([*root, *assembled], axis=1), names
    poses = arrays["poses"]
    if poses.ndim == 2 and poses.shape[1] % 3:
        raise BadFile(f"poses has {poses.shape[1]} columns, and three belong to each joint")
    if not len(poses) or not poses.size:
        raise BadFile(f"poses has shape {poses.shape}, which is no frame")
    pose = poses.reshape(len(poses), -1, 3)
    K = pose.shape[1]
    usual = BODY if len(BODY) == K else joint_names(K)
    names = tuple(map(str, arrays.get("joint_names", usual)))
    if len(names) != K:
        raise BadFile(f"poses has {K} joints, and joint_names {len(names)}")
    whole = np.concatenate(assembled, axis=1) if assembled else pose
    if whole.shape == pose.shape and not np.allclose(whole, pose, atol=1e-5, equal_nan=True):
        raise BadFile(f"poses and {some(parts)} say different things")
    return pose, names


def _gender(archive: Archive) -> tuple[str, tuple[str, ...]]:
    """The gender as the file says it, and the entries that were read for it."""
    header = archive.headers.get("gender")
    if header is None or header.dtype.kind not in "US" or header.count != 1:
        return "", ()
    raw = archive.array("gender").reshape(-1)[0]
    return raw.decode("ascii", "replace") if isinstance(raw, bytes) else str(raw), ("gender",)


def _rate(arrays: Mapping[str, NDArray[Any]]) -> float:
    found = [arrays[name].reshape(-1) for name in RATES if name in arrays]
    if not found:
        raise BadFile(f"it has no {', '.join(RATES[:-1])} or {RATES[-1]}; give its rate (--rate)")
    if any(one.size != 1 or not 1e-6 < one[0] < 1e6 or one[0] != found[0][0] for one in found):
        raise BadFile("its rate is not one number of frames a second")
    return float(found[0][0])


def _one_person(arrays: Mapping[str, NDArray[Any]]) -> Array:
    betas = arrays.get("betas", np.zeros(0))
    if betas.ndim == 2:
        if not len(betas) or np.ptp(betas, axis=0).max(initial=0.0) > 0:
            raise BadFile("betas change from frame to frame, and a motion is of one person")
        return np.asarray(betas[0])
    return np.asarray(betas)


def _bones(arrays: Mapping[str, NDArray[Any]]) -> Bones | None:
    if "bone_parents" not in arrays or "bone_offsets" not in arrays:
        return None
    ends = "end_parents" in arrays and "end_offsets" in arrays
    return Bones(
        tuple(arrays["bone_parents"].tolist()),
        arrays["bone_offsets"],
        tuple(arrays["end_parents"].tolist()) if ends else (),
        arrays["end_offsets"] if ends else np.zeros((0, 3)),
    )


def _upright(
    motion: Motion, given: str | None, declared: str | None, body: Body | None, notes: list[str]
) -> Motion:
    """The motion with y up, and the notes on it before its own."""
    if given is not None:
        axis = given.removeprefix("+")
        notes.append(f"the axis {axis} was given as up")
    elif declared in UP_TO_Y:
        axis = str(declared)
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
            few = motion.betas[: body.n_betas]
            root = body.joints(np.zeros((body.n_joints, 3)), few)[0]
    found = motion if axis == "y" else motion.turned(UP_TO_Y[axis], root)
    return replace(found, notes=(*notes, *found.notes))


def save_motion(path: str | Path, motion: Motion) -> None:
    """Write a motion as .npz in AMASS's older layout, with y up; `read_amass` reads it whole.

    Programs that expect AMASS's z up find the axis in `up_axis`. Whole or not at all. Raises
    BadFile, also for another suffix than .npz.
    """
    if Path(path).suffix.lower() != ".npz":
        raise BadFile(f"a motion is saved as .npz, and {path} ends otherwise")
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
    if motion.expression is not None:
        arrays["expression"] = motion.expression
    if motion.bones is not None:
        arrays["bone_parents"] = np.array(motion.bones.parents, dtype=np.int64)
        arrays["bone_offsets"] = motion.bones.offsets
        arrays["end_parents"] = np.array(motion.bones.end_parents, dtype=np.int64)
        arrays["end_offsets"] = motion.bones.end_offsets
    write_arrays(path, arrays)
