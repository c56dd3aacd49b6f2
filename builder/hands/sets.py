"""Training sets of synthetic hands, in folders that `workbench train` takes."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from builder.base_mesh import read_base_mesh
from builder.hands.anatomy import JOINT_NAMES, PARENTS, HandMesh, read_hand
from builder.hands.people import Hands, draw_hands
from builder.hands.poses import HandPoses
from builder.population import Report, read_shape_targets
from builder.regressors import regress
from builder.rigs import Rig
from builder.sets import SetRecipe, Subjects, write_sets
from builder.wheel import Wheel
from workbench.arrays import Array
from workbench.bodies.forward.posing import Posing
from workbench.synthetic.teacher import dual_quaternion_skinned, joint_positions, offsets

ABOUT = (
    "Synthetic hands: people from the artists' open shape targets, poses from a distribution that "
    "was made up (builder/hands/poses.py), and dual quaternion skinning with the artists' weights. "
    "No hand was measured."
)
RADIUS = 0.03  # m around a joint, of the vertices from which it may be regressed
RECIPE = SetRecipe(
    body="hand", people=120, subjects=14, poses=20, held_out=5, others=20, stirred=0.15
)


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


def hand_rig(joints: Array, ends: Array) -> Rig:
    """The rig of the right hand; `joints` (16, 3) m and `ends` (5, 3) m of the mean one."""
    draw = HandPoses(joints, ends).draw
    return Rig(JOINT_NAMES, PARENTS, HandTeacher, draw, RADIUS, "synthetic draws of hand poses")
