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


@mistake("inverse", "the offset has to be turned back as well: from y = R x + t follows R'(y - t)")
def offset_only_negated(G):
    return motion(G[:3, :3].T, -G[:3, 3])


@mistake("inverse", "a rigid motion is no rotation of four-space: its transpose is not its inverse")
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


@mistake("turned_body", "this turns about the origin; the pelvis must stay: take it away first")
def about_the_origin(vertices, pelvis, R):
    return vertices @ R.T


@mistake("turned_body", "the pelvis has been taken away but not added again")
def left_at_the_origin(vertices, pelvis, R):
    return (vertices - pelvis) @ R.T


@mistake("turned_body", "it turns backwards: vertices are rows here, so R v is v @ R.T")
def with_r_for_its_transpose(vertices, pelvis, R):
    return (vertices - pelvis) @ R + pelvis


# world_rotations


@check("world_rotations", points=1)
def are_right_when_one_turns(world_rotations):
    """if one joint turns, all that hangs on it turns along, and nothing else"""
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
    "this goes up one joint only: multiply with how the parent is turned in the world, not with how "
    "it is turned relative to its own parent",
)
def of_one_parent(R, parents):
    return np.array([R[0], *(R[parents[k]] @ R[k] for k in range(1, len(parents)))])


@mistake("world_rotations", "these are relative to the parent still: nothing was multiplied")
def relative(R, parents):
    return R


@mistake("world_rotations", "the parent of joint k is parents[k], not joint k - 1: chains branch")
def without_branches(R, parents):
    return solutions.world_rotations(R, list(range(-1, len(parents) - 1)))


# posed_joints


@check("posed_joints", points=1)
def keep_bones(posed_joints):
    """bones keep their lengths, the root its place, and at rest all do"""
    equal(posed_joints(REST, JOINTS, PARENTS), JOINTS, "the joints at rest")
    up = PARENTS[1:]
    posed = posed_joints(TURNS, JOINTS, PARENTS)
    equal(posed[0], JOINTS[0], "the root")
    expected = np.linalg.norm(JOINTS[1:] - JOINTS[up], axis=1)
    equal(np.linalg.norm(posed[1:] - posed[up], axis=1), expected, "the lengths of the bones, in m")


@check("posed_joints", points=2)
def are_those_of_the_chain(posed_joints):
    """they are where the chain has them"""
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
        "the same when the first one does, too",
    )
    expected = solutions.posed_joints(TURNS, JOINTS, PARENTS)
    equal(posed_joints(TURNS, JOINTS, PARENTS), expected, "the joints of a tree in a random pose")


@mistake(
    "posed_joints",
    "the bone to joint k is turned by its parent and all above, not by joint k itself: a wrist "
    "does not move when it turns",
)
def by_their_own_rotation(R, joints, parents):
    world = solutions.world_rotations(R, parents)
    posed = [joints[0]]
    for k in range(1, len(parents)):
        posed.append(posed[parents[k]] + world[k] @ (joints[k] - joints[parents[k]]))
    return np.array(posed)


@mistake(
    "posed_joints",
    "this adds the joint's place at rest where the bone to it belongs: the difference of two joints",
)
def with_places_for_bones(R, joints, parents):
    world = solutions.world_rotations(R, parents)
    posed = [joints[0]]
    for k in range(1, len(parents)):
        posed.append(posed[parents[k]] + world[parents[k]] @ joints[k])
    return np.array(posed)


@mistake(
    "posed_joints",
    "the bone has been turned by its parent relative to the grandparent; it takes the rotation in "
    "the world",
)
def by_the_parents_own(R, joints, parents):
    posed = [joints[0]]
    for k in range(1, len(parents)):
        posed.append(posed[parents[k]] + R[parents[k]] @ (joints[k] - joints[parents[k]]))
    return np.array(posed)


@mistake(
    "posed_joints",
    "the root does not stay in its place: it was put to the origin, or turned about it",
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


# binding


@check("binding", points=1)
def are_nothing_at_rest(binding):
    """in the pose at rest they leave everything where it is"""
    equal(binding(REST, JOINTS, PARENTS), np.tile(np.eye(4), (K, 1, 1)), "the matrices at rest")


@check("binding", points=1)
def take_joints_along(binding):
    """they take each joint to where the chain has it, from either of its two bones"""
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
    "the inverse is on the wrong side: first from the rest into the joint's frame, then into the "
    "posed world; what comes first stands on the right",
)
def with_the_inverse_on_the_left(R, joints, parents):
    back = np.linalg.inv(chained(np.tile(np.eye(3), (len(parents), 1, 1)), joints, parents))
    return back @ chained(R, joints, parents)


@mistake(
    "binding",
    "the joint at rest has been added and not taken away: G_k(rest)^-1 is a translation by minus "
    "the joint",
)
def with_the_rest_itself(R, joints, parents):
    rest = chained(np.tile(np.eye(3), (len(parents), 1, 1)), joints, parents)
    return chained(R, joints, parents) @ rest


@mistake(
    "binding",
    "each rotation is relative to the parent still: multiply along the chain, the parent's on the left",
)
def of_relative_rotations(R, joints, parents):
    G = np.tile(np.eye(4), (len(parents), 1, 1))
    G[:, :3, :3] = R
    G[:, :3, 3] = joints - np.einsum("kij,kj->ki", R, joints)
    return G


@mistake("binding", "they go the other way, from the posed surface to the one at rest")
def the_other_way(R, joints, parents):
    return np.linalg.inv(solutions.binding(R, joints, parents))


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
    """it stretches towards what is too far"""
    misses(reach, FAR)


@mistake("reach", "that is the arm at rest: nothing was turned")
def at_rest(bones, target):
    return np.zeros(bones.shape)


@mistake(
    "reach",
    "the arm points at the target, stretched, and overshoots a near one: it has to bend as well",
)
def pointing(bones, target):
    return solutions.stretched(bones, target / np.linalg.norm(target))


@mistake(
    "reach",
    "these are rotations in the world: each joint's is relative to the joint before, which has "
    "turned already",
)
def in_the_world(bones, target):
    pose = solutions.reach(bones, target)
    R = solutions.world_rotations(
        Rotation.from_rotvec(pose).as_matrix(), list(range(-1, len(pose) - 1))
    )
    return Rotation.from_matrix(R).as_rotvec()


@mistake("reach", "the first joint alone has turned, and the rest of the arm went along unbent")
def the_first_joint(bones, target):
    pose = np.zeros(bones.shape)
    turn, _ = Rotation.align_vectors([target / np.linalg.norm(target)], [bones.sum(axis=0)])
    pose[0] = turn.as_rotvec()
    return pose
