"""Motions from skinned, animated glTF files (.glb, .gltf).

The motion of a joint in a frame of the animation is the rigid motion from its bind pose to its pose
in that frame; nodes between joints and above them are included. Other files that a .gltf names are
opened only if they are in its folder.
"""

from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadArgument, BadFile, shown
from workbench.geometry.gltf import GlbDocument, document_of, several
from workbench.geometry.guesses import UP_TO_Y
from workbench.geometry.rotation import nearest_rotation, vector_from_matrix
from workbench.motions.bones import Bones
from workbench.motions.gltf_skeleton import Nodes, Skin, skin_of
from workbench.motions.gltf_tracks import Track, tracks_of
from workbench.motions.guesses import BODY, UNITS, check_given, reach, unit_of, up_of
from workbench.motions.motion import Motion
from workbench.reading.arrays import damage, taken_for
from workbench.reading.facts import bounded

MOST_BYTES = 2**30
MOST_PLACES = 5_000_000  # joints times frames
STRETCH = 0.01  # m, by which the place of a joint at its parent may change
WHOLE = 1e-3  # of a rate: one that is nearly a whole number is that number
USUAL = 30.0  # frames a second of a motion with a single key
JOINTS = "joints"
DO = "export a skin with its animation as .glb or .gltf, without compression"


def read_glb(
    path: str | Path, *, unit: str | None = None, up: str | None = None, fps: float | None = None
) -> Motion:
    """Read the motion of the skin with most joints in a .glb or .gltf: names, tree, rotations.

    Buffers beside a file are read from its folder, or from below it, and from nowhere else.
    At rest the joints are where the skin was bound, and a rotation is relative to that. The rate is
    that of the key frames, unless `fps` is given; the motion is read off the tracks at that rate. A
    file is in metres, y up; `unit` and `up` say otherwise, and a skeleton of more than 3 m is taken
    to be in cm or mm. The betas of a file that the workbench wrote are read too; morph targets and
    scales are not. `notes` say all of this. A root joint from which its only child
    moves away, such as a marker on the floor, is left out.

    Raises BadFile for a file that is damaged, has no skin or no animation of it, whose bones change
    their length by more than a centimetre, or are mirrored; UnknownName for a unit or an axis.
    """
    check_given(unit, up)
    with taken_for(path, "motion as glTF", DO), damage():
        document = document_of(bounded(path, MOST_BYTES), Path(path).parent)
        try:
            return _motion_of(document, unit, up, fps, Path(path).name)
        except BadArgument as error:
            raise BadFile(str(error)) from error


def _motion_of(
    document: GlbDocument, unit: str | None, up: str | None, fps: float | None, name: str
) -> Motion:
    nodes = Nodes.of(document)
    skin, notes = skin_of(document, nodes)
    tracks, more = _animation(document, nodes, skin)
    times, rate, said = _times(tracks, fps)
    if len(times) * len(skin.names) > MOST_PLACES:
        raise ValueError(f"{len(times):,} frames of {len(skin.names)} joints are too many")
    moved = skin.motions(nodes, tracks, times)
    if not np.isfinite(moved).all():
        raise ValueError("its joints are at places that are not finite")
    R, scale = _turns(moved)
    places = np.einsum("tkij,kj->tki", moved[..., :3, :3], skin.rest) + moved[..., :3, 3]
    metres, why = _unit(places, unit)
    skin, R, places, lost = _rooted(skin, R, places, STRETCH / metres)
    parents = np.array(skin.parents)
    local = R.copy()
    local[:, 1:] = R[:, parents[1:]].swapaxes(2, 3) @ R[:, 1:]
    rest = scale * metres * skin.rest
    offsets = rest - np.where(np.arange(len(rest))[:, None] > 0, rest[parents], 0.0)
    bones = Bones(skin.parents, offsets)
    pose = vector_from_matrix(local)
    trans = metres * places[:, 0] - rest[0]
    stretch = float(np.abs(bones.joints(pose, trans) - metres * places).max())
    if stretch > STRETCH:
        raise ValueError(
            f"its bones change their length, so that joints are up to {stretch:.3f} m elsewhere, "
            "and a skeleton here has bones of one length"
        )
    axis, pointing = _up(metres * places, up)
    notes = (why, pointing, *said, *notes, *more, *lost)
    found = Motion(
        pose, trans, rate, skin.names, _betas(document), bones=bones, origin=name, notes=notes
    )
    return found.turned(UP_TO_Y[axis])


def _animation(
    document: GlbDocument, nodes: Nodes, skin: Skin
) -> tuple[dict[tuple[int, str], Track], tuple[str, ...]]:
    """The tracks of the first animation that moves the skin, and sentences on the others."""
    animations = several(document.json, "animations")
    own = {*nodes.above({*skin.nodes})}
    for number, animation in enumerate(animations):
        tracks = {k: t for k, t in tracks_of(document, animation).items() if k[0] in own}
        if tracks:
            notes = []
            if len(animations) > 1:
                called = shown(animation.get("name", number))
                notes.append(f"of {len(animations)} animations, {called} is read")
            paths = [c.get("target") for c in several(animation, "channels")]
            if any(isinstance(p, dict) and p.get("path") == "weights" for p in paths):
                notes.append("the weights of morph targets are not read")
            return tracks, tuple(notes)
    raise ValueError("it has no animation of the joints of its skin")


def _times(
    tracks: dict[tuple[int, str], Track], given: float | None
) -> tuple[Array, float, tuple[str, ...]]:
    """The times (T,) s of frames, their rate, and what is to be said about it."""
    first = min(float(t.times[0]) for t in tracks.values())
    last = max(float(t.times[-1]) for t in tracks.values())
    keys = max((t.times for t in tracks.values()), key=len)
    steps = np.diff(keys)
    steps = steps[steps > 0]
    rate, said = given, tuple[str, ...]()
    if rate is None and not len(steps):
        rate, said = USUAL, (f"it has one key frame, and is taken to have {USUAL:g} a second",)
    elif rate is None:
        rate = 1 / float(np.median(steps))
        rate = round(rate) if abs(rate - round(rate)) < WHOLE * rate else rate
        if np.ptp(steps) > 0.01 * steps.max():
            said = (f"key frames are not evenly spaced; {rate:.4g} a second are read off them",)
    assert rate is not None
    if not 0 < rate < np.inf or not (last - first) * rate < MOST_PLACES:
        raise ValueError(f"{last - first:g} s at {rate:g} frames a second are no motion")
    count = int((last - first) * rate + 0.01) + 1
    times = first + np.arange(count) / rate
    nearest = keys[np.searchsorted(0.5 * (keys[1:] + keys[:-1]), times)]
    return np.where(np.abs(times - nearest) < WHOLE / rate, nearest, times), float(rate), said


def _turns(moved: Array) -> tuple[Array, float]:
    """The rotations (T, K, 3, 3) of motions with a scale, and the scale of the first frame."""
    A = moved[..., :3, :3]
    sizes = np.linalg.det(A)
    if not (sizes > 0).all():
        raise ValueError("a joint is mirrored, or has no size, and no rotation does that")
    scales = np.cbrt(sizes)
    R: Array = nearest_rotation(A / scales[..., None, None])
    return R, float(np.median(scales[0]))


def _rooted(
    skin: Skin, R: Array, places: Array, most: float
) -> tuple[Skin, Array, Array, tuple[str, ...]]:
    """The skin without joints at its root from which the only child moves away."""
    lost = []
    while skin.parents.count(0) == 1 and len(skin.names) > 1:
        away = np.einsum("tji,tj->ti", R[:, 0], places[:, 1] - places[:, 0])
        if np.ptp(away, axis=0).max() <= most:
            break
        lost.append(skin.names[0])
        skin, R, places = skin.only([*range(1, len(skin.names))]), R[:, 1:], places[:, 1:]
    said = (f"left out at the root, because their child moves away: {', '.join(lost)}",)
    return skin, R, places, said if lost else ()


def _unit(places: Array, given: str | None) -> tuple[float, str]:
    if given is None and float(np.linalg.norm(reach(places))) <= BODY[1]:
        return UNITS["m"], "the unit is m, as in all files of glTF"
    return unit_of(places, given, what=JOINTS)


def _up(places: Array, given: str | None) -> tuple[str, str]:
    if given is not None:
        return up_of(places, given, JOINTS)
    said = "y is up, as in all files of glTF"
    if up_of(places, None, JOINTS)[0] == "z":
        said += "; the joints reach farthest along z, so give z as up if the person stands"
    return "y", said


def _betas(document: GlbDocument) -> Array:
    """The betas that the workbench wrote into the file."""
    asset: Any = document.json.get("asset")
    extras = asset.get("extras") if isinstance(asset, dict) else None
    given = extras.get("betas") if isinstance(extras, dict) else None
    if not isinstance(given, list) or len(given) > 1000 or asset.get("generator") != "workbench":
        return np.zeros(0)
    if not all(isinstance(b, int | float) and np.isfinite(b) for b in given):
        return np.zeros(0)
    return np.array(given, dtype=float)
