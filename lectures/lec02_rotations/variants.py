"""Exercises of lecture 2 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


def a_rotation(rng: np.random.Generator, angle: float) -> Array:
    """A rotation by an angle about a random axis, by Rodrigues' formula."""
    x, y, z = (axis := rng.standard_normal(3)) / np.linalg.norm(axis)
    W = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * W + (1 - np.cos(angle)) * W @ W


@variant(
    "rodrigues",
    points=3,
    minutes=20,
    draw=lambda rng: {"AXIS": rounded(rng, 0.21, 1.9, count=3, digits=3)},
    arguments=lambda rng, numbers: (rng.uniform(-3, 3),),
    edges=lambda numbers: [(0.0,), (1e-9,)],
)
def rodrigues(angle: float, *, AXIS: list[float]) -> Array:
    """The matrix of the rotation by `angle` about the line along AXIS, by Rodrigues' formula.

    AXIS gives a direction, and is not of length one. Seen from its tip, a positive angle turns against the
    clock.

    angle rad -> (3, 3)
    """
    x, y, z = np.array(AXIS) / np.linalg.norm(AXIS)
    W = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * W + (1 - np.cos(angle)) * W @ W


@mistake("rodrigues", "the axis has to be brought to length one first")
def rodrigues_of_any_length(angle, *, AXIS):
    x, y, z = AXIS
    W = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * W + (1 - np.cos(angle)) * W @ W


@mistake("rodrigues", "the last term needs 1 - cos, not cos: at angle 0 the matrix has to be I")
def rodrigues_as_misprinted(angle, *, AXIS):
    x, y, z = np.array(AXIS) / np.linalg.norm(AXIS)
    W = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * W + np.cos(angle) * W @ W


@mistake("rodrigues", "this is the transpose: it turns the other way")
def rodrigues_the_other_way(angle, *, AXIS):
    return rodrigues.solution(-angle, AXIS=AXIS)


@variant(
    "angle_between",
    points=3,
    minutes=20,
    draw=lambda rng: {"BONE": rounded(rng, 0.21, 1.9, count=3, digits=3)},
    arguments=lambda rng, numbers: (a_rotation(rng, 1.0), a_rotation(rng, 2.0)),
    edges=lambda numbers: [
        (np.eye(3), np.array([[1, -1e-7, 0], [1e-7, 1, 0], [0, 0, 1]])),
        (np.eye(3), np.eye(3)),
    ],
    within=1e-10,
)
def angle_between(A: Array, B: Array, *, BONE: list[float]) -> float:
    """The angle, in [0, pi], between a bone that is turned by A and the same one turned by B.

    At rest the bone points along BONE, which is not of length one. It may also turn about itself, which
    changes no direction and does not count. Be good to ten digits, also where A and B are 1e-7 rad apart.

    A, B (3, 3), rotations -> rad
    """
    u, v = A @ BONE / np.linalg.norm(BONE), B @ BONE / np.linalg.norm(BONE)
    return 2 * np.arctan2(np.linalg.norm(u - v), np.linalg.norm(u + v))


@mistake(
    "angle_between", "this is the angle of the whole rotation; turns about the bone do not count"
)
def angle_between_rotations(A, B, *, BONE):
    return 2 * np.arcsin(min(1.0, np.linalg.norm(A - B) / np.sqrt(8)))


@variant(
    "nearest_rotation",
    points=3,
    minutes=20,
    draw=lambda rng: {"TRUST": rounded(rng, 0.21, 4.9, count=3, digits=3)},
    arguments=lambda rng, numbers: (rng.standard_normal((3, 3)),),
)
def nearest_rotation(M: Array, *, TRUST: list[float]) -> Array:
    """The rotation R least in the sum over columns j of TRUST[j] |R_j - M_j|^2, R_j the columns.

    The columns of M were measured, some better than others. det R = +1, whatever M is.

    M (3, 3) -> (3, 3)
    """
    U, _, Vt = np.linalg.svd(M * TRUST)
    return U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt


@mistake("nearest_rotation", "the weights belong to columns, and not to rows")
def nearest_rotation_by_rows(M, *, TRUST):
    U, _, Vt = np.linalg.svd(np.array(TRUST)[:, None] * M)
    return U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt


@mistake("nearest_rotation", "this is a reflection for some M: det R has to be +1")
def nearest_rotation_or_reflection(M, *, TRUST):
    U, _, Vt = np.linalg.svd(M * TRUST)
    return U @ Vt
