"""A body with hands: a body and a hand that were trained apart, on one mesh and 52 joints.

The hand was cut from the mesh that the body has, along a loop of edges behind the wrist, so that
all of its vertices are vertices of the body. Each part keeps what it was trained for, as in SMPL+H
(Romero, Tzionas and Black, Embodied Hands, 2017):

    from the body   the surface at rest and its shape directions, also those of the hands; all
                    joints down to the wrists, their weights, and what they do to the skin
    from the hand   the triangles beyond the loop, the joints of the fingers, their weights, what
                    they do to the skin, and the pose space

At rest the fingers are straight, as the hand's are: `unpose` finds the surface that the hand takes
to the body's in the pose in which the body at rest holds its fingers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array, vstack

from workbench.arrays import Array, Index
from workbench.bodies.body import Landmarks
from workbench.bodies.capsules import Capsules
from workbench.bodies.files.joint_names import FINGER_JOINTS, joint_names
from workbench.bodies.forward.posing import unpose
from workbench.bodies.hands import FINGERS, mirrored
from workbench.bodies.readonly import locked
from workbench.bodies.skinned import SkinnedBody
from workbench.geometry.mirror import AXIAL, REFLECTION
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.surface_tree import barycentric_weights

Hands = Mapping[str, SkinnedBody]  # by side, left before right

MOST_JOINTS = 4  # joints that carry a vertex
OF_BODY = 22  # the joints of SMPL without its last two, left_hand and right_hand
WRISTS = {"left": 20, "right": 21}
FIRST_FINGER = {"left": OF_BODY, "right": OF_BODY + len(FINGER_JOINTS)}  # the number of a joint
JOINTS = joint_names(OF_BODY + 2 * len(FINGER_JOINTS))
SIGNS = {"left": REFLECTION, "right": np.ones(3)}
ABOUT_PARTS = ("trained_on", "pose_blend_shapes", "held_out", "betas", "pose_space")
MADE_OF = (
    "Sewn together from the bodies {body} and {hand}, which were trained apart: nothing was "
    "trained on people whose hands and bodies moved at once. At rest it is {body} with straight "
    "fingers; joints, weights, pose blend shapes and pose space of the fingers are those of {hand}."
)


@dataclass(frozen=True, eq=False)
class Sewing:
    """N of the vertices of a body, triangles between them, and the hands that are among them.

    Attributes:
        origin: (N,) the number that each vertex has in the body, or would have in a hand of its.
        faces: (F, 3).
        mirror: (N,) the vertex on the other side of each.
        hands: by side, the vertex (H,) that each vertex of the hand is.
        held: (16, 3) rad, the pose of the hand in which the body at rest holds its fingers.
    """

    origin: Index
    faces: Index
    mirror: Index
    hands: Mapping[str, Index]
    held: Array

    def of_hand(self, side: str, rows: csr_array) -> csr_array:
        """Means of the vertices of a hand (M, H) as means of these, (M, N)."""
        entries = rows.tocoo()
        columns, shape = self.hands[side][entries.col], (rows.shape[0], len(self.origin))
        return csr_array((entries.data, (entries.row, columns)), shape=shape)

    def of_body(self, rows: csr_array, template: Array) -> csr_array:
        """Means of the vertices of the body (M, N_body), `template` (N_body, 3) m, as of these.

        The closest place on the surface stands for a vertex that is no longer there.
        """
        N, before = len(self.origin), len(template)
        means = csr_array((np.ones(N), (self.origin, np.arange(N))), shape=(before, N))
        lost = np.setdiff1d(rows.tocoo().col, self.origin)
        if len(lost):
            place = barycentric_weights(template[self.origin], self.faces, template[lost]).tocoo()
            shares = csr_array((place.data, (lost[place.row], place.col)), shape=(before, N))
            means = means + shares
        return csr_array(rows @ means)


def with_hands(body: SkinnedBody, hand: SkinnedBody, mesh: Sewing, name: str) -> SkinnedBody:
    """A body of 24 joints, alike on both sides, with the right hand and its mirror image.

    Its 52 joints are those of SMPL-H, its betas are those of the body, and its extras have the
    names that the loader of SMPL-H in the package smplx reads. In the pose `mesh.held` of both
    hands it is the body at rest, for all betas. Its landmarks are the body's `coco`, the same with
    the 21 points of each hand that COCO-WholeBody and OpenPose have (`coco_with_hands`), and the
    ends of its fingers (`tips`).

    """
    hands = {"left": mirrored(hand, "left"), "right": hand}
    template, shapedirs = body.template[mesh.origin], body.shapedirs[mesh.origin]
    flat, directions = _straightened(body, hand, mesh)
    for side, sign in SIGNS.items():
        template[mesh.hands[side]] = flat * sign
        shapedirs[mesh.hands[side]] = directions * sign[:, None]
    regressor = _regressor(body, hands, mesh)
    slopes = (regressor @ shapedirs.reshape(len(template), -1)).reshape(len(JOINTS), 3, -1)
    return SkinnedBody(
        template=locked(template),
        shapedirs=locked(shapedirs),
        posedirs=locked(_posedirs(body, hands, mesh)),
        J_regressor=regressor,
        weights=locked(_weights(body, hands, mesh)),
        parents=_parents(body, hand),
        faces=mesh.faces,
        joint_names=JOINTS,
        mirror=mesh.mirror,
        landmarks=_landmarks(body, hands, mesh, regressor),
        name=name,
        card=_card(body, hand, mesh, name),
        extras={
            f"{key}{side[0]}": array
            for key in hand.extras
            for side, array in ((side, one.extras[key]) for side, one in hands.items())
        },
        capsules=_capsules(body, regressor @ template, slopes, mesh),
    )


def _straightened(body: SkinnedBody, hand: SkinnedBody, mesh: Sewing) -> tuple[Array, Array]:
    """The right hand of the body with straight fingers, (H, 3) m, and its directions (H, 3, B)."""
    rows, pose = mesh.origin[mesh.hands["right"]], mesh.held
    flat = unpose(hand, pose, body.template[rows])
    people = body.template[rows] + np.moveaxis(body.shapedirs[rows], 2, 0)
    return flat, np.stack([unpose(hand, pose, one) - flat for one in people], axis=2)


def _weights(body: SkinnedBody, hands: Hands, mesh: Sewing) -> Array:
    """What a hand gives to its wrist is divided among the body's joints as the body does it."""
    weights, of_body = np.zeros((len(mesh.origin), len(JOINTS))), body.weights[mesh.origin]
    weights[:, :OF_BODY] = of_body[:, :OF_BODY]
    weights[:, list(WRISTS.values())] += of_body[:, OF_BODY:]  # of left_hand and right_hand
    for side, hand in hands.items():
        rows, first = mesh.hands[side], FIRST_FINGER[side]
        fingers = hand.weights[:, 1:]
        by_body = _largest(weights[rows, :OF_BODY], MOST_JOINTS - np.count_nonzero(fingers, axis=1))
        weights[rows, :OF_BODY] = by_body * hand.weights[:, :1]
        weights[rows, first : first + len(FINGER_JOINTS)] = fingers
    return weights


def _largest(shares: Array, counts: Index) -> Array:
    """As many of the largest shares of each row (n, J) as `counts` (n,) says, summing to one."""
    rank = np.argsort(np.argsort(-shares, axis=1, kind="stable"), axis=1, kind="stable")
    largest = np.where(rank < counts[:, None], shares, 0.0)
    totals = largest.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(largest, totals, out=np.zeros_like(largest), where=totals > 0))


def _posedirs(body: SkinnedBody, hands: Hands, mesh: Sewing) -> Array:
    posedirs = np.zeros((len(mesh.origin), 3, 9 * (len(JOINTS) - 1)))
    n_features = 9 * (OF_BODY - 1)
    posedirs[:, :, :n_features] = body.posedirs[mesh.origin, :, :n_features]
    for side, hand in hands.items():
        first = 9 * (FIRST_FINGER[side] - 1)
        posedirs[mesh.hands[side], :, first : first + hand.posedirs.shape[2]] = hand.posedirs
    return posedirs


def _regressor(body: SkinnedBody, hands: Hands, mesh: Sewing) -> csr_array:
    """The joints (52, N) as means of vertices: down to the wrists by the body, then by the hand."""
    rows = [mesh.of_body(body.J_regressor[:OF_BODY], body.template)]
    rows += [mesh.of_hand(side, hand.J_regressor[1:]) for side, hand in hands.items()]
    return csr_array(vstack(rows))


def _parents(body: SkinnedBody, hand: SkinnedBody) -> tuple[int, ...]:
    parents = list(body.parents[:OF_BODY])
    for side, wrist in WRISTS.items():
        parents += [FIRST_FINGER[side] + up - 1 if up else wrist for up in hand.parents[1:]]
    return tuple(parents)


def _landmarks(
    body: SkinnedBody, hands: Hands, mesh: Sewing, joints: csr_array
) -> dict[str, Landmarks]:
    """The sets `coco`, `coco_with_hands`, whose joints are means of skin, and `tips`."""
    coco = body.landmarks["coco"]
    coco = Landmarks(coco.names, mesh.of_body(coco.regressor, body.template))
    names, rows = [*coco.names], [coco.regressor]
    tips: list[tuple[str, csr_array]] = []
    for side, hand in hands.items():
        ends = hand.landmarks["tips"]
        on_skin = mesh.of_hand(side, ends.regressor)
        names.append(f"{side}_hand_root")
        rows.append(joints[[WRISTS[side]]])
        for finger in FINGERS:
            joints_of_finger = [f"{side}_{finger}{i}" for i in (1, 2, 3)]
            tips.append((f"{side}_{finger}_tip", on_skin[[ends.names.index(f"{finger}_tip")]]))
            names += [*joints_of_finger, tips[-1][0]]
            rows += [joints[[JOINTS.index(joint) for joint in joints_of_finger]], tips[-1][1]]
    return {
        "coco": coco,
        "coco_with_hands": Landmarks(tuple(names), csr_array(vstack(rows))),
        "tips": Landmarks(tuple(t[0] for t in tips), csr_array(vstack([t[1] for t in tips]))),
    }


def _capsules(body: SkinnedBody, joints: Array, slopes: Array, mesh: Sewing) -> Capsules | None:
    """The body's capsules; that of four fingers moves with the middle finger's first joint."""
    if body.capsules is None:
        return None
    parts = body.capsules.arrays()
    number, ends, end_slopes = (parts[key].copy() for key in ("joints", "ends", "end_slopes"))
    bend = mesh.held[1 + FINGER_JOINTS.index("middle1")]
    for side, before in (("left", OF_BODY), ("right", OF_BODY + 1)):
        middle, own = JOINTS.index(f"{side}_middle1"), np.flatnonzero(number == before)
        back = matrix_from_vector(bend * (AXIAL if side == "left" else 1)).T
        ends[own] = (ends[own] - joints[middle]) @ back.T + joints[middle]
        end_slopes[own] = back @ (end_slopes[own] - slopes[middle]) + slopes[middle]
        number[own] = middle
    moved = {"joints": number, "ends": ends, "end_slopes": end_slopes}
    return Capsules.from_arrays(parts | moved)


def _card(body: SkinnedBody, hand: SkinnedBody, mesh: Sewing, name: str) -> dict[str, Any]:
    how = MADE_OF.format(body=body.name, hand=hand.name)
    counts = {"n_vertices": len(mesh.origin), "n_faces": len(mesh.faces)}
    parts = body, hand
    copied = {key: body.card[key] for key in ("synthetic", "source", "licence") if key in body.card}
    return {
        "name": name,
        **counts,
        **copied,
        "provenance": [
            how,
            *(f"{part.name}: {said}" for part in parts for said in part.card.get("provenance", ())),
        ],
        "parts": {
            part.name: {key: part.card[key] for key in ABOUT_PARTS if key in part.card}
            for part in parts
        },
    }
