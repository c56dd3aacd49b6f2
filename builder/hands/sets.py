"""Training sets of synthetic hands, in folders that `workbench train` takes.

The distribution of poses is synthetic; no hand was measured for it. Fifteen angles, as a glove
measures them, are a mean, two synergies and a rest without structure. The shares of the two are set
to what Santello, Flanders and Soechting report of real grasps (Postural hand synergies for tool
use, J. Neurosci. 18, 1998): together over 80 % of the variance. The last joint of a finger turns by
2/3 of the one before it. Ranges are anatomical.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from builder.base_mesh import BaseMesh, read_base_mesh
from builder.hands.mesh import (
    INDEX,
    JOINT_NAMES,
    MIDDLE,
    PARENTS,
    PINKY,
    RING,
    THUMB,
    HandMesh,
    read_hand,
    to_flat,
)
from builder.population import (
    Report,
    ShapeTargets,
    Traits,
    direction,
    draw_person,
    read_shape_targets,
)
from builder.sets import RigRecipe, SetRecipe, Subjects, regress, write_sets
from builder.wheel import Wheel
from lectures.material.teacher import dual_quaternion_skinned, joint_positions, offsets
from workbench.arrays import Array, Mask
from workbench.bodies.files.joint_names import FINGER_JOINTS
from workbench.bodies.forward.posing import Posing
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix

SPREAD = 0.3  # of the local changes of hands and arms, which every person has
DIP = 2 / 3  # of the flexion of the joint before it
SHARES = (0.60, 0.21)  # of the variance of the fifteen angles; a rest of 19 % is left
# Of each angle in degrees: mean, standard deviation, lower and upper limit; and how much it takes
# part in closing the hand, and in hooking it (the second synergy bends middle joints as the first
# joints stretch).
ANGLES = {
    "thumb_opposition": (22, 14, -10, 60, 0.45, -0.35),
    "thumb_abduction": (15, 9, -5, 45, -0.20, -0.30),
    "thumb2_flexion": (12, 10, -10, 55, 0.35, 0.15),
    "thumb3_flexion": (18, 15, -15, 80, 0.40, 0.45),
    "index1_flexion": (30, 20, -20, 90, 0.85, -0.60),
    "index2_flexion": (38, 22, 0, 100, 0.75, 0.60),
    "middle1_flexion": (33, 21, -20, 90, 0.95, -0.50),
    "middle2_flexion": (42, 23, 0, 100, 0.85, 0.55),
    "ring1_flexion": (33, 21, -20, 90, 0.95, -0.50),
    "ring2_flexion": (42, 23, 0, 100, 0.85, 0.55),
    "pinky1_flexion": (32, 22, -20, 90, 0.85, -0.55),
    "pinky2_flexion": (38, 22, 0, 100, 0.75, 0.60),
    "index_spread": (0, 5, -10, 20, -0.35, -0.10),
    "ring_spread": (0, 4, -10, 15, -0.35, -0.10),
    "pinky_spread": (2, 6, -10, 25, -0.40, -0.15),
}
FIRST = {"index": INDEX, "middle": MIDDLE, "pinky": PINKY, "ring": RING}
ABOUT = (
    "Synthetic hands: people from the artists' open shape targets, poses from a distribution that "
    "was made up (builder/hands/sets.py), and dual quaternion skinning with the artists' weights. "
    "No hand was measured."
)
RADIUS = 0.03  # m around a joint, of the vertices from which it may be regressed
RECIPE = SetRecipe(
    body="hand", people=120, subjects=14, poses=20, held_out=5, others=20, stirred=0.15
)


@dataclass(frozen=True, eq=False)
class Hands:
    """Right hands of P adults, flat, palm down, the wrist joint at the origin.

    Attributes:
        female: (P,).
        vertices: (P, N, 3) m.
        joints: (P, 16, 3) m.
        ends: (P, 5, 3) m, of the last bones.
    """

    female: Mask
    vertices: Array
    joints: Array
    ends: Array


def draw_hands(
    mesh: BaseMesh, hand: HandMesh, targets: ShapeTargets, n: int, seed: int, report: Report
) -> Hands:
    """`n` hands, of women and men in turn."""
    rng = np.random.default_rng(seed)
    own = np.array([name.startswith(("hands/", "arms/")) for name in targets.local])
    vertices = np.empty((n, len(hand.vertices), 3))
    joints, ends = np.empty((n, 16, 3)), np.empty((n, 5, 3))
    for i in range(n):
        person = with_hands(draw_person(rng, i % 2 == 0, targets.girth), own, rng)
        drawn = targets.coefficients(person) @ targets.displacements
        body = mesh.vertices + drawn.reshape(-1, 3)
        rest, ends[i] = to_flat(
            body[hand.vertices], hand.joints @ body, hand.ends @ body, hand.weights
        )
        vertices[i], joints[i] = rest.vertices, rest.joints
        if (i + 1) % 100 == 0:
            report(f"  {i + 1} of {n} hands")
    return Hands(np.arange(n) % 2 == 0, vertices, joints, ends)


def with_hands(person: Traits, own: Mask, rng: np.random.Generator) -> Traits:
    """The person with local changes of hands and arms drawn anew; `own` (L,) says which are."""
    changes = np.where(own, rng.normal(0, SPREAD, len(own)).clip(-0.8, 0.8), person.local)
    return replace(person, local=tuple(changes))


@dataclass(frozen=True, eq=False)
class HandPoses:
    """From fifteen angles to poses, on the joints of the mean right hand at rest.

    Attributes:
        joints: (16, 3) m, flat, as `rest.to_flat` gives them.
        ends: (5, 3) m.
    """

    joints: Array
    ends: Array

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """So many poses (count, 16, 3) rad, the wrist not turned."""
        return self.poses(draw_angles(count, rng))

    def poses(self, angles: Array) -> Array:
        """The poses (n, 16, 3) rad of angles (n, 15) rad."""
        at = dict(zip(ANGLES, angles.T, strict=True))
        found = np.zeros((len(angles), len(JOINT_NAMES), 3))
        up = np.array([0.0, 1.0, 0.0])
        spreads = {"index": at["index_spread"], "middle": 0 * at["index_spread"]}
        spreads["ring"] = -at["ring_spread"]  # away from the middle finger, to the back
        spreads["pinky"] = -at["ring_spread"] - at["pinky_spread"]
        for finger, first in FIRST.items():
            axis = np.cross(direction(self.joints[first + 1] - self.joints[first]), -up)
            bent, middle = at[f"{finger}1_flexion"], at[f"{finger}2_flexion"]
            found[:, first] = _composed(up, spreads[finger], axis, bent)
            found[:, first + 1] = middle[:, None] * axis
            found[:, first + 2] = DIP * middle[:, None] * axis
        flexion = self.thumb_axis
        palm = np.array([-1.0, 0.0, 0.0])  # opposition turns the thumb about the hand's length
        away = np.cross(flexion, direction(self.joints[THUMB + 1] - self.joints[THUMB]))
        found[:, THUMB] = _composed(palm, at["thumb_opposition"], -away, at["thumb_abduction"])
        found[:, THUMB + 1] = at["thumb2_flexion"][:, None] * flexion
        found[:, THUMB + 2] = at["thumb3_flexion"][:, None] * flexion
        return found

    @property
    def thumb_axis(self) -> Array:
        """The axis about which the thumb's last two joints bend it, towards the fingers."""
        chain = [*self.joints[THUMB : THUMB + 3], self.ends[4]]
        along = direction(chain[3] - chain[1])
        goal = direction(self.joints[PINKY] - chain[1])  # what the thumb bends to
        return direction(np.cross(along, goal))


def _composed(first: Array, by: Array, then: Array, angle: Array) -> Array:
    """Rotation vectors (n, 3): about `then`, and after it about `first`."""
    R = matrix_from_vector(by[:, None] * first) @ matrix_from_vector(angle[:, None] * then)
    return np.asarray(vector_from_matrix(R))


def draw_angles(count: int, rng: np.random.Generator) -> Array:
    """So many sets of the fifteen angles (count, 15) rad, each within its limits."""
    table = np.array(list(ANGLES.values()), dtype=float)
    mean, spread, lower, upper = np.radians(table[:, :4]).T
    total = float((spread**2).sum())
    synergies = _orthonormal(table[:, 4:] * spread[:, None])
    parts = rng.standard_normal((count, 2)) * np.sqrt(np.array(SHARES) * total)
    rest = rng.standard_normal((count, len(table))) * spread * np.sqrt(1 - sum(SHARES))
    return np.asarray((mean + parts @ synergies.T + rest).clip(lower, upper))


def _orthonormal(columns: Array) -> Array:
    Q, R = np.linalg.qr(columns)
    return np.asarray(Q * np.sign(np.diag(R)))


def pose_space(poses: Array) -> tuple[Array, Array, Array]:
    """Mean (45,) rad, components (45, 45) in rows of length one, and deviations (45,) rad."""
    flat = poses[:, 1:].reshape(len(poses), -1)
    mean = flat.mean(axis=0)
    _, sizes, rows = np.linalg.svd(flat - mean, full_matrices=False)
    signs = np.where(rows.sum(axis=1) < 0, -1.0, 1.0)
    return mean, rows * signs[:, None], sizes / np.sqrt(len(poses) - 1)


assert len(FINGER_JOINTS) == 15


@dataclass(frozen=True, eq=False)
class HandTeacher:
    """One hand, blended by dual quaternions.

    Attributes:
        rest: (N, 3) in metres, the surface at rest.
        joints: (16, 3) in metres, at rest.
        weights: (N, 16), rows sum to one.
    """

    rest: Array
    joints: Array
    weights: csr_array

    def vertices(self, pose: Array) -> Array:
        """The posed surface (N, 3) m of one pose (16, 3) rad."""
        R = Posing.of(pose[None], PARENTS).world[0]
        shifts = offsets(R, joint_positions(R, self.joints, PARENTS), self.joints)
        return dual_quaternion_skinned(self.rest, self.weights, R, shifts, PARENTS)


def make_hand_sets(wheel: Wheel, recipe: SetRecipe, folder: Path, report: Report) -> HandMesh:
    """Write the folders `train` and `held_out`."""
    mesh = read_base_mesh(wheel)
    hand = read_hand(wheel, mesh)
    report("reading the shape targets")
    targets = read_shape_targets(wheel, len(mesh.vertices))
    report(f"drawing {recipe.everyone + recipe.others} hands")
    people = draw_hands(mesh, hand, targets, recipe.everyone, recipe.seed, report)
    further = draw_hands(mesh, hand, targets, recipe.others, recipe.seed + 1, report)
    subjects = hand_subjects(people, hand, recipe)
    joints = subjects.regressor @ further.vertices
    others = replace(subjects, rest=further.vertices, joints=joints, female=further.female)
    write_sets(subjects, others, hand.faces, recipe, folder, report, None, ABOUT)
    return hand


def hand_subjects(people: Hands, hand: HandMesh, recipe: SetRecipe) -> Subjects:
    """Everyone, with joints as means of vertices."""
    own = people.vertices[: recipe.people], people.joints[: recipe.people]
    sides = np.arange(len(hand.vertices))  # a hand has no other side
    regressor = regress(*own, JOINT_NAMES, sides, RADIUS)
    rig = hand_rig(people.joints.mean(axis=0), people.ends.mean(axis=0))
    fine = csr_array(hand.weights)
    joints = regressor @ people.vertices
    return Subjects(people.vertices, joints, people.female, hand.weights, fine, regressor, rig)


def hand_rig(joints: Array, ends: Array) -> RigRecipe:
    """The rig of the right hand; `joints` (16, 3) m and `ends` (5, 3) m of the mean one."""
    draw = HandPoses(joints, ends).draw
    return RigRecipe(
        JOINT_NAMES, PARENTS, HandTeacher, draw, RADIUS, "synthetic draws of hand poses"
    )
