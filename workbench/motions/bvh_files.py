"""Motions from BVH files and to them: channels in any order, with a skeleton of their own."""

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.errors import BadArgument, BadFile, shown
from workbench.geometry.guesses import UP_TO_Y
from workbench.motions.bones import Bones, bones_of
from workbench.motions.bvh_text import BvhText, parse_bvh
from workbench.motions.guesses import FRAMES, UNITS, check_given, unit_of, up_of
from workbench.motions.motion import Motion
from workbench.reading.arrays import taken_for
from workbench.reading.facts import bounded
from workbench.writing import replacing

MOST_BYTES = 2**29
STRETCH = 0.01  # m, by which the place of a joint at its parent may change from frame to frame
CENTIMETRES = 1 / UNITS["cm"]  # the unit that is written
ROTATIONS: Literal["ZXY"] = "ZXY"  # as written; each turns about the axes turned so far
JOINTS = "joints"
SAID = 1e-6  # frames a second: a rate that is rounded by more is said


def read_bvh(
    path: str | Path, *, unit: str | None = None, up: str | None = None, fps: float | None = None
) -> Motion:
    """Read a BVH file: its rotations, its root, and its skeleton with the ends of bones.

    A joint's rotations are multiplied in the order of its channels. Positions of the root are its
    place, as in Blender, whatever its OFFSET. Those of other joints are added to their offsets, or
    take their place, whichever changes the skeleton less. The unit (m, cm, mm, in, cmu) and the
    axis that points up are guessed from the size and the form of the skeleton unless they are
    given; `fps` takes the place of the file's rate. `notes` of the motion say all of this. Raises
    BadFile for a file that is damaged, has several skeletons, or has bones that change their length
    by more than a centimetre; UnknownName for a unit or an axis.
    """
    check_given(unit, up)
    with taken_for(path, "BVH file of one skeleton", "export it again, or give what is missing"):
        try:
            text = parse_bvh(bounded(path, MOST_BYTES))
            return _motion_of(text, unit, up, fps, Path(path).name)
        except (ValueError, OSError, BadArgument) as error:
            raise BadFile(str(getattr(error, "strerror", None) or error)) from error


def _motion_of(
    text: BvhText, unit: str | None, up: str | None, given: float | None, name: str
) -> Motion:
    names, renamed = _different(text.names)
    rate, said = _rate(text.frame_time) if given is None else (given, "")
    pose, moved = np.zeros((len(text.rows), len(names), 3)), {}
    at = 0
    for k, channels in enumerate(text.channels):
        columns = text.rows[:, at : at + len(channels)]
        at += len(channels)
        pose[:, k] = _turned(channels, columns)
        if any(channel.endswith("position") for channel in channels):
            moved[k] = _places(channels, columns)
    offsets = np.array(text.offsets)
    trans = moved.pop(0, offsets[0]) - np.tile(offsets[0], (len(pose), 1))
    offsets, stretch, replaced = _bones(offsets, moved)
    ends = np.array(text.end_offsets).reshape(-1, 3)
    bones = Bones(tuple(text.parents), offsets, tuple(text.end_parents), ends)
    some = slice(None, None, max(1, len(pose) // FRAMES))
    shown_places = np.concatenate(
        [f(pose[some], trans[some]) for f in (bones.joints, bones.ends)], axis=1
    )
    metres, why = unit_of(shown_places, unit, what=JOINTS)
    axis, pointing = up_of(metres * shown_places, up, what=JOINTS)
    if stretch * metres > STRETCH:
        raise BadFile(
            f"its bones change their length by up to {stretch * metres:.3f} m from frame to "
            "frame, and a skeleton here has bones of one length"
        )
    notes = [why, pointing, *([said] if said else []), *renamed]
    if offsets[0].any() and trans.any():
        notes.append("positions of the root take the place of its OFFSET, which is not zero")
    if moved:
        way = "take the place of their offsets" if replaced else "are added to their offsets"
        notes.append(
            f"positions of {len(moved)} joints below the root {way}, and are taken as their mean, "
            f"from which they differ by up to {1e3 * stretch * metres:.2g} mm"
        )
    if still := [n for n, c in zip(names, text.channels, strict=True) if not c]:
        notes.append(f"{len(still)} joints have no channels and do not turn, as {shown(still[0])}")
    scaled = Bones(bones.parents, metres * offsets, bones.end_parents, metres * ends)
    return Motion(
        pose, metres * trans, rate, names, bones=scaled, origin=name, notes=tuple(notes)
    ).turned(UP_TO_Y[axis])


def _turned(channels: tuple[str, ...], columns: Array) -> Array:
    """The rotation vectors (T, 3) of channels (T, c): R = R_1 R_2 R_3 in their order."""
    found = Rotation.identity(len(columns))
    for channel, degrees in zip(channels, columns.T, strict=True):
        if channel.endswith("rotation"):
            axis = np.eye(3)["XYZ".index(channel[0])]
            found = found * Rotation.from_rotvec(np.radians(degrees)[:, None] * axis)
    return np.asarray(found.as_rotvec())


def _places(channels: tuple[str, ...], columns: Array) -> Array:
    places = np.zeros((len(columns), 3))
    for channel, column in zip(channels, columns.T, strict=True):
        if channel.endswith("position"):
            places[:, "XYZ".index(channel[0])] = column
    return places


def _bones(offsets: Array, moved: dict[int, Array]) -> tuple[Array, float, bool]:
    """The offsets (K, 3) with the positions of joints below the root in them.

    Also the largest change of a position, and whether positions repeat the offsets. Some programs
    write what is added to OFFSET, and others the whole: the skeleton is to change less.
    """
    if not moved:
        return offsets, 0.0, False
    below = list(moved)
    means = np.array([moved[k].mean(axis=0) for k in below])
    stretch = max(float(np.abs(moved[k] - m).max()) for k, m in zip(below, means, strict=True))
    whole = float(np.abs(means - offsets[below]).sum()) < float(np.abs(means).sum())
    found = offsets.copy()
    found[below] = means if whole else offsets[below] + means
    return found, stretch, whole


def _rate(written: str) -> tuple[float, str]:
    """Frames a second, and what is to be said: 0.033333 is 30 of them, as far as it is written."""
    try:
        seconds = float(written)
    except ValueError:
        seconds = np.nan
    if not 1e-6 < seconds < 1e6:
        raise ValueError(f"its frame time is {shown(written.strip())}, which is no time in seconds")
    rate, digits = 1 / seconds, len(written.strip().partition(".")[2])
    near = round(rate)
    if near and rate != near and abs(1 / near - seconds) <= 10.0 ** -min(digits, 300):
        told = f"the frame time {seconds:g} s is taken for {near} frames a second"
        return float(near), told if abs(rate - near) > SAID else ""
    return rate, ""


def _different(names: list[str]) -> tuple[tuple[str, ...], list[str]]:
    """The names, a number being put after one that was there before; and what is to be said."""
    seen: dict[str, int] = {}
    taken, found, again = {*names}, [], 0
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        new = name
        while seen[name] > 1 and new in taken:
            new = f"{name}_{seen[name]}"
            seen[name] += new in taken
        again += new != name
        taken.add(new)
        found.append(new)
    return tuple(found), [f"{again} joints have the name of another, and got a number"] * bool(
        again
    )


def write_bvh(path: str | Path, motion: Motion, body: Body | None = None) -> None:
    """Write a motion as BVH, in centimetres, y up, with the bones of a body or its own.

    The root has OFFSET 0 and its whole place in its channels. Whole or not at all. Raises
    BadArgument for a motion without bones if no body is given, and BadFile.
    """
    if body is not None:
        motion = motion.named(body)
        bones = bones_of(body, motion.betas)
    elif motion.bones is not None:
        bones = motion.bones
    else:
        raise BadArgument(
            "a BVH holds bones, and this motion has none; give the body that has them"
        )
    lines = ["HIERARCHY"]
    order = _written_tree(bones, [" ".join(n.split()) for n in motion.joint_names], lines)
    turns = Rotation.from_rotvec(motion.pose[:, order].reshape(-1, 3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # where two angles turn about one axis, either is right
        angles = turns.as_euler(ROTATIONS, degrees=True).reshape(len(motion), -1)
    angles = np.unwrap(angles, period=360, axis=0)
    root = CENTIMETRES * (bones.offsets[0] + motion.trans)
    lines += ["MOTION", f"Frames: {len(motion)}", f"Frame Time: {1 / motion.fps:.10g}"]
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n".join(lines) + "\n")
        np.savetxt(file, np.column_stack([root, angles]), fmt="%.6f")


def _written_tree(bones: Bones, names: list[str], lines: list[str]) -> list[int]:
    """Add the hierarchy to the lines; the joints in its order, each before those below it."""
    below: dict[int, list[int]] = {k: [] for k in range(len(names))}
    for k, parent in enumerate(bones.parents[1:], start=1):
        below[parent].append(k)
    ends: dict[int, list[Array]] = {k: [] for k in below}
    for k, end in zip(bones.end_parents, bones.end_offsets, strict=True):
        ends[k].append(end)
    order: list[int] = []
    path: list[tuple[int, Iterator[int]]] = []
    pending: Iterator[int] = iter([0])
    turns = " ".join(f"{axis}rotation" for axis in ROTATIONS)
    while True:
        k = next(pending, -1)
        indent = "  " * len(path)
        if k >= 0:
            order.append(k)
            offset = CENTIMETRES * bones.offsets[k] * (k > 0)
            lines += [f"{indent}{'JOINT' if k else 'ROOT'} {names[k]}", f"{indent}{{"]
            lines.append(f"{indent}  OFFSET {_three(offset)}")
            moves = "" if k else "Xposition Yposition Zposition "
            lines.append(f"{indent}  CHANNELS {3 if k else 6} {moves}{turns}")
            for end in ends[k] if ends[k] or below[k] else [np.zeros(3)]:
                lines += [f"{indent}  End Site", f"{indent}  {{"]
                lines += [f"{indent}    OFFSET {_three(CENTIMETRES * end)}", f"{indent}  }}"]
            path.append((k, pending))
            pending = iter(below[k])
        elif path:
            _, pending = path.pop()
            lines.append(f"{'  ' * len(path)}}}")
        else:
            return order


def _three(v: Array) -> str:
    return " ".join(f"{x:.6f}" for x in v)
