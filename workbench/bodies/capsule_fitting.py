"""Capsules fitted to the people of a body's shape space, all of them at once.

Each vertex belongs to the part of the joint that moves it most, and each part has one capsule or
two (`parts_of_capsules`). The ends and the radius of a capsule are affine in betas, and minimise

    sum over people and vertices of w^2 (|v - segment| - r)^2,    w > 1 where v is outside,
        + sum over people and points s on the capsule of |s - nearest vertex|^2 (along the normal)

by Gauss-Newton; the nearest places are held in each step. Fitting each person alone, and then
regressing, does not work: capsules of similar people end in different basins.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from workbench.arrays import Array, Index, Mask
from workbench.bodies.capsules import Capsules, segment_distances
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadBody
from workbench.geometry.mirror import REFLECTION, opposite
from workbench.geometry.solids import face_vectors, sums_over_faces

BONES = {  # a part for each of these joints of SMPL, and what it is called
    "pelvis": "pelvis",
    "spine1": "belly",
    "spine2": "ribs",
    "spine3": "chest",
    "neck": "neck",
    "head": "head",
    **{
        f"{side}_{joint}": f"{side}_{part}"
        for side in ("left", "right")
        for joint, part in (
            ("hip", "thigh"),
            ("knee", "shin"),
            ("ankle", "foot"),
            ("shoulder", "upper_arm"),
            ("elbow", "forearm"),
            ("wrist", "hand"),
            ("hand", "fingers"),
        )
    },
}  # collars carry few vertices, which belong to the chest
TRUNK = ("pelvis", "belly", "ribs", "chest")


def part_joints(body: SkinnedBody) -> list[int]:
    """The joints that have a part, in the order of the body. Raises BadBody if there is none."""
    joints = [k for k, name in enumerate(body.joint_names) if name in BONES]
    if not joints:
        raise BadBody(
            f"body {body.name!r} has none of the joints of SMPL after which parts and capsules are "
            "named, such as left_elbow; make Capsules(...) of your own"
        )
    return joints


def owners(body: SkinnedBody) -> Index:
    """The joint (N,) of each vertex's part: the one that moves it most.

    If that joint has no part, it is its nearest ancestor that has one.
    """
    owner = list(range(body.n_joints))
    for k, name in enumerate(body.joint_names):
        if name not in BONES and k:
            owner[k] = owner[body.parents[k]]
    return np.asarray(np.array(owner)[body.weights.argmax(axis=1)], dtype=np.int64)


def separate(body: SkinnedBody, joints: list[int]) -> Index:
    """Pairs (P, 2) of these joints' parts that are not neighbours: places in the list.

    Neighbours are parent and child on the tree of the joints that are listed, and children of one
    parent unless they are mirror images.
    """
    above = {}
    for k in joints:
        parent = body.parents[k]
        while parent not in joints and parent >= 0:
            parent = body.parents[parent]
        above[k] = parent
    names = body.joint_names
    pairs = [
        (i, j)
        for j in range(len(joints))
        for i in range(j)
        if (
            above[joints[j]] != joints[i]
            and above[joints[i]] != joints[j]
            and above[joints[i]] != above[joints[j]]
        )
        or opposite(names[joints[i]]) == names[joints[j]]
    ]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


# parts with a near and a far capsule, and where on the bone the far one begins: below the calf
FAR_PART_FROM = {"thigh": 0.5, "shin": 0.6, "upper_arm": 0.5}
ENDINGS = ("_near", "_far", "_low", "_high")
THUMB_DISTANCE = 0.05  # m from the axis of the hand
INNER_DEPTH = 0.015  # m below the convex hull of a part: inside of the mouth, eye sockets
ON_MIDLINE = 1e-6  # m


def parts_of_capsules(body: SkinnedBody) -> dict[str, Mask]:
    """For each capsule, which vertices (N,) it stands for.

    What lies more than 15 mm inside of the convex hull of the head is left out: mouth and eyes.
    """
    owner, joints, template = owners(body), body.joints(), body.template
    parts: dict[str, Mask] = {}
    for k in part_joints(body):
        part, mask = BONES[body.joint_names[k]], np.asarray(owner == k)
        limb = next((name for name in FAR_PART_FROM if part.endswith(name)), "")
        if limb or part.endswith("hand"):
            bone = joints[body.parents.index(k)] - joints[k]  # to its child
            away = template - joints[k]
        if part == "pelvis":
            parts["left_pelvis"] = mask & (template[:, 0] > -ON_MIDLINE)
            parts["right_pelvis"] = mask & (template[:, 0] < ON_MIDLINE)
        elif part == "head":
            mask = mask & ~_inner(template, mask)
            low = template[:, 1] < joints[k, 1]
            parts |= {"head": mask & ~low, "jaw": mask & low}
        elif part == "chest" and mask.any():
            high = template[:, 1] > np.median(template[mask, 1])
            parts |= {"chest_low": mask & ~high, "chest_high": mask & high}
        elif limb:
            far = (away - FAR_PART_FROM[limb] * bone) @ bone > 0
            parts |= {f"{part}_near": mask & ~far, f"{part}_far": mask & far}
        elif part.endswith("hand"):
            off = np.cross(away, bone / np.linalg.norm(bone))
            thumb = mask & (np.linalg.norm(off, axis=1) > THUMB_DISTANCE)
            parts |= {part: mask & ~thumb, part.replace("hand", "thumb"): thumb}
        else:
            parts[part] = mask
    return parts


def part_of(capsule: str) -> str:
    """The part that a capsule stands for, in whole or in part."""
    whole = capsule
    for ending in ENDINGS:
        whole = whole.removesuffix(ending)
    if whole.endswith("_pelvis"):
        return "pelvis"
    return whole.replace("thumb", "hand").replace("jaw", "head")


def _inner(template: Array, part: Mask) -> Mask:
    try:
        planes = ConvexHull(template[part]).equations
    except (QhullError, ValueError):
        return np.zeros(len(part), dtype=bool)
    depth = -(template @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    return np.asarray(depth > INNER_DEPTH)


MAY_TOUCH_TRUNK = ("thigh_far", "upper_arm_far")  # of parts next to the torso, which may touch it
GAUSS_NEWTON_STEPS = 25
OUTSIDE_WEIGHT = 1.5  # how much more a vertex outside of its capsule counts than one inside
LEGS = {"thigh": 2.0, "shin": 2.5}  # the same of these parts
COVERAGE_WEIGHT = 0.35  # how much the distances from the capsule to the person count
N_ALONG, N_AROUND = 6, 8  # points on a capsule


def fit_capsules(body: SkinnedBody, people: int = 60, seed: int = 0) -> Capsules:
    """Capsules of a body, fitted to so many people drawn from its shape space.

    It takes a few seconds. Give them to a body of your own by
    `dataclasses.replace(body, capsules=fit_capsules(body))`. Where the body has a mirror, the
    capsules of both sides are mirror images. A pair may touch if the two parts are no neighbours
    (`separate`), and their capsules do not overlap in the rest pose. The half of a thigh or
    an upper arm that is far from the torso may touch the torso too, and that of an upper arm
    the neck.

    Raises BadBody for a body that has none of SMPL's joints, by which capsules are chosen.
    """
    part_joints(body)  # raises if there is none
    betas = np.random.default_rng(seed).standard_normal((people, body.n_betas))
    fitted: dict[str, Array] = {}
    for name, mask in parts_of_capsules(body).items():
        if opposite(name) in fitted and body.mirror is not None:
            fitted[name] = MIRRORED[:, None] * fitted[opposite(name)]
        elif mask.any():
            fitted[name] = _fit(body, name, mask, betas)
    return _without_overlaps(_capsules(body, fitted), betas)


# Which ends and radius (7,) a capsule may have: a matrix (7, p) from p numbers, and the direction
# of its first axis, if that is not the longest one of its vertices.
Form = tuple[Array, Array | None]
MIRRORED = np.concatenate([REFLECTION, REFLECTION, [1.0]])  # of a capsule and its mirror image
FREE: Form = (np.eye(7), None)
UPRIGHT: Form = (np.delete(np.eye(7), (0, 3), axis=1), np.eye(3)[1])  # both ends on the midline
ACROSS: Form = (  # one end the mirror image of the other
    np.vstack([np.eye(3, 4), np.diag(REFLECTION) @ np.eye(3, 4), np.eye(4)[3:]]),
    np.eye(3)[0],
)


def _fit(body: SkinnedBody, name: str, part: Mask, betas: Array) -> Array:
    """Ends and radius (7, 1 + B) of one capsule; of several forms the one of the least cost."""
    people = body.template + np.einsum("ncb,mb->mnc", body.shapedirs, betas)
    forms = [FREE] if body.mirror is None or opposite(name) != name else [UPRIGHT, ACROSS]
    outside = next((w for leg, w in LEGS.items() if part_of(name).endswith(leg)), OUTSIDE_WEIGHT)
    fits = [
        _gauss_newton(body.template[part], people, body.faces, part, betas, form, outside)
        for form in forms
    ]
    return min(fits, key=lambda fit: fit[1])[0]


def _gauss_newton(
    rest: Array,
    people: Array,
    faces: Index,
    part: Mask,
    betas: Array,
    form: Form,
    outside: float,
) -> tuple[Array, float]:
    M, axis = form
    powers = np.hstack([np.ones((len(betas), 1)), betas])  # (m, 1 + B)
    q = np.zeros((M.shape[1], powers.shape[1]))
    q[:, 0] = np.linalg.lstsq(M, _first(rest, axis), rcond=None)[0]
    trees = [cKDTree(person) for person in people]
    outward = [
        sums_over_faces(face_vectors(person, faces), faces, len(person)) for person in people
    ]
    best, least = q, np.inf
    for _ in range(GAUSS_NEWTON_STEPS):
        capsules = powers @ (M @ q).T  # (m, 7)
        rows = [
            _rows(capsule, person, part, tree, normals, outside)
            for capsule, person, tree, normals in zip(capsules, people, trees, outward, strict=True)
        ]
        cost = float(sum(r @ r for r, _ in rows))
        if cost < least:
            best, least = q.copy(), cost
        normal = np.zeros((q.size, q.size))
        slope = np.zeros(q.size)
        for (r, J), power in zip(rows, powers, strict=True):
            inner = J @ M
            normal += np.kron(inner.T @ inner, np.outer(power, power))
            slope += np.kron(inner.T @ r, power)
        damping = 1e-4 * np.trace(normal) / q.size
        q = q - np.linalg.solve(normal + damping * np.eye(q.size), slope).reshape(q.shape)
    return M @ best, least


def _rows(
    capsule: Array, person: Array, part: Mask, tree: cKDTree, outward: Array, outside: float
) -> tuple[Array, Array]:
    """Both distances of one person and their derivatives by the capsule, (rows,), (rows, 7)."""
    a, b, r = capsule[:3], capsule[3:6], capsule[6]
    distance, t, normal = _from_segment(person[part], a, b)
    scale = np.where(distance > r, outside, 1.0) / np.sqrt(len(distance))
    r1 = scale * (distance - r)
    J1 = scale[:, None] * np.hstack(
        [-(1 - t)[:, None] * normal, -t[:, None] * normal, -np.ones((len(t), 1))]
    )
    samples, t, normal = _surface(a, b, r)
    _, nearest = tree.query(samples)
    stands_out = np.einsum("nc,nc->n", samples - person[nearest], outward[nearest]) > 0
    scale = COVERAGE_WEIGHT * (part[nearest] | stands_out) / np.sqrt(len(samples))
    r2 = scale * np.einsum("nc,nc->n", samples - person[nearest], normal)
    J2 = scale[:, None] * np.hstack(
        [(1 - t)[:, None] * normal, t[:, None] * normal, np.ones((len(t), 1))]
    )
    return np.concatenate([r1, r2]), np.vstack([J1, J2])


def _from_segment(points: Array, a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Distance (n,), place t (n,) from 0 to 1, and direction (n, 3) from a segment to points."""
    u = b - a
    t = np.clip((points - a) @ u / np.maximum(u @ u, 1e-18), 0, 1)
    off = points - a - t[:, None] * u
    distance = np.linalg.norm(off, axis=1)
    return distance, t, off / np.maximum(distance, 1e-12)[:, None]


def _surface(a: Array, b: Array, r: float) -> tuple[Array, Array, Array]:
    """Points on a capsule (n, 3), their places t (n,) on its segment, and normals (n, 3)."""
    u = b - a
    length = float(np.linalg.norm(u))
    axis = u / length if length > 1e-9 else np.array([0.0, 1.0, 0.0])
    x = np.cross(axis, np.eye(3)[int(np.argmin(abs(axis)))])
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)
    angle = 2 * np.pi * np.arange(N_AROUND) / N_AROUND
    ring = np.outer(np.cos(angle), x) + np.outer(np.sin(angle), y)
    places, normals = [], []
    for t in np.linspace(0, 1, N_ALONG):
        places.append(np.full(N_AROUND, t))
        normals.append(ring)
    for t, sign in ((0.0, -1.0), (1.0, 1.0)):
        slanted = (ring + sign * axis) / np.sqrt(2)
        places.append(np.full(N_AROUND + 1, t))
        normals.append(np.vstack([slanted, sign * axis]))
    t, n = np.concatenate(places), np.vstack(normals)
    return a + t[:, None] * u + r * n, t, n


def _first(rest: Array, axis: Array | None) -> Array:
    """Ends and radius (7,) of vertices (n, 3) m along an axis, or along their longest one."""
    middle = rest.mean(axis=0)
    if axis is None:
        axis = np.linalg.svd(rest - middle, full_matrices=False)[2][0]
    along = (rest - middle) @ axis
    r = float(np.median(np.linalg.norm(rest - middle - along[:, None] * axis, axis=1)))
    low, high = (float(x) for x in np.quantile(along, (0.02, 0.98)))
    half = max((high - low) / 2 - r, 0.01)
    centre = middle + (low + high) / 2 * axis
    return np.concatenate([centre - half * axis, centre + half * axis, [r]])


def _capsules(body: SkinnedBody, fitted: dict[str, Array]) -> Capsules:
    """All of them, with every pair that may touch."""
    arrays = np.array(list(fitted.values()))  # (C, 7, 1 + B)
    C, B = len(arrays), body.n_betas
    joint_of = {BONES[body.joint_names[k]]: k for k in part_joints(body)}
    return Capsules(
        tuple(fitted),
        np.array([joint_of[part_of(name)] for name in fitted]),
        arrays[:, :6, 0].reshape(C, 2, 3),
        arrays[:, :6, 1:].reshape(C, 2, 3, B),
        arrays[:, 6, 0],
        arrays[:, 6, 1:],
        _pairs(body, tuple(fitted)),
    )


def _pairs(body: SkinnedBody, names: tuple[str, ...]) -> Index:
    joints = part_joints(body)
    parts = [BONES[body.joint_names[k]] for k in joints]
    apart = {frozenset((parts[i], parts[j])) for i, j in separate(body, joints)}
    pairs = [
        (i, j)
        for j in range(len(names))
        for i in range(j)
        if frozenset((part_of(names[i]), part_of(names[j]))) in apart
        or any(
            (one.endswith(MAY_TOUCH_TRUNK) and part_of(other) in TRUNK)
            or (one.endswith("upper_arm_far") and other == "neck")
            for one, other in ((names[i], names[j]), (names[j], names[i]))
        )
    ]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _without_overlaps(capsules: Capsules, betas: Array) -> Capsules:
    """The same capsules; pairs that overlap at rest in most people are no pairs."""
    ends = np.array([capsules.ends_of(b) for b in betas])
    gaps = segment_distances(ends[:, :, 0], ends[:, :, 1], capsules.pairs)
    radii = capsules.radii_of(betas)
    gaps = gaps - radii[:, capsules.pairs[:, 0]] - radii[:, capsules.pairs[:, 1]]
    apart = np.mean(gaps < 0, axis=0) < 0.5
    return replace(capsules, pairs=capsules.pairs[apart])
