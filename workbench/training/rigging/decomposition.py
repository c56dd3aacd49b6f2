"""How many bones, and where they begin: clusters that move rigidly, and then bone after bone.

Alternation only improves bones that are roughly right. The first ones are clusters of vertices
that move as a rigid body would (Lloyd's algorithm, with a rigid motion for the mean). A bone that
carries no vertex alone, as a collar, is in no cluster. So each further bone begins where the error
is largest, as the motion of a patch of vertices there, and alternation gives it its share.

Alternation ends early where bones share much of a surface, or where one stands for two others. So
bones and weights are then changed at once (see `joint_steps`), and bones are exchanged one by one:
one is made where the error is largest, and the one is given up that others can best stand for.
"""

from math import ceil, inf

import numpy as np
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index
from workbench.errors import BadArgument
from workbench.training.rigging.bones import (
    RigidBones,
    alternate_once,
    frames,
    refined_at_once,
    rigid_motions,
)
from workbench.training.rigging.steps import RigSteps

PATCH_SIZE = 8  # vertices whose motion a new bone begins with
FEWEST_IN_CLUSTER = 3  # vertices of a cluster: two do not determine a rotation
TURNS = 4  # of Lloyd's algorithm, and of the alternation, between two new bones
DIVIDED = 0.5  # of the largest error: clusters that have more are divided at once
CLIFF = 1e-13  # of the largest eigenvalue: smaller ones are rounding
STEEPEST_NOISE = 100.0  # a ratio of neighbouring eigenvalues that no noise has
ONE_SPARE_IN = 5  # one bone in so many is made in addition, and given up again
CYCLES, SWAPS = 5, 6  # of making and giving up bones, and exchanges of a bone, at most
STALLED = 0.9  # times the rms before: a cycle or an exchange that ends above it is the last
ABOVE_LEAST = 2.0  # times the least rms that bones can leave: below, nothing is gained
ROUNDING_RMS = 1e-8  # m, of meshes in use
LEAST_SPREAD = 0.85  # of noise: its sigma by the median over that by the sum; motion has less
MOST_BONES = 64  # bones that are looked for without being asked for


def bones_needed(meshes: Array, tolerance: float) -> int:
    """The least number of bones that can explain meshes (T, N, 3) m to within a tolerance (m, rms).

    All coordinates of all frames, written below each other, are a matrix of 3 T rows and a column
    for each vertex. Its columns are combinations of the 3 K columns of the bones' rotations, and
    of one for the place of the root, if the bones hang together in joints. So its rank is at most
    3 K + 1. A joint that turns about one axis alone lowers the rank by one, so that the number
    found is a lower bound. Of meshes without noise the rank is exact: singular values end in a
    cliff, down to rounding. Raises BadArgument if the number is above 64.
    """
    sizes = _squares(meshes)
    rank = int(np.count_nonzero(np.sqrt(np.cumsum(sizes)) > tolerance))
    above = int(np.count_nonzero(sizes > CLIFF * sizes[-1]))
    if above < len(sizes) and sizes[-above] > STEEPEST_NOISE * sizes[-above - 1]:
        rank = max(rank, above)
    count = max(1, ceil((rank - 1) / 3))
    if count > MOST_BONES:
        raise BadArgument(
            f"the meshes need {count} bones or more to be explained to within {1e3 * tolerance:g} "
            f"mm, and at most {MOST_BONES} are looked for; say how many there are to be, or allow "
            "a larger error"
        )
    return count


def noise_of(meshes: Array) -> float | None:
    """The standard deviation in m of independent noise on the coordinates of meshes (T, N, 3) m.

    Of the singular values of the matrix in `bones_needed`, those of the motion stand out from those
    of noise, which are spread as Marchenko and Pastur found; the threshold that separates them is a
    multiple of their median (Gavish and Donoho, IEEE Trans. IT 60(8), 2014). None if the others are
    not spread as those of noise: then the meshes are too few, or have hardly any noise.
    """
    sizes = _squares(meshes) * meshes.shape[0] * meshes.shape[1]
    k, m = sorted((3 * meshes.shape[0], meshes.shape[1]))
    b = k / m
    factor = 2 * (b + 1) + 8 * b / (b + 1 + np.sqrt(b**2 + 14 * b + 1))
    rank = int(np.count_nonzero(sizes > factor * np.median(sizes) / _median_of_noise(b)))
    k, m, others = k - rank, m - rank, sizes[: k - rank]
    from_sum = others.sum() / (k * m)
    from_median = np.median(others) / (m * _median_of_noise(k / m))
    return float(np.sqrt(from_sum)) if from_median > LEAST_SPREAD**2 * from_sum else None


def _median_of_noise(b: float) -> float:
    """The median of Marchenko and Pastur's law: of the eigenvalues of X X'/m, for X (k, m) of
    independent standard normal numbers and b = k/m up to 1.
    """
    angles = (np.arange(1000) + 0.5) * np.pi / 1000
    eigenvalues = 1 + b - 2 * np.sqrt(b) * np.cos(angles)
    below = np.cumsum(np.sin(angles) ** 2 / eigenvalues)
    return float(np.interp(below[-1] / 2, below, eigenvalues))


def least_rms(meshes: Array, count: int) -> float:
    """The rms in m below which no `count` bones that hang together in joints explain meshes.

    Of the matrix in `bones_needed`, they explain at most 3 K + 1 singular values; what the others
    hold is left (Eckart and Young, Psychometrika 1(3), 1936). Eigenvalues of a product round at
    1e-8 of the meshes' size.
    """
    return float(np.sqrt(_squares(meshes)[: -(3 * count + 1)].sum()))


def _squares(meshes: Array) -> Array:
    """The squares of the singular values of that matrix, ascending, over the number of vertices."""
    T, N = meshes.shape[:2]
    rows = meshes.transpose(0, 2, 1).reshape(3 * T, N)
    gram = rows.T @ rows if N < 3 * T else rows @ rows.T
    return np.asarray(np.linalg.eigvalsh(gram).clip(0) / (T * N))


def rigid_clusters(rest: Array, meshes: Array, count: int) -> RigidBones:
    """At most `count` bones, each of which carries the vertices that it moves best, alone."""
    near = patches(rest)
    motions = [rigid_motions(rest, meshes.swapaxes(0, 1), np.ones(len(rest)))]
    own, errors = _lloyd(rest, meshes, motions)
    while len(motions) < count:
        before = len(motions)
        total = np.bincount(own, weights=errors, minlength=before)
        for c in np.argsort(-total)[: count - before]:
            if total[c] >= DIVIDED * total.max() and total[c] > 0:
                members = np.flatnonzero(own == c)
                motions.append(_patch_motion(rest, meshes, near[members[errors[members].argmax()]]))
        own, errors = _lloyd(rest, meshes, motions)
        if len(motions) <= before:
            break
    R, t = (np.stack(part, axis=1) for part in zip(*motions, strict=True))
    return RigidBones(R, t, np.eye(len(motions))[own])


def alternated(bones: RigidBones, rest: Array, meshes: Array) -> RigidBones:
    """A few turns of the alternation."""
    for _ in range(TURNS):
        bones = alternate_once(bones, rest, meshes)
    return bones


def decompose(rest: Array, meshes: Array, count: int, steps: RigSteps) -> RigidBones:
    """`count` bones: from clusters, more than there are to be, and then fewer, as long as it helps.

    A new bone may begin where the error only comes from another bone that is not right yet. So a
    few more bones are made, and those are given up that others can best stand for.
    """
    bones = alternated(rigid_clusters(rest, meshes, count), rest, meshes)
    spare = max(1, count // ONE_SPARE_IN)
    best, lowest = bones, inf
    for cycle in range(CYCLES):
        while bones.count < count + spare:
            bones = alternated(with_worst(bones, rest, meshes), rest, meshes)
            steps.report(f"bones, turn {cycle + 1}", min(bones.count, count), count)
        while bones.count > count:
            bones = alternated(without_least(bones, rest), rest, meshes)
        before, rms = lowest, bones.rms(rest, meshes)
        if rms < lowest:
            best, lowest = bones, rms
        if rms > STALLED * before:
            break
    steps.report("bones and weights at once", 0, 1)
    return exchanged(best, rest, meshes, steps)


def one_more(bones: RigidBones, rest: Array, meshes: Array, steps: RigSteps) -> RigidBones:
    """A bone more than these, and all of them improved."""
    more = alternated(with_worst(bones, rest, meshes), rest, meshes)
    return exchanged(more, rest, meshes, steps)


def exchanged(bones: RigidBones, rest: Array, meshes: Array, steps: RigSteps) -> RigidBones:
    """As many bones, refined, one of which begins anew where the error is largest, again and again.

    Nothing is gained below twice the least rms, which is noise or rounding of the meshes.
    """
    enough = max(ABOVE_LEAST * least_rms(meshes, bones.count), ROUNDING_RMS)

    def refined(start: RigidBones) -> RigidBones:
        return refined_at_once(start, rest, meshes, enough)

    bones = steps(bones, refined)
    lowest = bones.rms(rest, meshes)
    for swap in range(SWAPS):
        if lowest <= enough:
            break
        steps.report("bones exchanged", swap + 1, SWAPS)
        more = alternated(with_worst(bones, rest, meshes), rest, meshes)
        more = steps(more, refined)
        tried = steps(alternated(without_least(more, rest), rest, meshes), refined)
        before, rms = lowest, tried.rms(rest, meshes)
        if rms < lowest:
            bones, lowest = tried, rms
        if rms > STALLED * before:
            break
    return bones


def with_worst(bones: RigidBones, rest: Array, meshes: Array) -> RigidBones:
    """One bone more, which begins as the motion of the patch with the largest error."""
    near, errors = patches(rest), bones.errors(rest, meshes)
    return bones.with_bone(*_patch_motion(rest, meshes, near[errors[near].sum(axis=1).argmax()]))


def without_least(bones: RigidBones, rest: Array) -> RigidBones:
    """The bones without the one whose surface another one moves most nearly alike."""
    sizes = (bones.weights**2).sum(axis=0)
    costs = differences(bones, rest) ** 2 * sizes[:, None]
    np.fill_diagonal(costs, np.inf)
    a, b = np.unravel_index(int(costs.argmin()), costs.shape)
    return _given_over(bones, int(a), int(b))


def _given_over(bones: RigidBones, a: int, b: int) -> RigidBones:
    """The bones without bone a, whose weights are added to those of bone b."""
    weights = bones.weights.copy()
    weights[:, b] += weights[:, a]
    kept = np.flatnonzero(np.arange(bones.count) != a)
    return RigidBones(bones.rotations, bones.translations, weights).only(kept)


def merged_where_alike(bones: RigidBones, rest: Array, tolerance: float) -> RigidBones:
    """The bones without those that another could stand for.

    Two bones move alike if the vertices of the one, moved by the other, are nowhere farther off
    than `tolerance` (m, rms over frames and weights). Nothing in the meshes tells them apart.
    """
    while bones.count > 1:
        apart = differences(bones, rest)
        np.fill_diagonal(apart, np.inf)
        a, b = np.unravel_index(int(apart.argmin()), apart.shape)
        if apart[a, b] > tolerance:
            return bones
        bones = _given_over(bones, int(a), int(b))
    return bones


def differences(bones: RigidBones, rest: Array) -> Array:
    """How far the surface of bone a would be if bone b moved it, (K, K) in m, rms."""
    K, T = bones.count, len(bones.rotations)
    squares = np.zeros((K, K))
    shares = bones.weights**2
    shares = shares / np.maximum(shares.sum(axis=0), 1e-300)
    for some in frames(bones.rotations):
        moved = bones.moved(rest, some)
        for a in range(K):
            own = np.flatnonzero(shares[:, a])
            gap = ((moved[:, :, own] - moved[:, [a]][:, :, own]) ** 2).sum(axis=(0, 3))
            squares[a] += gap @ shares[own, a]
    return np.sqrt(squares / T)


def patches(rest: Array) -> Index:
    """The numbers of each vertex and of those nearest to it at rest, (N, 8) or fewer."""
    _, near = cKDTree(rest).query(rest, min(PATCH_SIZE, len(rest)))
    return np.asarray(near, dtype=np.int64)


def _patch_motion(rest: Array, meshes: Array, patch: Index) -> tuple[Array, Array]:
    return rigid_motions(rest[patch], meshes[:, patch].swapaxes(0, 1), np.ones(len(patch)))


def _lloyd(rest: Array, meshes: Array, motions: list[tuple[Array, Array]]) -> tuple[Index, Array]:
    """Changes the motions; the cluster (N,) of each vertex, and its squared error (N,)."""
    for _ in range(TURNS):
        own = _errors(rest, meshes, motions).argmin(axis=1)
        large = np.flatnonzero(np.bincount(own, minlength=len(motions)) >= FEWEST_IN_CLUSTER)
        if len(large) < len(motions):
            motions[:] = [motions[c] for c in large]
            own = _errors(rest, meshes, motions).argmin(axis=1)
        for c in np.unique(own):
            motions[c] = _patch_motion(rest, meshes, np.flatnonzero(own == c))
    errors = _errors(rest, meshes, motions)
    return errors.argmin(axis=1), errors.min(axis=1)


def _errors(rest: Array, meshes: Array, motions: list[tuple[Array, Array]]) -> Array:
    """The squared error of each vertex with each motion, summed over frames, (N, K) in m^2."""
    return np.stack(
        [
            ((meshes - (rest @ R.swapaxes(1, 2) + t[:, None])) ** 2).sum(axis=(0, 2))
            for R, t in motions
        ],
        axis=1,
    )
