"""Bones and weights at once: the steps that alternation makes too short.

Where several bones share much of a surface, as in a chest, a change of the weights pays only with a
change of the bones, and alternation creeps: thousands of turns lower the cost by a little each. A
step of Levenberg and Marquardt changes both at once. With c as all residuals of one frame, J its
derivatives by the turns and shifts of the K bones, and A those by the weights, a step solves

    [ J'J  J'A ] [ d_bones   ]     [ J'c ]
    [ A'J  A'A ] [ d_weights ] = - [ A'c ]     summed over the frames, with a damped diagonal.

Each frame has bones of its own, so that these are eliminated frame by frame: with J'J = L L' and
X = L^-1 J'A, what is left for the weights is (A'A - X'X) d_weights = - (A'c - X' L^-1 J'c), summed
over the frames. (Golub and Pereyra, Inverse Problems 19(2), 2003, tell of such eliminations.) Only
weights above zero are unknowns; the largest of each vertex is one minus the others. A turn of the
alternation after each step lets a weight leave zero, and makes all of them shares again.

A vertex that has four weights of the wrong bones holds them where they are. So each vertex first
has up to seven weights, and the largest four are kept afterwards (`refined_at_once`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from workbench.arrays import Array, Index
from workbench.geometry.rotation import matrix_from_vector
from workbench.training.first_guess import MOST_WEIGHTS
from workbench.training.rigging.bones import LIGHTEST, Bones, fit_bone_weights, fit_bones

RELAXED = 7  # weights of a vertex on the way
STEPS, FLAT = 16, 3  # at most; so many in a row that gain little are the last
DAMPING, LEAST, MOST = 1e-2, 1e-8, 10.0  # shares of the diagonal: the first, and its bounds
EASED, RAISED = 0.2, 8.0  # factors on the damping after a step that lowers the cost, or does not
GAIN = 0.005  # of the rms: a step that lowers it by a smaller share gains little
ENOUGH = 1e-9  # m, rms
FLOOR = 1e-10  # of the largest entry of a diagonal: keeps what nothing determines where it is


def one_turn(bones: Bones, rest: Array, meshes: Array, most: int = MOST_WEIGHTS) -> Bones:
    """A turn of the alternation: the weights, and then the bones."""
    return fit_bones(fit_bone_weights(bones, rest, meshes, most), rest, meshes)


def refined_at_once(bones: Bones, rest: Array, meshes: Array) -> Bones:
    """Steps with more weights than a vertex may have, and then with as many; not worse."""
    many = together(bones, rest, meshes, RELAXED)
    fewer = together(_cut(many), rest, meshes)
    if fewer.rms(rest, meshes) < bones.rms(rest, meshes):
        return fewer
    return together(bones, rest, meshes)


def _cut(bones: Bones) -> Bones:
    """The largest weights of each vertex, as many as it may have."""
    weights = bones.weights.copy()
    small = np.argsort(-weights, axis=1, kind="stable")[:, MOST_WEIGHTS:]
    np.put_along_axis(weights, small, 0.0, axis=1)
    weights /= weights.sum(axis=1, keepdims=True)
    return Bones(bones.rotations, bones.translations, weights)


def together(bones: Bones, rest: Array, meshes: Array, most: int = MOST_WEIGHTS) -> Bones:
    """Steps in bones and weights at once, `most` weights a vertex; none of them raises the cost."""
    rms, damping, flat = bones.rms(rest, meshes), DAMPING, 0
    for _ in range(STEPS):
        tried = one_turn(_step(bones, rest, meshes, damping), rest, meshes, most)
        before, after = rms, tried.rms(rest, meshes)
        if after < rms:
            bones, rms, damping = tried, after, max(EASED * damping, LEAST)
            flat = flat + 1 if rms > (1 - GAIN) * before else 0
            if rms < ENOUGH or flat == FLAT:
                break
        elif (damping := RAISED * damping) > MOST:
            break
    return bones


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """The weights that a step changes, and the middles about which it turns the bones.

    Attributes:
        first: (N,) the bone with the largest weight of each vertex.
        vertex, bone: (U,) of each unknown weight.
        middles: (K, 3) m, at rest, of what each bone carries.
    """

    first: Index
    vertex: Index
    bone: Index
    middles: Array

    @classmethod
    def of(cls, bones: Bones, rest: Array) -> "_Unknowns":
        W = bones.weights
        first, others = W.argmax(axis=1), W > 0
        others[np.arange(len(W)), first] = False
        squares = W**2
        middles = squares.T @ rest / np.maximum(squares.sum(axis=0), LIGHTEST)[:, None]
        vertex, bone = np.nonzero(others)
        return cls(first, vertex, bone, middles)


@dataclass(frozen=True, eq=False)
class _Frame:
    """The derivatives of one frame: J (3 N, 6 K) by the bones, A (U, 3) by weights, and c (N, 3).

    Row u of A is where its vertex would be by its own bone, from where the first one takes it.
    """

    J: Array
    A: Array
    c: Array

    @classmethod
    def of(
        cls, bones: Bones, unknowns: _Unknowns, rest: Array, mesh: Array, frame: int
    ) -> "_Frame":
        R, t, W = bones.rotations[frame], bones.translations[frame], bones.weights
        (N, K), (vertex, bone) = W.shape, np.nonzero(W)
        each = (R @ rest.T).transpose(2, 0, 1) + t  # (N, K, 3)
        arms = np.einsum("uab,ub->ua", R[bone], rest[vertex] - unknowns.middles[bone])
        J, w = np.zeros((N, K, 3, 6)), W[vertex, bone][:, None, None]
        J[vertex, bone, :, :3] = w * np.cross(np.eye(3), arms[:, None]).swapaxes(1, 2)
        J[vertex, bone, :, 3:] = w * np.eye(3)
        A = (
            each[unknowns.vertex, unknowns.bone]
            - each[unknowns.vertex, unknowns.first[unknowns.vertex]]
        )
        c = np.einsum("nk,nka->na", W, each) - mesh
        return cls(J.transpose(0, 2, 1, 3).reshape(3 * N, 6 * K), A, c)

    def by_bones(self, vertex: Index) -> Array:
        """J'A, (6 K, U): a weight moves its own vertex only."""
        rows = self.J.reshape(len(self.c), 3, -1)
        mixed = np.zeros((self.J.shape[1], len(vertex)))
        for a in range(3):
            mixed += rows[vertex, a].T * self.A[:, a]
        return mixed


def _step(bones: Bones, rest: Array, meshes: Array, damping: float) -> Bones:
    unknowns = _Unknowns.of(bones, rest)
    change, factors = _change_of_weights(bones, unknowns, rest, meshes, damping)
    vertex = unknowns.vertex
    R, t = bones.rotations.copy(), bones.translations.copy()
    for frame, L in enumerate(factors):
        one = _Frame.of(bones, unknowns, rest, meshes[frame], frame)
        c = one.c.copy()
        np.add.at(c, vertex, change[:, None] * one.A)
        steps = -cho_solve((L, True), one.J.T @ c.ravel()).reshape(-1, 6)
        turn = matrix_from_vector(steps[:, :3])
        middles = np.einsum("kab,kb->ka", R[frame], unknowns.middles)
        t[frame] += middles - np.einsum("kab,kb->ka", turn, middles) + steps[:, 3:]
        R[frame] = turn @ R[frame]
    weights = bones.weights.copy()
    weights[vertex, unknowns.bone] += change
    np.subtract.at(weights, (vertex, unknowns.first[vertex]), change)
    weights = weights.clip(0)
    return Bones(R, t, weights / weights.sum(axis=1, keepdims=True))


def _change_of_weights(
    bones: Bones, unknowns: _Unknowns, rest: Array, meshes: Array, damping: float
) -> tuple[Array, list[Array]]:
    """The step (U,) in the weights, and L of each frame."""
    vertex = unknowns.vertex
    normal, pull = np.zeros((len(vertex), len(vertex))), np.zeros(len(vertex))
    pairs = np.nonzero(vertex[:, None] == vertex)  # unknowns of the same vertex
    products = np.zeros(len(pairs[0]))
    factors: list[Array] = []
    for frame, mesh in enumerate(meshes):
        one = _Frame.of(bones, unknowns, rest, mesh, frame)
        H = one.J.T @ one.J
        _raise_diagonal(H, damping, H.diagonal())
        L: Array = np.asarray(np.linalg.cholesky(H), dtype=float)
        X = solve_triangular(L, one.by_bones(vertex), lower=True)
        normal -= X.T @ X
        moved = solve_triangular(L, one.J.T @ one.c.ravel(), lower=True)
        pull += np.sum(one.A * one.c[vertex], axis=1) - X.T @ moved
        products += np.sum(one.A[pairs[0]] * one.A[pairs[1]], axis=1)
        factors.append(L)
    if not len(vertex):
        return pull, factors
    normal[pairs] += products
    _raise_diagonal(normal, damping, products[pairs[0] == pairs[1]])
    return -cho_solve(cho_factor(normal, lower=True), pull), factors


def _raise_diagonal(matrix: Array, damping: float, sizes: Array) -> None:
    matrix[np.diag_indices(len(matrix))] += damping * sizes + FLOOR * sizes.max()
