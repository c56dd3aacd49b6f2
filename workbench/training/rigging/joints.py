"""Joints: the points that stay together in two bones, the tree of them, and what is left open.

Two bones a and b meet at a joint j, a point at rest, if both take it to the same place:

    min over j of   1/T sum_t | (R_a^t j + t_a^t) - (R_b^t j + t_b^t) |^2

which is a linear problem, A j = g with A_t = R_a^t - R_b^t. Every pair of bones is a candidate, and
the tree is the one whose gaps are smallest together: the minimum spanning tree (Kruskal 1956; that
joints of a mesh animation are found from pairs of bones is known from Schaefer and Yuksel,
Example-based skeleton extraction, 2007).

Where two bones turn about one axis only, A has no say along it: the joint may slide along the axis
of a hinge. There the joint is taken that is nearest to the middle of the surface that both move.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from workbench.arrays import Array, Index
from workbench.training.rigging.bones import RigidBones

MIDDLE_PRECISION = 1e-6  # of A'A's unit: how much the middle of the common surface counts
APART_FACTOR = 3.0  # factor on the gap of two bones that share no surface
ROUNDING = 1e-7  # m: coordinates of meshes are of single precision
LARGEST_SLIDE = 0.01  # m: a joint that errors let slide farther is not determined
CERTAIN_FACTOR = 2.0  # factor on the rms that any bones leave: a body that leaves more is doubted
LEAST_TURN = 0.05  # rad, rms: bones that turn less against each other hardly turn


@dataclass(frozen=True, eq=False)
class JointCandidate:
    """The point that stays together best in two bones.

    Attributes:
        bones: the numbers of both.
        place: (3,) in metres, at rest.
        gap: in metres, how far the bones take it apart, rms over the frames.
        parting: (3,) how far the bones take apart a point that is a metre off along each
            direction, in metres (rms), ascending. It is zero along the axis of a hinge, and across
            it about the angle in radians by which the bones turn against each other.
        directions: (3, 3) in its rows the unit vectors of these directions, at rest.

    >>> import numpy as np
    >>> parting = np.array([0.0, 0.5, 0.5])
    >>> hinge = JointCandidate((0, 1), np.zeros(3), 1e-5, parting, np.eye(3))
    >>> hinge.free.tolist()  # it may slide along its axis
    [[1.0, 0.0, 0.0]]
    """

    bones: tuple[int, int]
    place: Array
    gap: float
    parting: Array
    directions: Array

    @cached_property
    def slides(self) -> Array:
        """How far the joint may slide along each direction, (3,) m, without the gap telling."""
        return np.asarray(max(self.gap, ROUNDING) / np.maximum(self.parting, 1e-300))

    @property
    def free(self) -> Array:
        """The directions (n, 3) along which the joint is not determined to within 1 cm."""
        return np.asarray(self.directions[self.slides > LARGEST_SLIDE])


def candidate(bones: RigidBones, rest: Array, a: int, b: int) -> JointCandidate:
    """The joint of two bones of surface rest (N, 3) m."""
    T = len(bones.rotations)
    A = (bones.rotations[:, a] - bones.rotations[:, b]).reshape(-1, 3) / np.sqrt(T)
    g = (bones.translations[:, b] - bones.translations[:, a]).ravel() / np.sqrt(T)
    shared = bones.weights[:, a] * bones.weights[:, b]
    if shared.sum() <= 0:
        own = bones.weights[:, [a, b]].T
        middle = (own @ rest / np.maximum(own.sum(axis=1, keepdims=True), 1e-300)).mean(axis=0)
    else:
        middle = shared @ rest / shared.sum()
    _, parting, directions = np.linalg.svd(A, full_matrices=False)
    along = directions @ (A.T @ (g - A @ middle))
    place = middle + (along / (parting**2 + MIDDLE_PRECISION**2)) @ directions
    gap = float(np.linalg.norm(A @ place - g))
    return JointCandidate((a, b), place, gap, parting[::-1], directions[::-1])


@dataclass(frozen=True, eq=False)
class JointTree:
    """The tree of K bones.

    Attributes:
        order: (K,) the numbers of the bones, each after its parent; the root is the first.
        parents: the parent of each bone in this order, -1 for the root.
        joints: of each bone but the root with its parent, in this order.
    """

    order: Index
    parents: tuple[int, ...]
    joints: tuple[JointCandidate, ...]

    @property
    def edges(self) -> frozenset[frozenset[int]]:
        """The pairs of bones that meet in a joint, by the numbers of the bones."""
        return frozenset(frozenset(joint.bones) for joint in self.joints)


def joint_tree(bones: RigidBones, rest: Array) -> JointTree:
    """The tree whose gaps are smallest together; its root is the bone in the middle.

    Pairs that share no surface are taken only if their gap is much smaller than those of others.
    """
    K = bones.count
    candidates = {(a, b): candidate(bones, rest, a, b) for b in range(K) for a in range(b)}
    shared = bones.weights.T @ bones.weights
    gaps = np.zeros((K, K))
    for (a, b), joint in candidates.items():
        factor = 1.0 if shared[a, b] > 0 else APART_FACTOR
        gaps[a, b] = max(factor * joint.gap, 1e-300)  # a zero would be no edge
    if K == 1:
        return JointTree(np.zeros(1, dtype=np.int64), (-1,), ())
    spanning = minimum_spanning_tree(csr_array(gaps)).tocsr()
    edges = csr_array(spanning + spanning.T)
    edges.data[:] = 1.0
    root = _middle(edges, bones.weights.sum(axis=0))
    order, before = breadth_first_order(edges, root, directed=False)
    position = np.argsort(order)
    parents = (-1, *(int(position[before[k]]) for k in order[1:]))
    pairs = [tuple(sorted((int(k), int(before[k])))) for k in order[1:]]
    joints = tuple(candidates[a, b] for a, b in pairs)
    return JointTree(order.astype(np.int64), parents, joints)


def _middle(edges: csr_array, sizes: Array) -> int:
    """The bone from which all others, by their size, are the fewest bones away."""
    K = len(sizes)
    steps = np.full((K, K), np.inf)
    for k in range(K):
        order, before = breadth_first_order(edges, k, directed=False)
        steps[k, k] = 0
        for other in order[1:]:
            steps[k, other] = steps[k, before[other]] + 1
    return int((steps @ sizes).argmin())


def notes_of(
    joints: Sequence[JointCandidate], names: Sequence[str], merged: int, rms: float, least: float
) -> tuple[str, ...]:
    """What is not certain, in sentences: the whole, merged bones, each such joint, and the root.

    `rms` is what the body leaves of the meshes, and `least` what bones in joints must leave (m).
    """
    notes = []
    if rms > CERTAIN_FACTOR * least + ROUNDING:
        notes.append(
            f"the body leaves {1e3 * rms:.2g} mm of the meshes (rms), and only "
            f"{1e3 * least:.1g} mm are more than any {len(names)} bones in joints can explain: "
            "either the skin does not follow linear blend skinning, or bones and tree are not the "
            "right ones; they are not certain"
        )
    if merged:
        notes.append(
            f"{merged} {'bone' if merged == 1 else 'bones'} moved as another one did, and "
            f"{'was' if merged == 1 else 'were'} merged with it: the meshes do not tell them apart"
        )
    notes += [sentence(joint, names) for joint in joints if len(joint.free)]
    notes.append(
        f"no motion shows where the joint of {names[0]} is, because it may stand elsewhere and "
        "turn about another point: it is in the middle of the surface that it carries"
    )
    return tuple(notes)


def sentence(joint: JointCandidate, names: Sequence[str]) -> str:
    """What is not determined of a joint, in a sentence."""
    above, own = (names[k] for k in joint.bones)
    if joint.parting[-1] > LEAST_TURN and len(joint.free) > 1:
        return (
            f"{own} and {above} take their joint {1e3 * joint.gap:.1f} mm apart (rms), so that "
            "it is not known to within a centimetre"
        )
    if len(joint.free) == 1:
        return (
            f"{own} turns against {above} about one axis only: its joint may slide along "
            f"{in_words(joint.free[0])} by {_distance(joint.slides[0])}"
        )
    return (
        f"{own} hardly turns against {above} (by {np.degrees(joint.parting[-1]):.2g} degrees, "
        "rms): its joint may lie elsewhere, and the two may be one bone"
    )


def in_words(direction: Array) -> str:
    """A direction at rest, with its largest component positive: `(0.99, 0.10, 0.00)`."""
    d = direction * np.sign(direction[np.abs(direction).argmax()])
    rounded = [round(float(x), 2) + 0.0 for x in d]  # and no minus before a zero
    return f"({', '.join(f'{x:.2f}' for x in rounded)})"


def _distance(slide: float) -> str:
    return "any distance" if slide > 1 else f"{100 * slide:.0f} cm"
