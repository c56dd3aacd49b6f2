"""Checks of lecture 3, and the mistakes that they tell apart."""

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec03_chains import solutions

RNG = np.random.default_rng(3)
PARENTS = [-1, 0, 1, 2, 1, 4, 0]
K = len(PARENTS)
JOINTS = RNG.uniform(-0.5, 0.5, size=(K, 3)) + [0.2, 1.0, -0.1]
TURNS = Rotation.from_rotvec(0.8 * RNG.standard_normal((K, 3))).as_matrix()
REST = np.tile(np.eye(3), (K, 1, 1))
CLOUD = RNG.uniform(-1, 1, size=(6, 3))
QUARTER = Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix()


def motion(R, t):
    G = np.eye(4)
    G[:3, :3], G[:3, 3] = R, t
    return G


MOTIONS = [motion(R, t) for R, t in zip(TURNS[:3], JOINTS[:3], strict=True)]


# inverse


@check("inverse", points=1)
def undoes_it(inverse):
    """one after the other is the identity, in either order"""
    for G in MOTIONS:
        equal(inverse(G) @ G, np.eye(4), "the inverse times G")
        equal(G @ inverse(G), np.eye(4), "G times the inverse")


@mistake(
    "inverse", "the offset has to be turned back as well: from y = R x + t follows x = R'(y - t)"
)
def offset_only_negated(G):
    return motion(G[:3, :3].T, -G[:3, 3])


@mistake(
    "inverse", "the 4 x 4 matrix of a rigid motion is no rotation: its transpose is not its inverse"
)
def transposed(G):
    return G.T


@mistake("inverse", "the offset is turned by R where it should be turned back, by R'")
def offset_turned_forth(G):
    return motion(G[:3, :3].T, -G[:3, :3] @ G[:3, 3])


@mistake("inverse", "the rotation has to be undone too: transpose R")
def rotation_kept(G):
    return motion(G[:3, :3], -G[:3, 3])


# turned_body


@check("turned_body", points=1)
def leaves_the_pelvis(turned_body):
    """the pelvis stays where it is"""
    for R in TURNS[:3]:
        equal(turned_body(JOINTS, JOINTS[0], R)[0], JOINTS[0], "a vertex at the pelvis")
        equal(
            turned_body(CLOUD, np.zeros(3), R),
            CLOUD @ R.T,
            "the surface of a body whose pelvis is at the origin",
        )


@check("turned_body", points=1)
def turns_the_right_way(turned_body):
    """it turns the right way, and rigidly"""
    came = turned_body(np.array([[1.0, 2.0, 0.0]]), np.array([0.0, 2.0, 0.0]), QUARTER)
    equal(
        came[0],
        [0, 3, 0],
        "a vertex 1 m to the side of the pelvis (0, 2, 0), a quarter turn about z",
    )
    came = turned_body(CLOUD, JOINTS[0], TURNS[0])
    equal(came, solutions.turned_body(CLOUD, JOINTS[0], TURNS[0]), "the turned surface")


@mistake(
    "turned_body",
    "this turns about the origin, but the pelvis must stay where it is: subtract the pelvis first",
)
def about_the_origin(vertices, pelvis, R):
    return vertices @ R.T


@mistake("turned_body", "the pelvis was subtracted, but not added again")
def left_at_the_origin(vertices, pelvis, R):
    return (vertices - pelvis) @ R.T


@mistake("turned_body", "it turns backwards: vertices are rows here, so R v is v @ R.T")
def with_r_for_its_transpose(vertices, pelvis, R):
    return (vertices - pelvis) @ R + pelvis


# world_rotations


@check("world_rotations", points=1)
def are_right_when_one_turns(world_rotations):
    """if one joint turns, everything that hangs on it turns along, and nothing else does"""
    for k in range(K):
        R = REST.copy()
        R[k] = QUARTER
        below = [j for j in range(K) if k in way_up(j)]
        expected = REST.copy()
        expected[below] = QUARTER
        equal(world_rotations(R, PARENTS), expected, f"the world's rotations when joint {k} turns")


def way_up(j):
    way = [j]
    while PARENTS[way[-1]] >= 0:
        way.append(PARENTS[way[-1]])
    return way


@check("world_rotations", points=1)
def are_in_the_right_order(world_rotations):
    """a joint's frame turns along with its parent"""
    for R in (TURNS, TURNS[::-1], TURNS @ QUARTER):
        equal(
            world_rotations(R, PARENTS),
            solutions.world_rotations(R, PARENTS),
            "the world's rotations",
        )


@mistake(
    "world_rotations", "the order: the parent's rotation comes on the left, world[parent] @ R[k]"
)
def in_the_other_order(R, parents):
    world = [R[0]]
    for k in range(1, len(parents)):
        world.append(R[k] @ world[parents[k]])
    return np.array(world)


@mistake(
    "world_rotations",
    "this goes up by one joint only: multiply with the parent's rotation in the world, not with its "
    "rotation relative to its own parent",
)
def of_one_parent(R, parents):
    return np.array([R[0], *(R[parents[k]] @ R[k] for k in range(1, len(parents)))])


@mistake(
    "world_rotations", "these rotations are still relative to the parents: nothing was multiplied"
)
def relative(R, parents):
    return R


@mistake("world_rotations", "the parent of joint k is parents[k], not joint k - 1: chains branch")
def without_branches(R, parents):
    return solutions.world_rotations(R, list(range(-1, len(parents) - 1)))


# posed_joints


@check("posed_joints", points=1)
def keep_bones(posed_joints):
    """bones keep their lengths, the root stays, and at rest nothing moves"""
    equal(posed_joints(REST, JOINTS, PARENTS), JOINTS, "the joints at rest")
    up = PARENTS[1:]
    posed = posed_joints(TURNS, JOINTS, PARENTS)
    equal(posed[0], JOINTS[0], "the root")
    expected = np.linalg.norm(JOINTS[1:] - JOINTS[up], axis=1)
    equal(np.linalg.norm(posed[1:] - posed[up], axis=1), expected, "the lengths of the bones, in m")


@check("posed_joints", points=2)
def are_those_of_the_chain(posed_joints):
    """they are where the chain puts them"""
    row = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    R = REST[:3].copy()
    R[1] = QUARTER
    equal(
        posed_joints(R, row, [-1, 0, 1]),
        [[0, 0, 0], [1, 0, 0], [1, 1, 0]],
        "three joints in a row along x, when the middle one makes a quarter turn about z",
    )
    R[0] = QUARTER
    equal(
        posed_joints(R, row, [-1, 0, 1]),
        [[0, 0, 0], [0, 1, 0], [-1, 1, 0]],
        "three joints in a row along x, when the first two make a quarter turn about z",
    )
    expected = solutions.posed_joints(TURNS, JOINTS, PARENTS)
    equal(posed_joints(TURNS, JOINTS, PARENTS), expected, "the joints of a tree in a random pose")


@mistake(
    "posed_joints",
    "the bone to joint k is turned by the parent and all joints above it, not by joint k itself: a "
    "wrist does not move when it turns",
)
def by_their_own_rotation(R, joints, parents):
    world = solutions.world_rotations(R, parents)
    posed = [joints[0]]
    for k in range(1, len(parents)):
        posed.append(posed[parents[k]] + world[k] @ (joints[k] - joints[parents[k]]))
    return np.array(posed)


@mistake(
    "posed_joints",
    "this adds the joint's position at rest; add the bone, which is the difference of two joints",
)
def with_places_for_bones(R, joints, parents):
    world = solutions.world_rotations(R, parents)
    posed = [joints[0]]
    for k in range(1, len(parents)):
        posed.append(posed[parents[k]] + world[parents[k]] @ joints[k])
    return np.array(posed)


@mistake(
    "posed_joints",
    "the bone was turned by the parent's rotation relative to the grandparent; take the parent's "
    "rotation in the world",
)
def by_the_parents_own(R, joints, parents):
    posed = [joints[0]]
    for k in range(1, len(parents)):
        posed.append(posed[parents[k]] + R[parents[k]] @ (joints[k] - joints[parents[k]]))
    return np.array(posed)


@mistake(
    "posed_joints",
    "the root has moved: it was put at the origin, or was turned about it",
)
def from_the_origin(R, joints, parents):
    return solutions.posed_joints(R, joints, parents) - joints[0]


@mistake(
    "posed_joints",
    "these are offsets of G'_k, which take the origin along: at rest all of them are zero. Posed joints "
    "are offsets of G_k",
)
def of_the_binding_matrices(R, joints, parents):
    return solutions.binding(R, joints, parents)[:, :3, 3]


OTHER_ROTATIONS = (
    "the rotations in the world are wrong, whatever else is right: if you call `world_rotations`, solve "
    "that exercise first"
)


def joints_by(world_rotations):
    def answer(R, joints, parents):
        world, posed = world_rotations.answer(R, parents), [joints[0]]
        for k in range(1, len(parents)):
            up = parents[k]
            posed.append(posed[up] + world[up] @ (joints[k] - joints[up]))
        return np.array(posed)

    return mistake("posed_joints", OTHER_ROTATIONS)(answer)


joints_by_the_other_order = joints_by(in_the_other_order)
joints_by_one_parent = joints_by(of_one_parent)
joints_without_branches = joints_by(without_branches)


# binding


@check("binding", points=1)
def are_nothing_at_rest(binding):
    """at rest they leave everything where it is"""
    equal(binding(REST, JOINTS, PARENTS), np.tile(np.eye(4), (K, 1, 1)), "the matrices at rest")


@check("binding", points=1)
def take_joints_along(binding):
    """the matrices of both bones that meet at a joint move it to where the chain puts it"""
    G = binding(TURNS, JOINTS, PARENTS)
    expected = solutions.posed_joints(TURNS, JOINTS, PARENTS)
    for k in range(K):
        for bone in {k, max(PARENTS[k], 0)}:
            came = G[bone, :3, :3] @ JOINTS[k] + G[bone, :3, 3]
            equal(came, expected[k], f"joint {k} as moved by matrix {bone}")


@check("binding", points=1)
def turn_as_the_chain_does(binding):
    """they turn as the chain does"""
    G = binding(TURNS, JOINTS, PARENTS)
    equal(G[:, :3, :3], solutions.world_rotations(TURNS, PARENTS), "their rotations")
    equal(G[:, 3], np.tile([0, 0, 0, 1], (K, 1)), "their last rows")


def chained(R, joints, parents):
    G = np.tile(np.eye(4), (len(parents), 1, 1))
    G[:, :3, :3] = solutions.world_rotations(R, parents)
    G[:, :3, 3] = solutions.posed_joints(R, joints, parents)
    return G


@mistake(
    "binding",
    "these are the G_k(pose): they expect points in the frame of the joint, but the surface at rest "
    "is drawn in the world. Go into the joint's frame first",
)
def without_the_inverse(R, joints, parents):
    return chained(R, joints, parents)


@mistake(
    "binding",
    "the inverse is on the wrong side: it comes first, from the world at rest into the joint's frame, "
    "and what comes first stands on the right",
)
def with_the_inverse_on_the_left(R, joints, parents):
    back = np.linalg.inv(chained(np.tile(np.eye(3), (len(parents), 1, 1)), joints, parents))
    return back @ chained(R, joints, parents)


@mistake(
    "binding",
    "the joint at rest was added and not subtracted: G_k(rest)^-1 is a translation by minus "
    "the joint",
)
def with_the_rest_itself(R, joints, parents):
    rest = chained(np.tile(np.eye(3), (len(parents), 1, 1)), joints, parents)
    return chained(R, joints, parents) @ rest


@mistake(
    "binding",
    "each rotation is still relative to the parent: multiply along the chain, with the parent on the "
    "left",
)
def of_relative_rotations(R, joints, parents):
    G = np.tile(np.eye(4), (len(parents), 1, 1))
    G[:, :3, :3] = R
    G[:, :3, 3] = joints - np.einsum("kij,kj->ki", R, joints)
    return G


@mistake("binding", "these matrices go the other way, from the posed surface to the one at rest")
def the_other_way(R, joints, parents):
    return np.linalg.inv(solutions.binding(R, joints, parents))


def matrices_by(world_rotations, joints_too):
    def answer(R, joints, parents):
        world = world_rotations.answer(R, parents)
        posed = (joints_by(world_rotations).answer if joints_too else solutions.posed_joints)(
            R, joints, parents
        )
        G = np.tile(np.eye(4), (len(parents), 1, 1))
        G[:, :3, :3], G[:, :3, 3] = world, posed - np.einsum("kij,kj->ki", world, joints)
        return G

    return mistake("binding", OTHER_ROTATIONS)(answer)


matrices_by_the_other_order = matrices_by(in_the_other_order, True)
matrices_by_one_parent = matrices_by(of_one_parent, True)
matrices_without_branches = matrices_by(without_branches, True)
turns_in_the_other_order = matrices_by(in_the_other_order, False)
turns_of_one_parent = matrices_by(of_one_parent, False)
turns_without_branches = matrices_by(without_branches, False)


# reach

ARMS = [
    np.array([[0.3, 0, 0], [0.25, 0, 0]]),
    np.array([[0.15, 0.02, 0], [0.3, 0, 0.1], [0.2, -0.1, 0]]),
]
NEAR = [np.array([0.2, 0.35, 0.1]), np.array([-0.3, -0.1, 0.2])]
FAR = [np.array([0.5, 0.9, -0.3]), np.array([-2.0, 0.1, 0.4])]


def misses(reach, targets):
    for arm in ARMS:
        for target in targets:
            length = np.linalg.norm(arm, axis=1).sum()
            least = max(0.0, np.linalg.norm(target) - length)
            off = np.linalg.norm(solutions.tip(reach(arm, target), arm) - target)
            where = f"from the tip to {target}, {np.linalg.norm(target):.2f} m away, by an arm of {length:.2f} m"
            holds(off <= least + 1e-4, where, f"at most {least:.4f} m", f"{off:.4f} m")


@check("reach", points=2)
def gets_there(reach):
    """the tip is at the target, where it can be reached"""
    misses(reach, NEAR)


@check("reach", points=1)
def stretches(reach):
    """it stretches towards a target that is too far away"""
    misses(reach, FAR)


@mistake("reach", "this is the arm at rest: nothing was turned")
def at_rest(bones, target):
    return np.zeros(bones.shape)


@mistake(
    "reach",
    "the arm is stretched towards the target, and reaches beyond one that is near: it has to bend as "
    "well",
)
def pointing(bones, target):
    return solutions.stretched(bones, target / np.linalg.norm(target))


@mistake(
    "reach",
    "these are rotations in the world, but the answer for a joint is relative to the joint before it, "
    "which has turned already",
)
def in_the_world(bones, target):
    pose = solutions.reach(bones, target)
    R = solutions.world_rotations(
        Rotation.from_rotvec(pose).as_matrix(), list(range(-1, len(pose) - 1))
    )
    return Rotation.from_matrix(R).as_rotvec()


@mistake("reach", "only the first joint was turned, and the rest of the arm stays straight")
def the_first_joint(bones, target):
    pose = np.zeros(bones.shape)
    turn, _ = Rotation.align_vectors([target / np.linalg.norm(target)], [bones.sum(axis=0)])
    pose[0] = turn.as_rotvec()
    return pose
