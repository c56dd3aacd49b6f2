"""Exercises of lecture 3 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


def rotations(rng: np.random.Generator, count: int) -> Array:
    """Random rotations (count, 3, 3)."""
    Q = np.linalg.qr(rng.standard_normal((count, 3, 3)))[0]
    return Q * np.linalg.det(Q)[:, None, None]


def a_tree(rng: np.random.Generator, count: int) -> list[int]:
    return [-1, *(int(rng.integers(max(0, k - 3), k)) for k in range(1, count))]


@variant(
    "turned_body",
    points=2,
    minutes=12,
    draw=lambda rng: {
        "HIP": rounded(rng, -0.45, 0.45, count=3, digits=3),
        "STEP": rounded(rng, 0.11, 0.9, count=3, digits=3),
    },
    arguments=lambda rng, numbers: (rng.uniform(-1, 1, (5, 3)), rotations(rng, 1)[0]),
)
def turned_body(vertices: Array, R: Array, *, HIP: list[float], STEP: list[float]) -> Array:
    """The surface after the body has turned about its left hip, and has then moved by STEP.

    The hip is at HIP before. The step is in the directions of the world, and not of the turned body.

    vertices (N, 3) m; R (3, 3) -> (N, 3) m
    """
    return (vertices - HIP) @ R.T + HIP + STEP


@mistake("turned_body", "the step is made after the turn, and is not turned")
def turned_body_with_turned_step(vertices, R, *, HIP, STEP):
    return (vertices + STEP - HIP) @ R.T + HIP


@variant(
    "world_rotations",
    points=2,
    minutes=15,
    draw=lambda rng: {
        "PARENTS": a_tree(rng, 8),
        "ROOT_DEGREES": rounded(rng, 21.0, 170.0, digits=1),
    },
    arguments=lambda rng, numbers: (rotations(rng, 8),),
)
def world_rotations(R: Array, *, PARENTS: list[int], ROOT_DEGREES: float) -> Array:
    """The rotation of each joint in a camera's frame, from the rotations relative to the parents.

    The tree is PARENTS (8,), -1 for the root. The camera is turned against the world: what has the rotation
    W in the world has C W in its frame, where C turns by ROOT_DEGREES about y.

    R (8, 3, 3) -> (8, 3, 3)
    """
    a = np.radians(ROOT_DEGREES)
    C = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    world = [C @ R[0]]
    for k in range(1, 8):
        world.append(world[PARENTS[k]] @ R[k])
    return np.array(world)


@mistake("world_rotations", "C stands on the left: it acts last")
def world_rotations_in_the_body(R, *, PARENTS, ROOT_DEGREES):
    world = world_rotations.solution(R, PARENTS=PARENTS, ROOT_DEGREES=0.0)
    return (
        world
        @ world_rotations.solution(
            np.tile(np.eye(3), (8, 1, 1)), PARENTS=PARENTS, ROOT_DEGREES=ROOT_DEGREES
        )[0]
    )


@variant(
    "posed_joints",
    points=3,
    minutes=20,
    draw=lambda rng: {"TREE": a_tree(rng, 7), "GROWTH": rounded(rng, 0.71, 1.4, count=7, digits=3)},
    arguments=lambda rng, numbers: (rotations(rng, 7), rng.uniform(-1, 1, (7, 3))),
)
def posed_joints(R: Array, joints: Array, *, TREE: list[int], GROWTH: list[float]) -> Array:
    """Where the joints of another person are, after all of them have turned; the root stays.

    The tree is TREE (7,), -1 for the root. The bone from its parent to joint k is GROWTH[k] times as long as
    that of the person whose joints are given; GROWTH[0] belongs to no bone.

    R (7, 3, 3), relative to the parent; joints (7, 3) m, at rest -> (7, 3) m
    """
    world, posed = [R[0]], [joints[0]]
    for k in range(1, 7):
        up = TREE[k]
        world.append(world[up] @ R[k])
        posed.append(posed[up] + GROWTH[k] * world[up] @ (joints[k] - joints[up]))
    return np.array(posed)


@mistake(
    "posed_joints", "a bone turns with its parent's rotation, and not with the one at its own end"
)
def posed_joints_by_their_own(R, joints, *, TREE, GROWTH):
    world, posed = [R[0]], [joints[0]]
    for k in range(1, 7):
        world.append(world[TREE[k]] @ R[k])
        posed.append(posed[TREE[k]] + GROWTH[k] * world[k] @ (joints[k] - joints[TREE[k]]))
    return np.array(posed)
