"""Motions from skinned, animated glTF files (.glb, .gltf) and to them.

The motion of a joint in a frame of the animation is the rigid motion from its bind pose to its pose
in that frame; nodes between joints and above them are included. Other files that a .gltf names are
opened only if they are in its folder. Khronos Group, glTF 2.0 Specification, section 3.11 and
appendix C (interpolation)."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.files.gltf import Correctives, write_gltf
from workbench.errors import BadArgument, BadFile, UnknownName, cut, shown, some, some_of
from workbench.geometry.gltf import (
    IDENTITY,
    GlbDocument,
    children,
    document_of,
    local_motions,
    several,
    skin_joints,
)
from workbench.geometry.guesses import (
    UNITS,
    UP_TO_Y,
    check_given,
    extents,
    sizes_of,
    unit_of,
    up_of,
)
from workbench.geometry.rotation import nearest_rotation, vector_from_matrix
from workbench.motions.bones import Bones, different_names
from workbench.motions.bvh import REACH
from workbench.motions.motion import Motion
from workbench.reading.arrays import damage, taken_for
from workbench.reading.facts import bounded

LINEAR, STEP, CUBIC = "LINEAR", "STEP", "CUBICSPLINE"


@dataclass(frozen=True, eq=False)
class AnimationTrack:
    """One property of one node in time.

    Attributes:
        times: (n,) s, rising.
        values: (n, w), or (n, 3, w) with the tangents before and after for CUBICSPLINE.
        interpolation: LINEAR, STEP or CUBICSPLINE.
        is_rotation: whether the values are quaternions xyzw.
    """

    times: Array
    values: Array
    interpolation: str
    is_rotation: bool

    def at(self, times: Array) -> Array:
        """The values (S, w) at times (S,) s; before the first and after the last they stay."""
        count, t = len(self.times), np.clip(times, self.times[0], self.times[-1])
        before = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, count - 1)
        after = np.minimum(before + 1, count - 1)
        gap = self.times[after] - self.times[before]
        share = np.divide(t - self.times[before], gap, out=np.zeros_like(t), where=gap > 0)
        s = share[:, None]
        if self.interpolation == CUBIC:
            p0, p1 = self.values[before, 1], self.values[after, 1]
            m0, m1 = (gap[:, None] * self.values[i, k] for i, k in ((before, 2), (after, 0)))
            values = (2 * s**3 - 3 * s**2 + 1) * p0 + (s**3 - 2 * s**2 + s) * m0
            values = values + (3 * s**2 - 2 * s**3) * p1 + (s**3 - s**2) * m1
        elif self.interpolation == STEP:
            values = self.values[before]
        elif self.is_rotation:
            a, b = (Rotation.from_quat(self.values[i]) for i in (before, after))
            values = (a * Rotation.from_rotvec(s * (a.inv() * b).as_rotvec())).as_quat()
        else:
            values = (1 - s) * self.values[before] + s * self.values[after]
        return np.asarray(_normalised(values) if self.is_rotation else values)


Tracks = dict[tuple[int, str], AnimationTrack]  # by node and property


def tracks_of(document: GlbDocument, animation: dict[str, Any]) -> Tracks:
    """The tracks of an animation by node and property; others, as of morph targets, are left out.

    Raises ValueError for a track that does not fit together.
    """
    samplers, tracks = several(animation, "samplers"), {}
    for channel in several(animation, "channels"):
        target = channel.get("target")
        if not isinstance(target, dict) or target.get("path") not in IDENTITY:
            continue
        node, path = target.get("node"), str(target["path"])
        if type(node) is not int:
            continue
        sampler = channel.get("sampler")
        if type(sampler) is not int or not 0 <= sampler < len(samplers):
            raise ValueError(f"there is no samplers[{shown(sampler)}] of its animation")
        tracks[node, path] = _track(document, samplers[sampler], path)
    return tracks


def _track(document: GlbDocument, sampler: dict[str, Any], path: str) -> AnimationTrack:
    interpolation, width = sampler.get("interpolation", LINEAR), len(IDENTITY[path])
    if interpolation not in (LINEAR, STEP, CUBIC):
        raise ValueError(f"there is no interpolation {shown(interpolation)}")
    times = document.values(sampler.get("input"), "SCALAR", 1).ravel()
    values = document.values(sampler.get("output"), f"VEC{width}", width)
    if not len(times) or len(values) != len(times) * (3 if interpolation == CUBIC else 1):
        raise ValueError(f"a {path} has {len(times)} times and {len(values)} values")
    if not np.isfinite(times).all() or not np.isfinite(values).all() or (np.diff(times) < 0).any():
        raise ValueError(f"a {path} has times or values that are not finite, or times that fall")
    is_rotation = path == "rotation"
    if interpolation == CUBIC:
        values = values.reshape(len(times), 3, width)
    elif is_rotation:
        values = _normalised(values)
    return AnimationTrack(times, values, interpolation, is_rotation)


def _normalised(q: Array) -> Array:
    size = np.linalg.norm(q, axis=-1, keepdims=True)
    if not (size > 0).all():
        raise ValueError("a rotation is zero, and not a unit quaternion")
    return np.asarray(q / size)


MOST_NODES = 10_000
FRAMES_AT_ONCE = 500  # frames whose motions are in memory at once


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of a file, each after its parent.

    Attributes:
        order: the numbers of the nodes.
        parents: the parent of each node by its number; -1 for one without.
        json: the nodes as the file has them.
    """

    order: tuple[int, ...]
    parents: dict[int, int]
    json: list[dict[str, Any]]

    @staticmethod
    def of(document: GlbDocument) -> "Nodes":
        """The nodes of a document. Raises ValueError if they are no trees."""
        nodes = several(document.json, "nodes")
        if len(nodes) > MOST_NODES:
            raise ValueError(
                f"it has {len(nodes):,} nodes, and a skeleton has {MOST_NODES:,} at most"
            )
        parents = dict.fromkeys(range(len(nodes)), -1)
        for number, node in enumerate(nodes):
            for child in children(node, "children"):
                document.entry("nodes", child)
                if parents[child] != -1 or child == number:
                    raise ValueError(f"nodes[{child}] hangs on two others, or on itself")
                parents[child] = number
        order: list[int] = []
        waiting = [number for number, parent in parents.items() if parent == -1]
        while waiting:
            number = waiting.pop()
            order.append(number)
            waiting += children(nodes[number], "children")
        if len(order) < len(nodes):
            raise ValueError("its nodes hang on each other in a circle")
        return Nodes(tuple(order), parents, nodes)

    def above(self, numbers: set[int]) -> tuple[int, ...]:
        """These nodes and all their ancestors, each after its parent."""
        above: set[int] = set()
        for number in numbers:
            while number != -1 and number not in above:
                above.add(number)
                number = self.parents[number]
        return tuple(number for number in self.order if number in above)

    def world(self, numbers: set[int], tracks: Tracks, times: Array) -> Array:
        """The motions (S, len(some), 4, 4) of some nodes, in rising order, at times (S,) s."""
        worlds: dict[int, Array] = {}
        for number in self.above(numbers):
            animated = {
                path: tracks[number, path].at(times)
                for path in IDENTITY
                if (number, path) in tracks
            }
            local = local_motions(self.json[number], animated, len(times))
            parent = self.parents[number]
            worlds[number] = local if parent == -1 else worlds[parent] @ local
        return np.stack([worlds[number] for number in sorted(numbers)], axis=1)


@dataclass(frozen=True, eq=False)
class Skin:
    """K joints of a skin, each after its parent.

    Attributes:
        nodes: the number of each joint's node.
        parents: (K,) with parents[0] == -1.
        names: (K,) different names.
        to_rest: (K, 4, 4) from the space in which the skin was bound to the joint's node.
        rest: (K, 3) where the joints were in that space.
    """

    nodes: tuple[int, ...]
    parents: tuple[int, ...]
    names: tuple[str, ...]
    to_rest: Array
    rest: Array

    def only(self, kept: list[int]) -> "Skin":
        """Some of the joints, of which the first is the root."""
        index_of = {k: i for i, k in enumerate(kept)}
        return Skin(
            tuple(self.nodes[k] for k in kept),
            tuple(index_of.get(self.parents[k], -1) if i else -1 for i, k in enumerate(kept)),
            tuple(self.names[k] for k in kept),
            self.to_rest[kept],
            self.rest[kept],
        )

    def motions(self, nodes: Nodes, tracks: Tracks, times: Array) -> Array:
        """What takes the joints from rest to where they are, (S, K, 4, 4), at times (S,) s."""
        numbers = {*self.nodes}
        column = {number: i for i, number in enumerate(sorted(numbers))}
        columns = [column[number] for number in self.nodes]
        motions = np.empty((len(times), len(self.nodes), 4, 4))
        for first in range(0, len(times), FRAMES_AT_ONCE):
            chunk = slice(first, first + FRAMES_AT_ONCE)
            motions[chunk] = nodes.world(numbers, tracks, times[chunk])[:, columns] @ self.to_rest
        return motions


def skin_of(document: GlbDocument, nodes: Nodes) -> tuple[Skin, tuple[str, ...]]:
    """The skin with most joints, and sentences on what is left out. Raises ValueError.

    The transform of the node that wears it is ignored, as section 3.7.3.3 demands: bind matrices
    lead from the space in which vertices are written to the joints.
    """
    skins = several(document.json, "skins")
    sizes = [len(children(skin, "joints")) for skin in skins]
    if not any(sizes):
        raise ValueError("it has no skin with joints, so that nothing in it is a skeleton")
    number = int(np.argmax(sizes))
    notes = (
        [f"of {len(skins)} skins, that with {max(sizes)} joints is read"] if len(skins) > 1 else []
    )
    joints, to_rest = skin_joints(document, number)
    for joint in joints:
        document.entry("nodes", joint)
    try:
        if to_rest is None:  # bound where the nodes are
            world = nodes.world({*joints}, {}, np.zeros(1))[0]
            to_rest = np.linalg.inv(world[np.argsort(np.argsort(joints))])
        rest = np.asarray(np.linalg.inv(to_rest)[:, :3, 3], dtype=float)
    except np.linalg.LinAlgError as error:
        raise ValueError("a bind matrix of its skin has no inverse") from error
    if not np.isfinite(to_rest).all() or not np.isfinite(rest).all():
        raise ValueError("a bind matrix of its skin is not finite")
    skin, tree_notes = _tree(nodes, joints, to_rest, rest)
    return skin, (*notes, *tree_notes)


def _tree(
    nodes: Nodes, joints: list[int], to_rest: Array, rest: Array
) -> tuple[Skin, tuple[str, ...]]:
    """The largest tree of the joints: the parent of each is its nearest ancestor among them.

    They are in the order of the skin, if each comes after its parent there.
    """
    index_of = {number: k for k, number in enumerate(joints)}
    ancestors = []
    for joint in joints:
        parent = nodes.parents[joint]
        while parent != -1 and parent not in index_of:
            parent = nodes.parents[parent]
        ancestors.append(index_of.get(parent, -1))
    order = [*range(len(joints))]
    if any(ancestor > k for k, ancestor in enumerate(ancestors)):
        order = [index_of[number] for number in nodes.order if number in index_of]
    new_index = {-1: -1, **{k: i for i, k in enumerate(order)}}
    parents = tuple(new_index[ancestors[k]] for k in order)
    names_in_file = [str(nodes.json[joints[k]].get("name") or "")[:100] for k in order]
    names, renamed = different_names(names_in_file)
    skin = Skin(tuple(joints[k] for k in order), parents, names, to_rest[order], rest[order])
    roots: list[int] = []
    for i, parent in enumerate(parents):
        roots.append(i if parent == -1 else roots[parent])
    sizes = Counter(roots)
    if len(sizes) == 1:
        return skin, renamed
    largest = max(sizes, key=lambda root: sizes[root])
    kept = [i for i, root in enumerate(roots) if root == largest]
    left_out = [name for name, root in zip(names, roots, strict=True) if root != largest]
    note = f"joints in trees of their own are left out: {some_of(left_out)}"
    return skin.only(kept), (*renamed, note)


MOST_BYTES = 2**30
MOST_PLACES = 5_000_000  # joints times frames
MAX_STRETCH = 0.01  # m, by which the place of a joint at its parent may change
NEARLY_WHOLE = 1e-3  # of a rate: one that is nearly a whole number is that number
FPS_OF_ONE_KEY = 30.0  # frames a second of a motion with a single key
ADVICE = "export a skin with its animation as .glb or .gltf, without compression"


def read_glb(
    path: str | Path,
    *,
    unit: str | None = None,
    up: str | None = None,
    fps: float | None = None,
    animation: str | None = None,
) -> Motion:
    """Read the motion of the skin with most joints in a .glb or .gltf: names, tree, rotations.

    Buffers beside a file are read from its folder, or from below it, and from nowhere else.
    At rest the joints are where the skin was bound, and a rotation is relative to that. The rate is
    that of the key frames, unless `fps` is given; the motion is read off the tracks at that rate. A
    file is in metres, y up; `unit` and `up` say otherwise, and a skeleton of more than 3 m is taken
    to be in cm or mm. The betas of a file that the workbench wrote are read too; morph targets and
    scales are not. `notes` say all of this. A root joint from which its only child
    moves away, such as a marker on the floor, is left out. Of several animations the first that
    moves the skin is read, or the one whose name or number, from 0, is `animation`.

    Raises BadFile for a file that is damaged, has no skin or no animation of it, whose bones change
    their length by more than a centimetre, or are mirrored; UnknownName for a unit, an axis or an
    animation.
    """
    check_given(unit, up)
    with taken_for(path, "motion as glTF", ADVICE), damage():
        document = document_of(bounded(path, MOST_BYTES), Path(path).parent)
        try:
            return _motion_of(document, unit, up, fps, Path(path).name, animation)
        except BadArgument as error:
            raise BadFile(str(error)) from error


def _motion_of(
    document: GlbDocument,
    unit: str | None,
    up: str | None,
    fps: float | None,
    name: str,
    animation: str | None,
) -> Motion:
    nodes = Nodes.of(document)
    skin, notes = skin_of(document, nodes)
    tracks, animation_notes = _animation(document, nodes, skin, animation)
    times, rate, rate_notes = _times(tracks, fps)
    if len(times) * len(skin.names) > MOST_PLACES:
        raise ValueError(f"{len(times):,} frames of {len(skin.names)} joints are too many")
    motions = skin.motions(nodes, tracks, times)
    if not np.isfinite(motions).all():
        raise ValueError("its joints are at places that are not finite")
    R, scale = _rotations_and_scale(motions)
    places = np.einsum("tkij,kj->tki", motions[..., :3, :3], skin.rest) + motions[..., :3, 3]
    size = float(extents(places).max())
    sizes = sizes_of(skin.names)
    if unit is None and size <= sizes.others[0][1]:
        unit, unit_note = "m", "the unit is m, as in all files of glTF"
    else:
        unit, unit_note = unit_of(size, unit, sizes=sizes, units=tuple(UNITS), what=REACH)
    metres = UNITS[unit]
    skin, R, places, root_notes = _without_moving_roots(skin, R, places, MAX_STRETCH / metres)
    parents = np.array(skin.parents)
    local = R.copy()
    local[:, 1:] = R[:, parents[1:]].swapaxes(2, 3) @ R[:, 1:]
    rest = scale * metres * skin.rest
    offsets = rest - np.where(np.arange(len(rest))[:, None] > 0, rest[parents], 0.0)
    bones = Bones(skin.parents, offsets)
    pose = vector_from_matrix(local)
    trans = metres * places[:, 0] - rest[0]
    stretch = float(np.abs(bones.joints(pose, trans) - metres * places).max())
    if stretch > MAX_STRETCH:
        raise ValueError(
            f"its bones change their length, so that joints are up to {stretch:.3f} m elsewhere, "
            "and a skeleton here has bones of one length"
        )
    axis, up_note = up_of(metres * places, up, "y", what="the skeleton")
    if up is None and up_of(metres * places, names=skin.names)[0] == "z":
        up_note += "; the joints reach farthest along z, so give z as up if the person stands"
    notes = (unit_note, up_note, *rate_notes, *notes, *animation_notes, *root_notes)
    motion = Motion(
        pose, trans, rate, skin.names, _betas(document), bones=bones, origin=name, notes=notes
    )
    return motion.turned(UP_TO_Y[axis])


def _animation(
    document: GlbDocument, nodes: Nodes, skin: Skin, choice: str | None
) -> tuple[Tracks, tuple[str, ...]]:
    """The tracks of one animation, the first that moves the skin unless one is chosen; sentences.

    Raises UnknownName for one that does not exist.
    """
    animations = several(document.json, "animations")
    names_in_file = [entry.get("name") for entry in animations]
    names = [name if isinstance(name, str) else str(n) for n, name in enumerate(names_in_file)]
    nodes_moved = {*nodes.above({*skin.nodes})}
    chosen = [n for n, name in enumerate(names) if choice in (None, name, str(n))]
    if choice is not None and not chosen:
        known = some(f"{name} ({n})" for n, name in enumerate(names))
        raise UnknownName("animation", choice, hint=known)
    for number in chosen[: None if choice is None else 1]:
        animation = animations[number]
        tracks = {k: t for k, t in tracks_of(document, animation).items() if k[0] in nodes_moved}
        if tracks:
            notes = []
            if len(animations) > 1:
                others = some(name for n, name in enumerate(names) if n != number)
                notes.append(f"the animation {cut(names[number], 100)} is read, and not {others}")
            paths = [c.get("target") for c in several(animation, "channels")]
            if any(isinstance(p, dict) and p.get("path") == "weights" for p in paths):
                notes.append("the weights of morph targets are not read")
            return tracks, tuple(notes)
    which = "no animation" if choice is None else f"an animation {shown(choice)}, but not one"
    raise ValueError(f"it has {which} of the joints of its skin")


def _times(tracks: Tracks, fps: float | None) -> tuple[Array, float, tuple[str, ...]]:
    """The times (T,) s of frames, their rate, and what is to be said about it."""
    first = min(float(t.times[0]) for t in tracks.values())
    last = max(float(t.times[-1]) for t in tracks.values())
    keys = max((t.times for t in tracks.values()), key=len)
    steps = np.diff(keys)
    steps = steps[steps > 0]
    rate, notes = fps, tuple[str, ...]()
    if rate is None and not len(steps):
        rate = FPS_OF_ONE_KEY
        notes = (f"it has one key frame, and is taken to have {rate:g} a second",)
    elif rate is None:
        rate = 1 / float(np.median(steps))
        rate = round(rate) if abs(rate - round(rate)) < NEARLY_WHOLE * rate else rate
        if np.ptp(steps) > 0.01 * steps.max():
            notes = (f"key frames are not evenly spaced; {rate:.4g} a second are read off them",)
    assert rate is not None
    if not 0 < rate < np.inf or not (last - first) * rate < MOST_PLACES:
        raise ValueError(f"{last - first:g} s at {rate:g} frames a second are no motion")
    count = int((last - first) * rate + 0.01) + 1
    times = first + np.arange(count) / rate
    nearest = keys[np.searchsorted(0.5 * (keys[1:] + keys[:-1]), times)]
    times = np.where(np.abs(times - nearest) < NEARLY_WHOLE / rate, nearest, times)
    return times, float(rate), notes


def _rotations_and_scale(motions: Array) -> tuple[Array, float]:
    """The rotations (T, K, 3, 3) of motions with a scale, and the scale of the first frame."""
    A = motions[..., :3, :3]
    sizes = np.linalg.det(A)
    if not (sizes > 0).all():
        raise ValueError("a joint is mirrored, or has no size, and no rotation does that")
    scales = np.cbrt(sizes)
    R: Array = nearest_rotation(A / scales[..., None, None])
    return R, float(np.median(scales[0]))


def _without_moving_roots(
    skin: Skin, R: Array, places: Array, tolerance: float
) -> tuple[Skin, Array, Array, tuple[str, ...]]:
    """The skin without joints at its root from which the only child moves away."""
    left_out = []
    while skin.parents.count(0) == 1 and len(skin.names) > 1:
        offset = np.einsum("tji,tj->ti", R[:, 0], places[:, 1] - places[:, 0])
        if np.ptp(offset, axis=0).max() <= tolerance:
            break
        left_out.append(skin.names[0])
        skin, R, places = skin.only([*range(1, len(skin.names))]), R[:, 1:], places[:, 1:]
    note = (f"left out at the root, because their child moves away: {', '.join(left_out)}",)
    return skin, R, places, note if left_out else ()


def _betas(document: GlbDocument) -> Array:
    """The betas that the workbench wrote into the file."""
    asset: Any = document.json.get("asset")
    extras = asset.get("extras") if isinstance(asset, dict) else None
    betas = extras.get("betas") if isinstance(extras, dict) else None
    if not isinstance(betas, list) or len(betas) > 1000 or asset.get("generator") != "workbench":
        return np.zeros(0)
    if not all(isinstance(b, int | float) and np.isfinite(b) for b in betas):
        return np.zeros(0)
    return np.array(betas, dtype=float)


def write_glb(
    path: str | Path,
    motion: Motion,
    body: SkinnedBody,
    *,
    correctives: int | None = None,
    shapes: int = 0,
    betas: Array | None = None,
) -> Correctives:
    """Write a motion as .glb: surface, skeleton and correctives of a body, and its way.

    Each frame is a key frame. `correctives` is the number of morph targets that stand for what the
    motion uses of the pose blend shapes: None for all of it, 0 for none. What is returned says how
    far the surface is off with them, and so do the file's extras. An expression moves the face of a
    body that has one; `betas` (T, B) take the place of the motion's own. `shapes` is the number of
    shape directions that become morph targets as well, at zero for the person of the motion.

    Raises what `write_gltf` and `Motion.named` raise.
    """
    here, T = motion.named(body), len(motion)
    each = here.betas_on(body) if betas is None else betas
    person = np.zeros(body.n_betas)
    person[: len(here.betas)] = here.betas
    moving = np.broadcast_to(each, (T, body.n_betas)) - person
    return write_gltf(
        path,
        body,
        here.pose,
        here.betas,
        trans=here.trans,
        moving=moving,
        seconds=1 / here.fps,
        correctives=correctives,
        shapes=shapes,
    )
