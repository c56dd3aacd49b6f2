"""Motions from BVH files and to them (Biovision): a hierarchy of joints, a row of numbers a frame.

Meredith and Maddock, Motion Capture File Formats Explained, 2001."""

import re
import warnings
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.errors import BadArgument, BadFile, shown, some_of
from workbench.geometry.guesses import (
    MOST_FRAMES,
    PERSON,
    UNITS,
    UP_TO_Y,
    check_given,
    extents,
    sizes_of,
    unit_of,
    up_of,
)
from workbench.geometry.meshes import text_lines
from workbench.motions.bones import Bones, bones_of, different_names
from workbench.motions.motion import Motion
from workbench.reading.arrays import taken_for
from workbench.reading.facts import bounded
from workbench.writing import replacing

KINDS = ("position", "rotation", "scale")
CHANNELS = tuple(f"{axis}{kind}" for kind in KINDS for axis in "XYZ")
COMMENT = re.compile(r"(^|\s)(#|//).*")
MOST_JOINTS = 10_000
MOST_ROOTS = 5  # one below the other, that are left out
MOST_NUMBERS = 20_000_000  # of all frames together
LARGEST_NUMBER = 1e9  # of any length or angle


@dataclass
class BvhText:
    """What a BVH file says, in its own units: lengths, and degrees.

    Attributes:
        names: of its K joints, as written.
        parents: (K,) of each joint, -1 for the root.
        offsets: (K, 3) from the parent.
        channels: of each joint, in the order of its numbers in a row, such as Zrotation.
        end_parents: of each end site.
        end_offsets: (E, 3).
        frame_time: as written, in s.
        rows: (T, C), a number for each channel.
        notes: sentences on what is not as it should be.
    """

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    channels: list[tuple[str, ...]] = field(default_factory=list)
    end_parents: list[int] = field(default_factory=list)
    end_offsets: list[list[float]] = field(default_factory=list)
    frame_time: str = ""
    rows: Array = field(default_factory=lambda: np.zeros((0, 0)))
    notes: list[str] = field(default_factory=list)


def _lines(content: bytes) -> Iterator[tuple[int, str]]:
    """Lines that are not empty, with their numbers; a brace is a line of its own.

    What follows # or // after a space, or at the beginning of a line, is a comment.
    """
    for number, line in enumerate(text_lines(content), start=1):
        bare = COMMENT.sub("", line)
        for part in bare.replace("{", "\n{\n").replace("}", "\n}\n").split("\n"):
            if part.strip():
                yield number, part.strip()


def _hierarchy(lines: Iterator[tuple[int, str]], text: BvhText) -> None:
    """Read up to the line MOTION."""
    open_joints: list[int | None] = []  # the joints around a line; None is an end site
    next_joint: int | None = None  # the joint whose brace is still to come
    brace_expected = False
    number, line = next(lines, (0, ""))
    if line.upper() != "HIERARCHY":
        raise ValueError(f"it begins with {shown(line)}, and not with HIERARCHY")
    for number, line in lines:
        word, _, rest = line.partition(" ") if " " in line else line.partition("\t")
        match word.upper():
            case "{" if brace_expected:
                open_joints.append(next_joint)
                brace_expected = False
            case "}" if open_joints and not brace_expected:
                _check_closed(open_joints.pop(), text, number)
            case "MOTION" if text.names and not open_joints and not brace_expected:
                return
            case "ROOT" if not open_joints and not brace_expected:
                next_joint, brace_expected = _joint(rest, -1, text), True
            case "JOINT" if open_joints and open_joints[-1] is not None and not brace_expected:
                next_joint, brace_expected = _joint(rest, open_joints[-1], text), True
            case "END" if open_joints and open_joints[-1] is not None and not brace_expected:
                text.end_parents.append(open_joints[-1])
                next_joint, brace_expected = None, True
            case "OFFSET" if open_joints and not brace_expected:
                owner = text.end_offsets if open_joints[-1] is None else text.offsets
                count = len(text.end_parents) if open_joints[-1] is None else open_joints[-1] + 1
                if len(owner) != count - 1:
                    raise ValueError(f"line {number} gives an offset where none is expected")
                owner.append(_numbers(rest, 3, number))
            case "CHANNELS" if open_joints and open_joints[-1] is not None and not brace_expected:
                if len(text.channels) != open_joints[-1]:
                    raise ValueError(f"line {number} gives channels where none are expected")
                text.channels.append(_channels(rest.split(), number))
            case _:
                raise ValueError(f"line {number} is {shown(line)}, which is not expected there")
    raise ValueError(f"its hierarchy is not closed, or no MOTION follows, up to line {number}")


def _joint(name: str, parent: int, text: BvhText) -> int:
    k = len(text.names)
    if k >= MOST_JOINTS:
        raise ValueError(f"it has more than {MOST_JOINTS:,} joints")
    if k and (len(text.offsets) != k or len(text.channels) != k):
        raise ValueError(f"the joint {shown(text.names[k - 1])} has no OFFSET or no CHANNELS")
    text.names.append(" ".join(name.split()) or f"joint_{k}")
    text.parents.append(parent)
    return k


def _check_closed(joint: int | None, text: BvhText, number: int) -> None:
    if joint is None and len(text.end_offsets) != len(text.end_parents):
        raise ValueError(f"the end site that ends at line {number} has no OFFSET")
    if joint is not None and min(len(text.offsets), len(text.channels)) != len(text.names):
        raise ValueError(f"the joint {shown(text.names[-1])} has no OFFSET or no CHANNELS")


def _channels(words: list[str], number: int) -> tuple[str, ...]:
    by_name = {name.lower(): name for name in CHANNELS}
    known = tuple(by_name.get(word.lower(), "") for word in words[1:])
    if not words or words[0] != str(len(known)) or not all(known):
        raise ValueError(
            f"line {number} has the channels {shown(' '.join(words))}; they are a count and as "
            "many of Xposition, Yposition, Zposition, Xrotation, Yrotation, Zrotation"
        )
    if len({*known}) < len(known):
        raise ValueError(f"line {number} has the same channel twice")
    return known


def _motion(lines: Iterator[tuple[int, str]], text: BvhText) -> None:
    _, line = next(lines, (0, ""))
    word, _, count = line.partition(":")
    if word.strip().lower() != "frames" or not count.strip().isdecimal() or len(count) > 12:
        raise ValueError(f"after MOTION comes {shown(line)}, and not the number of Frames")
    number, line = next(lines, (0, ""))
    word, _, text.frame_time = line.partition(":")
    if [part.lower() for part in word.split()] != ["frame", "time"]:
        raise ValueError(f"after the number of frames comes {shown(line)}, and no Frame Time")
    width, declared = sum(map(len, text.channels)), int(count)
    numbers, frames = array("d"), 0
    for number, line in lines:
        if max(declared, frames + 1) * width > MOST_NUMBERS:
            most = max(declared, frames)
            raise ValueError(f"{most:,} frames of {width:,} channels are too many")
        numbers.extend(_numbers(line, width, number))
        frames += 1
    if not frames or not width:
        raise ValueError(f"it has {frames} frames of {width} channels; a motion has one or more")
    if frames != declared:
        text.notes.append(f"it has {frames:,} frames, and says {declared:,}")
    text.rows = np.array(numbers).reshape(frames, width)


def _numbers(line: str, count: int, number: int) -> list[float]:
    """So many finite numbers of a line, with points or commas before their decimals.

    Where a line has points, commas separate numbers.
    """
    words = line.replace(",", " " if "." in line else ".").split()
    try:
        numbers = [float(word) for word in words]
    except ValueError as error:
        raise ValueError(f"line {number}: {shown(str(error))}") from error
    if len(numbers) != count:
        raise ValueError(f"line {number} has {len(numbers)} numbers, and must have {count}")
    if not all(-LARGEST_NUMBER <= x <= LARGEST_NUMBER for x in numbers):
        wrong = next(x for x in numbers if not -LARGEST_NUMBER <= x <= LARGEST_NUMBER)
        raise ValueError(f"line {number} holds {wrong:g}, which is no length and no angle")
    return numbers


MOST_BYTES = 2**29
MAX_SCALE_CHANGE = 1e-3  # by which a scale may differ from one
MAX_STRETCH = 0.01  # m, by which the place of a joint at its parent may change from frame to frame
CENTIMETRES = 1 / UNITS["cm"]  # the unit that is written
ROTATIONS: Literal["ZXY"] = "ZXY"  # as written; each turns about the axes turned so far
REACH, STRETCHED = "the joints of a frame reach {}", "the skeleton would stand {} tall"
SPAN_PER_HEIGHT = 1.5  # the length of the bones from toes to fingers over that of a person
RATE_NOTED = 1e-6  # frames a second: a rate that is rounded by more is said


def read_bvh(
    path: str | Path, *, unit: str | None = None, up: str | None = None, fps: float | None = None
) -> Motion:
    """Read a BVH file: its rotations, its root, and its skeleton with the ends of bones.

    A joint's rotations are multiplied in the order of its channels. Positions of the root are its
    place, as in Blender, whatever its OFFSET. Those of other joints are added to their offsets, or
    take their place, whichever changes the skeleton less. A root whose only child moves away from
    it, such as hips below a reference on the floor, is left out. Of several skeletons that with
    most joints is read, and scale channels must be one. The unit (m, cm, mm, in, cmu) and the
    axis that points up are guessed from the size and the form of the skeleton unless they are
    given; `fps` takes the place of the file's rate. `notes` of the motion say all of this. Raises
    BadFile for a file that is damaged, or has bones that change their length by more than a
    centimetre; UnknownName for a unit or an axis.
    """
    check_given(unit, up)
    with taken_for(path, "BVH file of one skeleton", "export it again, or give what is missing"):
        try:
            text, lines = BvhText(), _lines(bounded(path, MOST_BYTES))
            _hierarchy(lines, text)
            _motion(lines, text)
            text = _largest(text)
            return _motion_of(text, unit, up, fps, Path(path).name)
        except (ValueError, OSError, BadArgument) as error:
            raise BadFile(str(getattr(error, "strerror", None) or error)) from error


def _motion_of(
    text: BvhText, unit: str | None, up: str | None, fps: float | None, name: str
) -> Motion:
    rate, rate_notes = _rate(text.frame_time) if fps is None else (fps, ())
    pose, moved = _pose_and_positions(text)
    text, pose, moved, root_notes = _without_moving_roots(text, pose, moved)
    names, renamed = different_names(text.names)
    offsets = np.array(text.offsets)
    trans = moved.pop(0, offsets[0]) - np.tile(offsets[0], (len(pose), 1))
    offsets, stretch, replaced = _bones(offsets, moved)
    ends = np.array(text.end_offsets).reshape(-1, 3)
    bones = Bones(tuple(text.parents), offsets, tuple(text.end_parents), ends)
    sample = slice(None, None, max(1, len(pose) // MOST_FRAMES))
    places = np.concatenate(
        [f(pose[sample], trans[sample]) for f in (bones.joints, bones.ends)], axis=1
    )
    reach, sizes, what = float(extents(places).max()), sizes_of(names), REACH
    if sizes is PERSON and bones.span / SPAN_PER_HEIGHT > reach:  # who crouches or sits
        reach, what = bones.span / SPAN_PER_HEIGHT, STRETCHED
    unit, unit_note = unit_of(reach, unit, sizes=sizes, units=tuple(UNITS), what=what)
    metres = UNITS[unit]
    axis, up_note = up_of(metres * places, up, names=names, what="the skeleton")
    if stretch * metres > MAX_STRETCH:
        raise BadFile(
            f"its bones change their length by up to {stretch * metres:.3f} m from frame to "
            "frame, and a skeleton here has bones of one length"
        )
    notes = [unit_note, up_note, *rate_notes, *renamed, *text.notes, *root_notes]
    if any(channel.endswith("scale") for own in text.channels for channel in own):
        notes.append("channels of scale are all 1, and are left out")
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


def _pose_and_positions(text: BvhText) -> tuple[Array, dict[int, Array]]:
    """The pose (T, K, 3) rad, and the positions (T, 3) of the joints that have such channels."""
    pose, moved = np.zeros((len(text.rows), len(text.names), 3)), {}
    first = 0
    for k, channels in enumerate(text.channels):
        columns = text.rows[:, first : first + len(channels)]
        first += len(channels)
        pose[:, k] = _rotation_vectors(channels, columns)
        if any(channel.endswith("position") for channel in channels):
            moved[k] = _places(channels, columns)
        scales = columns[:, [channel.endswith("scale") for channel in channels]]
        if np.abs(scales - 1).max(initial=0.0) > MAX_SCALE_CHANGE:
            raise BadFile(
                f"its bones are scaled, by {scales.min():g} to {scales.max():g}, and a skeleton "
                "here has bones of one length"
            )
    return pose, moved


def _subtree(text: BvhText, first: int) -> BvhText:
    """The joints from one on that are below it, which is the root then, and their numbers."""
    K = len(text.names)
    last = next((k for k in range(first + 1, K) if text.parents[k] < first), K)
    ends = [e for e, k in enumerate(text.end_parents) if first <= k < last]
    column = np.cumsum([0, *map(len, text.channels)])
    return replace(
        text,
        names=text.names[first:last],
        parents=[-1, *(k - first for k in text.parents[first + 1 : last])],
        offsets=text.offsets[first:last],
        channels=text.channels[first:last],
        end_parents=[text.end_parents[e] - first for e in ends],
        end_offsets=[text.end_offsets[e] for e in ends],
        rows=text.rows[:, column[first] : column[last]],
    )


def _largest(text: BvhText) -> BvhText:
    """That of several skeletons which has most joints, with a note on the others."""
    roots = [k for k, parent in enumerate(text.parents) if parent == -1]
    if len(roots) == 1:
        return text
    sizes = np.diff([*roots, len(text.parents)])
    largest = roots[int(np.argmax(sizes))]
    others = [text.names[k] for k in roots if k != largest]
    note = f"of {len(roots)} skeletons that of {shown(text.names[largest])} is read, which has "
    note += f"most joints; left out: {some_of(others)}"
    return replace(_subtree(text, largest), notes=[*text.notes, note])


def _without_moving_roots(
    text: BvhText, pose: Array, moved: dict[int, Array]
) -> tuple[BvhText, Array, dict[int, Array], tuple[str, ...]]:
    """The skeleton without roots from which the only child moves away.

    That child has the pose and the places of both: R = R_root R_child, p = p_root + R_root p_child.
    """
    left_out: list[str] = []
    while len(left_out) < MOST_ROOTS and text.parents.count(0) == 1 and 1 in moved:
        if not np.ptp(moved[1], axis=0).any():
            break
        left_out.append(text.names[0])
        _, _, replaced = _bones(np.array(text.offsets), {1: moved[1]})
        offset = moved[1] + (0.0 if replaced else np.array(text.offsets[1]))
        root = Rotation.from_rotvec(pose[:, 0])
        places = moved.get(0, np.tile(text.offsets[0], (len(pose), 1))) + root.apply(offset)
        pose[:, 1] = (root * Rotation.from_rotvec(pose[:, 1])).as_rotvec()
        text, pose = _subtree(text, 1), pose[:, 1:]
        moved = {k - 1: place for k, place in moved.items() if k} | {0: places}
    note = f"left out at the root, because their child moves away: {', '.join(left_out)}"
    return text, pose, moved, (note,) if left_out else ()


def _rotation_vectors(channels: tuple[str, ...], columns: Array) -> Array:
    """The rotation vectors (T, 3) of channels (T, c): R = R_1 R_2 R_3 in their order."""
    rotation = Rotation.identity(len(columns))
    for channel, degrees in zip(channels, columns.T, strict=True):
        if channel.endswith("rotation"):
            axis = np.eye(3)["XYZ".index(channel[0])]
            rotation = rotation * Rotation.from_rotvec(np.radians(degrees)[:, None] * axis)
    return np.asarray(rotation.as_rotvec())


def _places(channels: tuple[str, ...], columns: Array) -> Array:
    places = np.zeros((len(columns), 3))
    for channel, column in zip(channels, columns.T, strict=True):
        if channel.endswith("position"):
            places[:, "XYZ".index(channel[0])] = column
    return places


def _bones(offsets: Array, moved: dict[int, Array]) -> tuple[Array, float, bool]:
    """The offsets (K, 3) with the positions of joints below the root in them.

    Also the largest change of a position, and whether positions replace the offsets. Some programs
    write what is added to OFFSET, and others the whole: what changes the skeleton less is taken.
    """
    if not moved:
        return offsets, 0.0, False
    below = list(moved)
    means = np.array([moved[k].mean(axis=0) for k in below])
    stretch = max(float(np.abs(moved[k] - m).max()) for k, m in zip(below, means, strict=True))
    replaced = float(np.abs(means - offsets[below]).sum()) < float(np.abs(means).sum())
    joined = offsets.copy()
    joined[below] = means if replaced else offsets[below] + means
    return joined, stretch, replaced


def _rate(written: str) -> tuple[float, tuple[str, ...]]:
    """Frames a second by the written time of one, and a note on it: 0.033333 means 30 of them."""
    written = written.replace(",", ".")
    try:
        seconds = float(written)
    except ValueError:
        seconds = np.nan
    if not 1e-6 < seconds < 1e6:
        raise ValueError(f"its frame time is {shown(written.strip())}, which is no time in seconds")
    rate, digits = 1 / seconds, len(written.strip().partition(".")[2])
    whole = round(rate)
    if whole and rate != whole and abs(1 / whole - seconds) <= 10.0 ** -min(digits, 300):
        note = f"the frame time {seconds:g} s is taken for {whole} frames a second"
        return float(whole), (note,) if abs(rate - whole) > RATE_NOTED else ()
    note = f"the frame time is {seconds:g} s; if these are frames a second, give them as the rate"
    return rate, (note,) if seconds > 1 else ()


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
    parents = bones.parents
    below: list[list[int]] = [[] for _ in names]
    ends: list[list[Array]] = [[] for _ in names]
    for k, parent in enumerate(parents[1:], start=1):
        below[parent].append(k)
    for k, end in zip(bones.end_parents, bones.end_offsets, strict=True):
        ends[k].append(end)
    order, stack = list[int](), [0]
    while stack:
        order.append(stack.pop())
        stack += reversed(below[order[-1]])
    depth = [0] * (len(names) + 1)
    turns = " ".join(f"{axis}rotation" for axis in ROTATIONS)

    def offset(v: Array) -> str:
        return "OFFSET " + " ".join(f"{x:.6f}" for x in CENTIMETRES * v)

    for k, next_joint in zip(order, [*order[1:], -1], strict=True):
        depth[k] = depth[parents[k]] + 1 if k else 0
        indent = "  " * depth[k]
        moves = "" if k else "Xposition Yposition Zposition "
        lines += [
            f"{indent}{'JOINT' if k else 'ROOT'} {names[k]}",
            f"{indent}{{",
            f"{indent}  {offset(bones.offsets[k] * (k > 0))}",
            f"{indent}  CHANNELS {3 if k else 6} {moves}{turns}",
        ]
        for end in ends[k] if ends[k] or below[k] else [np.zeros(3)]:
            lines += [f"{indent}  End Site", f"{indent}  {{", f"{indent}    {offset(end)}"]
            lines.append(f"{indent}  }}")
        next_depth = depth[parents[next_joint]] if next_joint > 0 else -1
        lines += ["  " * level + "}" for level in range(depth[k], next_depth, -1)]
    return order
