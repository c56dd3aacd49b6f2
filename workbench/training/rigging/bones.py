"""Smooth skinning decomposition with rigid bones: meshes in motion as K bones and their weights.

A vertex at rest, p_i, is moved in frame t by K rigid bones, each of which counts by its weight:

    min  sum_t sum_i | v_i^t - sum_k w_ik (R_k^t p_i + t_k^t) |^2
    over rotations R, translations t, and weights w >= 0 with sum_k w_ik = 1, at most four above 0

It is solved by turns, and no turn raises the cost (Le and Deng, Smooth skinning decomposition with
rigid bones, ACM Transactions on Graphics 31(6), 2012):

weights  with the bones held, the weights of each vertex are a small problem of least squares;
bones    with the weights held, one bone after another is what the others leave to be explained.
         Frame by frame, q_i = v_i - sum over l != k of w_il (R_l p_i + t_l) should be
         w_ik (R_k p_i + t_k). The best translation takes p* = sum w^2 p / sum w^2 to
         q* = sum w q / sum w^2, and the best rotation is the one nearest to
         M = sum_i w_ik q_i (p_i - p*)'.

Where several bones share much of a surface, as in a chest, a change of the weights pays only with a
change of the bones, and alternation creeps. A Levenberg-Marquardt step (`joint_steps`) changes both
at once. With c as all residuals of one frame, J its derivatives by the turns and shifts of the K
bones, and A those by the weights, it solves

    [ J'J  J'A ] [ d_bones   ]     [ J'c ]
    [ A'J  A'A ] [ d_weights ] = - [ A'c ]     summed over the frames, with a damped diagonal.

Bones are eliminated frame by frame (Golub and Pereyra, Inverse Problems 19(2), 2003): with J'J =
L L' and X = L^-1 J'A, what is left is (A'A - X'X) d_weights = - (A'c - X' L^-1 J'c), summed over
the frames. Only weights above zero are unknowns; the largest of each vertex is one minus the
others. A turn of the alternation after each step lets a weight leave zero.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from workbench.arrays import Array, Index
from workbench.geometry.rotation import matrix_from_vector, nearest_rotation
from workbench.training.registrations import rows_of_jobs
from workbench.training.shares import MOST_WEIGHTS, few_shares

FRAMES_AT_ONCE = 64  # frames in memory at once
FRAMES_STACKED = 16  # frames whose products by weights are one matrix
ROUNDS_ALONE = 30  # rounds of bones that begin from their weights alone
LIGHTEST = 1e-9  # the sum of squared weights of a bone that is not moved
RELAXED_WEIGHTS = 5  # of a vertex, on the way
MOST_STEPS, MOST_FLAT = 16, 3  # at most; so many in a row that gain little are the last
DAMPING = 1e-2  # of the diagonal, at first
LEAST_DAMPING, MOST_DAMPING = 1e-8, 10.0  # its bounds
EASED, RAISED = 0.2, 8.0  # factors on the damping after a step that lowers the cost, or does not
LITTLE_GAIN = 0.02  # of the rms: a step that lowers it by a smaller share gains little
ENOUGH_RMS = 1e-9  # m, rms
DIAGONAL_FLOOR = 1e-10  # of its largest entry: keeps what nothing determines where it is


@dataclass(frozen=True, eq=False)
class RigidBones:
    """K rigid bones in T frames, and the weights by which N vertices follow them.

    Attributes:
        rotations: (T, K, 3, 3).
        translations: (T, K, 3) in metres.
        weights: (N, K); rows sum to one.
    """

    rotations: Array
    translations: Array
    weights: Array

    @property
    def count(self) -> int:
        """K, the number of bones."""
        return int(self.weights.shape[1])

    def arrays(self) -> dict[str, Array]:
        """The arrays by name."""
        return {name: getattr(self, name) for name in ("rotations", "translations", "weights")}

    def moved(self, rest: Array, some: slice = slice(None)) -> Array:
        """Where each bone alone takes the vertices rest (N, 3) m: (T, K, N, 3) m."""
        turned = np.einsum("tkab,nb->tkna", self.rotations[some], rest, optimize=True)
        return np.asarray(turned + self.translations[some, :, None])

    def errors(self, rest: Array, meshes: Array) -> Array:
        """The sum over frames of the squared distance of each vertex, (N,) in m^2."""
        squares = np.zeros(len(rest))
        for some in frames(meshes):
            points = np.einsum("nk,tkna->tna", self.weights, self.moved(rest, some), optimize=True)
            squares += np.sum((meshes[some] - points) ** 2, axis=(0, 2))
        return squares

    def rms(self, rest: Array, meshes: Array) -> float:
        """The root mean square distance of the vertices, in metres."""
        return float(np.sqrt(self.errors(rest, meshes).mean() / len(meshes)))

    def only(self, some: Index) -> "RigidBones":
        """The bones of these numbers; what the others carried is shared out among them."""
        weights = self.weights[:, some]
        total = weights.sum(axis=1, keepdims=True)
        weights = np.where(total > 0, weights / np.where(total > 0, total, 1), 1 / len(some))
        return RigidBones(self.rotations[:, some], self.translations[:, some], weights)

    def with_bone(self, rotations: Array, translations: Array) -> "RigidBones":
        """One bone more, with rotations (T, 3, 3) and translations (T, 3) m; it carries nothing."""
        return RigidBones(
            np.concatenate([self.rotations, rotations[:, None]], axis=1),
            np.concatenate([self.translations, translations[:, None]], axis=1),
            np.concatenate([self.weights, np.zeros((len(self.weights), 1))], axis=1),
        )


def frames(meshes: Array) -> Iterator[slice]:
    """The frames of meshes (T, N, 3), a few at a time."""
    yield from rows_of_jobs(len(meshes), FRAMES_AT_ONCE)


def rigid_motions(rest: Array, targets: Array, weights: Array) -> tuple[Array, Array]:
    """R (T, 3, 3) and t (T, 3) m that make sum_i |w_i (R p_i + t) - q_i|^2 least in each frame.

    `rest` p (N, 3) m, `targets` q (N, T, 3) m, `weights` w (N,) of which some are above zero.
    """
    N, T, _ = targets.shape
    total, flat = float(weights @ weights), targets.reshape(N, 3 * T)
    middle = weights**2 @ rest / total
    ends = (weights @ flat).reshape(T, 3) / total
    arms = weights[:, None] * (rest - middle)
    R = nearest_rotation((flat.T @ arms).reshape(T, 3, 3))
    return R, ends - R @ middle


def fit_bones(bones: RigidBones, rest: Array, meshes: Array, rounds: int = 3) -> RigidBones:
    """Each bone in turn, the weights held, a number of times."""
    R, t, W = bones.rotations.copy(), bones.translations.copy(), bones.weights
    carried = [np.flatnonzero(column) for column in W.T]
    for some in frames(meshes):
        missing = np.array(meshes[some].transpose(1, 0, 2), order="C")  # (N, c, 3), a copy
        shares = []
        for k, own in enumerate(carried):
            shares.append(_share(rest[own], W[own, k], R[some, k], t[some, k]))
            missing[own] -= shares[k]
        for _ in range(rounds):
            for k, own in enumerate(carried):
                w = W[own, k]
                if w @ w < LIGHTEST:
                    continue
                left = missing[own] + shares[k]
                R[some, k], t[some, k] = rigid_motions(rest[own], left, w)
                shares[k] = _share(rest[own], w, R[some, k], t[some, k])
                missing[own] = left - shares[k]
    return RigidBones(R, t, W)


def bones_of_weights(weights: Array, rest: Array, meshes: Array) -> RigidBones:
    """The bones that weights (N, K) alone tell, in meshes of which no bones are known yet.

    Each begins as the motion of what it carries, as if it carried that alone.
    """
    targets = meshes.swapaxes(0, 1)
    each = [rigid_motions(rest, w[:, None, None] * targets, w) for w in weights.T]
    R, t = (np.stack(part, axis=1) for part in zip(*each, strict=True))
    return fit_bones(RigidBones(R, t, weights), rest, meshes, ROUNDS_ALONE)


def _share(rest: Array, weights: Array, R: Array, t: Array) -> Array:
    """w_i (R p_i + t) in each frame, (N, T, 3) m."""
    T = len(R)
    moved = (rest @ R.reshape(3 * T, 3).T).reshape(len(rest), T, 3) + t
    return np.asarray(weights[:, None, None] * moved)


def fit_bone_weights(
    bones: RigidBones, rest: Array, meshes: Array, most: int = MOST_WEIGHTS
) -> RigidBones:
    """The weights of each vertex, the bones held, at most `most` of them above zero."""
    (N, K), T = bones.weights.shape, len(meshes)
    grams = np.zeros((N, K, K))
    for some in frames(meshes):
        moved = bones.moved(rest, some).transpose(2, 1, 0, 3).reshape(N, K, -1)
        targets = meshes[some].transpose(1, 0, 2).reshape(N, -1, 1)
        offsets = moved - targets.swapaxes(1, 2)  # about the vertex: the products keep their digits
        grams += offsets @ offsets.swapaxes(1, 2)
    weights, _ = few_shares(grams / T, np.zeros((N, K)), bones.weights, most)
    return replace(bones, weights=weights)


def alternate_once(
    bones: RigidBones, rest: Array, meshes: Array, most: int = MOST_WEIGHTS
) -> RigidBones:
    """A turn of the alternation: the weights, and then the bones."""
    return fit_bones(fit_bone_weights(bones, rest, meshes, most), rest, meshes)


def refined_at_once(
    bones: RigidBones, rest: Array, meshes: Array, enough: float = ENOUGH_RMS
) -> RigidBones:
    """Steps with more weights than a vertex may have, and then with as many; not worse.

    A vertex that has four weights of the wrong bones would hold them where they are. An rms of
    `enough` (m) is not lowered further.
    """
    many = joint_steps(bones, rest, meshes, RELAXED_WEIGHTS, enough)
    fewer = joint_steps(_cut(many), rest, meshes, enough=enough)
    if fewer.rms(rest, meshes) < bones.rms(rest, meshes):
        return fewer
    return joint_steps(bones, rest, meshes, enough=enough)


def _cut(bones: RigidBones) -> RigidBones:
    """The largest weights of each vertex, as many as it may have."""
    weights = bones.weights.copy()
    small = np.argsort(-weights, axis=1, kind="stable")[:, MOST_WEIGHTS:]
    np.put_along_axis(weights, small, 0.0, axis=1)
    weights /= weights.sum(axis=1, keepdims=True)
    return RigidBones(bones.rotations, bones.translations, weights)


def joint_steps(
    bones: RigidBones,
    rest: Array,
    meshes: Array,
    most: int = MOST_WEIGHTS,
    enough: float = ENOUGH_RMS,
) -> RigidBones:
    """Steps in bones and weights at once, `most` weights a vertex; none of them raises the cost."""
    rms, damping, flat = bones.rms(rest, meshes), DAMPING, 0
    for _ in range(MOST_STEPS):
        tried = alternate_once(_step(bones, rest, meshes, damping), rest, meshes, most)
        before, after = rms, tried.rms(rest, meshes)
        if after < rms:
            bones, rms, damping = tried, after, max(EASED * damping, LEAST_DAMPING)
            flat = flat + 1 if rms > (1 - LITTLE_GAIN) * before else 0
            if rms < enough or flat == MOST_FLAT:
                break
        elif (damping := RAISED * damping) > MOST_DAMPING:
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
    def of(cls, bones: RigidBones, rest: Array) -> "_Unknowns":
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
        cls, bones: RigidBones, unknowns: _Unknowns, rest: Array, mesh: Array, frame: int
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


def _step(bones: RigidBones, rest: Array, meshes: Array, damping: float) -> RigidBones:
    unknowns = _Unknowns.of(bones, rest)
    weight_change, factors = _change_of_weights(bones, unknowns, rest, meshes, damping)
    vertex = unknowns.vertex
    R, t = bones.rotations.copy(), bones.translations.copy()
    for frame, L in enumerate(factors):
        linear = _Frame.of(bones, unknowns, rest, meshes[frame], frame)
        c = linear.c.copy()
        np.add.at(c, vertex, weight_change[:, None] * linear.A)
        steps = -cho_solve((L, True), linear.J.T @ c.ravel()).reshape(-1, 6)
        turn = matrix_from_vector(steps[:, :3])
        middles = np.einsum("kab,kb->ka", R[frame], unknowns.middles)
        t[frame] += middles - np.einsum("kab,kb->ka", turn, middles) + steps[:, 3:]
        R[frame] = turn @ R[frame]
    weights = bones.weights.copy()
    weights[vertex, unknowns.bone] += weight_change
    np.subtract.at(weights, (vertex, unknowns.first[vertex]), weight_change)
    weights = weights.clip(0)
    return RigidBones(R, t, weights / weights.sum(axis=1, keepdims=True))


def _change_of_weights(
    bones: RigidBones, unknowns: _Unknowns, rest: Array, meshes: Array, damping: float
) -> tuple[Array, list[Array]]:
    """The step (U,) in the weights, and L of each frame."""
    vertex = unknowns.vertex
    normal, pull = np.zeros((len(vertex), len(vertex))), np.zeros(len(vertex))
    pairs = np.nonzero(vertex[:, None] == vertex)  # unknowns of the same vertex
    products = np.zeros(len(pairs[0]))
    factors: list[Array] = []
    for some in rows_of_jobs(len(meshes), FRAMES_STACKED):
        stacked = []  # one product of many rows is several times faster than one for each frame
        for frame in range(some.start, some.stop):
            linear = _Frame.of(bones, unknowns, rest, meshes[frame], frame)
            H = linear.J.T @ linear.J
            _raise_diagonal(H, damping, H.diagonal())
            L: Array = np.asarray(np.linalg.cholesky(H), dtype=float)
            stacked.append(solve_triangular(L, linear.by_bones(vertex), lower=True))
            moved = solve_triangular(L, linear.J.T @ linear.c.ravel(), lower=True)
            pull += np.sum(linear.A * linear.c[vertex], axis=1) - stacked[-1].T @ moved
            products += np.sum(linear.A[pairs[0]] * linear.A[pairs[1]], axis=1)
            factors.append(L)
        X = np.concatenate(stacked)
        normal -= X.T @ X
    if not len(vertex):
        return pull, factors
    normal[pairs] += products
    _raise_diagonal(normal, damping, products[pairs[0] == pairs[1]])
    return -cho_solve(cho_factor(normal, lower=True), pull), factors


def _raise_diagonal(matrix: Array, damping: float, sizes: Array) -> None:
    matrix[np.diag_indices(len(matrix))] += damping * sizes + DIAGONAL_FLOOR * sizes.max()
