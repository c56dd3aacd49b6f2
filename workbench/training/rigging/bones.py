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
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array, Index
from workbench.geometry.rotation import nearest_rotation
from workbench.training.first_guess import MOST_WEIGHTS
from workbench.training.registrations import rows_of_jobs
from workbench.training.simplex import few_shares

AT_ONCE = 64  # frames in memory at once
ALONE = 30  # rounds of bones that begin from their weights alone
LIGHTEST = 1e-9  # the sum of squared weights of a bone that is not moved


@dataclass(frozen=True, eq=False)
class Bones:
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

    def moved(self, rest: Array, some: slice = slice(None)) -> Array:
        """Where each bone alone takes the vertices rest (N, 3) m: (T, K, N, 3) m."""
        turned = np.einsum("tkab,nb->tkna", self.rotations[some], rest, optimize=True)
        return np.asarray(turned + self.translations[some, :, None])

    def errors(self, rest: Array, meshes: Array) -> Array:
        """The sum over frames of the squared distance of each vertex, (N,) in m^2."""
        found = np.zeros(len(rest))
        for some in frames(meshes):
            points = np.einsum("nk,tkna->tna", self.weights, self.moved(rest, some), optimize=True)
            found += np.sum((meshes[some] - points) ** 2, axis=(0, 2))
        return found

    def rms(self, rest: Array, meshes: Array) -> float:
        """The root mean square distance of the vertices, in metres."""
        return float(np.sqrt(self.errors(rest, meshes).mean() / len(meshes)))

    def only(self, some: Index) -> "Bones":
        """The bones of these numbers; what the others carried is shared out among them."""
        weights = self.weights[:, some]
        total = weights.sum(axis=1, keepdims=True)
        weights = np.where(total > 0, weights / np.where(total > 0, total, 1), 1 / len(some))
        return Bones(self.rotations[:, some], self.translations[:, some], weights)

    def with_bone(self, rotations: Array, translations: Array) -> "Bones":
        """One bone more, with rotations (T, 3, 3) and translations (T, 3) m; it carries nothing."""
        return Bones(
            np.concatenate([self.rotations, rotations[:, None]], axis=1),
            np.concatenate([self.translations, translations[:, None]], axis=1),
            np.concatenate([self.weights, np.zeros((len(self.weights), 1))], axis=1),
        )


def frames(meshes: Array) -> Iterator[slice]:
    """The frames of meshes (T, N, 3), a few at a time."""
    yield from rows_of_jobs(len(meshes), AT_ONCE)


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


def fit_bones(bones: Bones, rest: Array, meshes: Array, rounds: int = 3) -> Bones:
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
    return Bones(R, t, W)


def bones_of_weights(weights: Array, rest: Array, meshes: Array) -> Bones:
    """The bones that weights (N, K) alone tell, in meshes of which no bones are known yet.

    Each begins as the motion of what it carries, as if it carried that alone.
    """
    targets = meshes.swapaxes(0, 1)
    each = [rigid_motions(rest, w[:, None, None] * targets, w) for w in weights.T]
    R, t = (np.stack(part, axis=1) for part in zip(*each, strict=True))
    return fit_bones(Bones(R, t, weights), rest, meshes, ALONE)


def _share(rest: Array, weights: Array, R: Array, t: Array) -> Array:
    """w_i (R p_i + t) in each frame, (N, T, 3) m."""
    T = len(R)
    moved = (rest @ R.reshape(3 * T, 3).T).reshape(len(rest), T, 3) + t
    return np.asarray(weights[:, None, None] * moved)


def fit_bone_weights(bones: Bones, rest: Array, meshes: Array, most: int = MOST_WEIGHTS) -> Bones:
    """The weights of each vertex, the bones held, at most `most` of them above zero."""
    (N, K), T = bones.weights.shape, len(meshes)
    grams = np.zeros((N, K, K))
    for some in frames(meshes):
        each = bones.moved(rest, some).transpose(2, 1, 0, 3).reshape(N, K, -1)
        there = meshes[some].transpose(1, 0, 2).reshape(N, -1, 1)
        away = each - there.swapaxes(1, 2)  # about the vertex: the products keep their digits
        grams += away @ away.swapaxes(1, 2)
    weights, _ = few_shares(grams / T, np.zeros((N, K)), bones.weights, most)
    return replace(bones, weights=weights)
