"""Checks of lecture 18, and the mistakes that they tell apart."""

import numpy as np

from workbench.course import check, equal, mistake
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.lec18_hands import solutions

RNG = np.random.default_rng(18)

# pose_of

MEAN, PARTS = RNG.standard_normal((15, 3)), RNG.standard_normal((6, 15, 3))


@check("pose_of", points=1)
def zero_is_the_mean(pose_of):
    """without coefficients it is the mean pose"""
    equal(pose_of(MEAN, PARTS, np.zeros(6)), MEAN, "the pose for z = 0")


@check("pose_of", points=1)
def coefficients_count_once(pose_of):
    """each coefficient adds its component, and together they add up"""
    for z in (np.eye(6)[2], np.arange(6.0)):
        equal(pose_of(MEAN, PARTS, z), solutions.pose_of(MEAN, PARTS, z), f"the pose for z = {z}")


@mistake("pose_of", "the mean is missing: z = 0 is the mean pose, and not the flat hand")
def without_the_mean(mean, components, z):
    return np.tensordot(z, components, axes=1)


@mistake("pose_of", "the mean is added once, and not once for each component")
def a_mean_for_each_component(mean, components, z):
    return len(z) * mean + np.tensordot(z, components, axes=1)


@mistake("pose_of", "this multiplies the mean too; only components have coefficients")
def scaled_mean(mean, components, z):
    return (1 + np.sum(z)) * (mean + 1e-3) + np.tensordot(z, components, axes=1)


@mistake("pose_of", "the coefficients run over components in order, and not backwards")
def backwards(mean, components, z):
    return mean * (1 + 1e-3) + np.tensordot(z[::-1], components, axes=1)


# components_needed

FALLING = np.array([3.0, 1.0, 1.0, 1.0, 0.5, 0.5])


@check("components_needed", points=1)
def all_or_one(components_needed):
    """the first component holds its own share, and all hold everything"""
    equal(components_needed(FALLING, 9 / 12.5), 1, "how many hold the share of the first")
    equal(components_needed(FALLING, 1.0), 6, "how many hold everything")


@check("components_needed", points=1)
def as_many_as_it_takes(components_needed):
    """no fewer hold the share, and no more are needed"""
    for share in (0.78, 0.95, 0.99):
        came = components_needed(FALLING, share)
        equal(
            came, solutions.components_needed(FALLING, share), f"how many hold a share of {share}"
        )


@mistake("components_needed", "a variance is the square of a standard deviation")
def of_deviations(deviations, share):
    held = np.cumsum(deviations) / deviations.sum()
    return int(np.argmax(held >= share - 1e-12)) + 1


@mistake("components_needed", "indices begin with 0, and numbers of components with 1")
def an_index(deviations, share):
    return solutions.components_needed(deviations, share) - 1


@mistake(
    "components_needed", "one component more than needed: 'at least' includes the share itself"
)
def one_too_many(deviations, share):
    return solutions.components_needed(deviations, share) + 1


# mirrored

SKIN, TURNS = RNG.standard_normal((7, 3)), RNG.standard_normal((4, 3))
TURNS *= 2.5 / np.linalg.norm(TURNS, axis=1).max()  # rad; below pi a matrix has one vector
S = np.diag([-1.0, 1.0, 1.0])


@check("mirrored", points=1)
def positions_are_reflected(mirrored):
    """the x of a vertex changes sign, and mirrored twice everything is as before"""
    vertices, pose = mirrored(SKIN, TURNS)
    equal(vertices, SKIN @ S, "the vertices in the mirror")
    for came, right, name in zip(
        mirrored(vertices, pose), (SKIN, TURNS), ("vertices", "pose"), strict=True
    ):
        equal(came, right, f"the {name} after two mirrors")


@check("mirrored", points=1)
def rotations_are_those_of_the_mirror(mirrored):
    """a rotation R becomes S R S: it turns the mirror image as R turns the original"""
    came = matrix_from_vector(mirrored(SKIN, TURNS)[1])
    equal(came, S @ matrix_from_vector(TURNS) @ S, "the rotation matrices in the mirror")


@mistake(
    "mirrored", "an axis of rotation is no position: it keeps x, and the signs of y and z change"
)
def axes_as_positions(vertices, pose):
    return vertices * [-1.0, 1.0, 1.0], pose * [-1.0, 1.0, 1.0] * (1 + 1e-9)


@mistake(
    "mirrored",
    "only the axis along the mirror's normal keeps its sense; this changes the sense of all three",
)
def all_backwards(vertices, pose):
    return vertices * [-1.0, 1.0, 1.0], -pose


@mistake("mirrored", "the mirror is x -> -x; this is another plane")
def in_another_mirror(vertices, pose):
    return vertices * [1.0, 1.0, -1.0], pose * [-1.0, -1.0, 1.0]


@mistake(
    "mirrored",
    "x -> -x changes the sign of x in positions, and those of y and z in rotation vectors",
)
def exchanged(vertices, pose):
    return vertices * [1.0, -1.0, -1.0], pose * [-1.0, 1.0, 1.0]


# whole_pose

BODY, LEFT, RIGHT = (RNG.standard_normal((n, 3)) for n in (24, 15, 15))


@check("whole_pose", points=1)
def the_body_comes_first(whole_pose):
    """52 joints, the first 22 of which are the body's"""
    came = whole_pose(BODY, LEFT, RIGHT)
    equal(came[:22], BODY[:22], "the joints of the body")
    equal(came[22:], np.concatenate([LEFT, RIGHT]), "the joints of the fingers")


@mistake("whole_pose", "the left hand comes before the right one")
def right_before_left(body, left, right):
    return np.concatenate([body[:22], right, left])


@mistake(
    "whole_pose", "left_hand and right_hand are SMPL's last two joints; the fingers replace them"
)
def with_the_hands_of_smpl(body, left, right):
    return np.concatenate([body, left[:14], right[:14]])


@mistake("whole_pose", "the body comes first in SMPL-H, and the hands at the end")
def hands_first(body, left, right):
    return np.concatenate([left, right, body[:22]])


# seen_turns

FINGER = np.array([[0.0, 0.0, 0.0], [0.04, 0.0, 0.0], [0.065, 0.005, 0.0]])
TIP = np.array([[0.085, 0.0, 0.004]])
HANGS = np.array([[True, False, False], [True, True, False]])  # joints 2 and 3 on those before
WITH_TIP = np.vstack([HANGS, [True, True, True]])


@check("seen_turns", points=1)
def joints_alone(seen_turns):
    """two places have at most as many directions as two spheres; the last joint is not seen at all"""
    equal(seen_turns(FINGER, FINGER[1:], HANGS), 4, "what joints 2 and 3 show of 9 numbers")
    equal(
        seen_turns(FINGER[:1], FINGER[1:2], HANGS[:1, :1]), 2, "what one point shows of one joint"
    )
    joint, line = np.array([[1.0, 1.0, 0.0]]), np.array([[2.0, 1.0, 0.0], [3.0, 1.0, 0.0]])
    both = np.ones((2, 1), dtype=bool)
    equal(seen_turns(joint, line, both), 2, "what two points on a line through the joint show")


@check("seen_turns", points=1)
def with_the_tip(seen_turns):
    """a tip that is off the line shows more"""
    points = np.vstack([FINGER[1:], TIP])
    equal(seen_turns(FINGER, points, WITH_TIP), 6, "what joints and tip show of 9 numbers")
    nothing = np.zeros((3, 3), dtype=bool)
    equal(seen_turns(FINGER, points, nothing), 0, "what points show that hang on no joint")


@mistake(
    "seen_turns", "this counts coordinates of points; many of their changes are the same or none"
)
def coordinates(joints, points, moved_by):
    return int(3 * moved_by.any(axis=1).sum())


@mistake("seen_turns", "these are the directions that are not seen; the question is how many are")
def unseen_turns(joints, points, moved_by):
    return 3 * len(joints) - solutions.seen_turns(joints, points, moved_by)


@mistake("seen_turns", "every point is moved by the joints that it hangs on, and by no others")
def by_every_joint(joints, points, moved_by):
    every = np.ones_like(moved_by) if len(joints) > 1 else moved_by
    found = solutions.seen_turns(joints, points, every)
    return found if len(joints) > 1 else found + 1


@mistake(
    "seen_turns", "the arm of a turn leads from the joint to the point, and not from the origin"
)
def about_the_origin(joints, points, moved_by):
    return solutions.seen_turns(np.zeros_like(joints), points, moved_by)
