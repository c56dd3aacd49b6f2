"""What poses people take: eight Gaussians over the joints below the pelvis, learned from mocap.

Run as `python -m workbench.training.pose_mixture MOCAP.npz --out workbench/data/poses`, the file
being the one that `pose_prior` reads. One Gaussian of walking, sitting and jumping together also
draws what lies between them, which nobody does; a mixture draws each by itself (SMPLify's prior
has eight as well).
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.special import logsumexp

from workbench.errors import BadFile
from workbench.reading.archive import open_arrays
from workbench.reading.damage import taken_for
from workbench.reading.expected import read_expected, reals, texts, wholes
from workbench.training.pose_prior import LEAST_STD, UNMEASURED_STD, Mocap, read_mocap
from workbench.writing import replacing

Array = NDArray[np.float64]

FILE_NAME = "cmu_mixture.npz"
EXPECTED = {
    "shares": reals("C"),
    "means": reals("C", "D"),
    "covariances": reals("C", "lower half"),
    "joint_names": texts("K"),
    "n_frames": wholes(),
    "held_out_clips": texts("clips"),
}
COMPONENTS = 8
CLUSTER_ROUNDS = 30  # of k-means, to begin with
ROUNDS, ENOUGH = 200, 1e-5  # of expectation and maximisation; gain per frame that ends them
SHRUNK = 0.02  # towards the covariance of all frames: a component may see few of them


@dataclass(frozen=True, eq=False)
class PoseMixture:
    """pose[3:] ~ sum_c shares_c N(means_c, covariances_c) in rad; the pelvis is left out."""

    shares: Array  # (C,), summing to one
    means: Array  # (C, D)
    covariances: Array  # (C, D, D)
    joint_names: tuple[str, ...]  # D / 3
    n_frames: int
    held_out: tuple[str, ...]  # clips that it was not learned from

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Poses (n, K, 3) rad, the pelvis unturned."""
        component = rng.choice(len(self.shares), size=n, p=self.shares)
        noise = rng.standard_normal((n, self.means.shape[1]))
        factors = np.linalg.cholesky(self.covariances)
        pose = self.means[component] + np.einsum("nde,ne->nd", factors[component], noise)
        return np.concatenate([np.zeros((n, 1, 3)), pose.reshape(n, -1, 3)], axis=1)

    def log_density(self, flat: Array) -> Array:
        """Of each component at poses (n, D), shares included: (n, C)."""
        found = np.empty((len(flat), len(self.shares)))
        for c, (mean, covariance) in enumerate(zip(self.means, self.covariances, strict=True)):
            L = scipy.linalg.cholesky(covariance, lower=True)
            white = scipy.linalg.solve_triangular(L, (flat - mean).T, lower=True)
            scale = np.log(np.diag(L)).sum() + 0.5 * len(L) * np.log(2 * np.pi)
            found[:, c] = np.log(self.shares[c]) - 0.5 * (white**2).sum(axis=0) - scale
        return found


def learn_pose_mixture(mocap: Mocap, components: int = COMPONENTS, seed: int = 0) -> PoseMixture:
    """By expectation and maximisation over the frames and their mirror images.

    Joints that the recording does not move get a spread of their own, as in `pose_prior`.
    """
    flat, still = mocap.both_ways()
    unmeasured = np.repeat(UNMEASURED_STD**2 * still, 3)
    least = LEAST_STD**2 * np.eye(flat.shape[1]) + np.diag(unmeasured)
    rng = np.random.default_rng(seed)
    whole = np.cov(flat.T) + least
    owned = _clusters(flat, _spread_out(flat, components, rng))
    nothing = PoseMixture(
        np.zeros(components),
        np.zeros((components, flat.shape[1])),
        np.zeros((components, *whole.shape)),
        tuple(mocap.joint_names[1:]),
        len(mocap.poses),
        mocap.absent,
    )
    found = _maximised(nothing, flat, owned, whole, least)
    before = -np.inf
    for _ in range(ROUNDS):
        densities = found.log_density(flat)
        total = logsumexp(densities, axis=1)
        if total.mean() - before < ENOUGH:
            break
        before = total.mean()
        found = _maximised(found, flat, np.exp(densities - total[:, None]), whole, least)
    return found


def _maximised(
    old: PoseMixture, flat: Array, owned: Array, whole: Array, least: Array
) -> PoseMixture:
    counts = owned.sum(axis=0)
    means = owned.T @ flat / counts[:, None]
    covariances = np.empty_like(old.covariances)
    for c, (mean, count) in enumerate(zip(means, counts, strict=True)):
        away = flat - mean
        own = (owned[:, [c]] * away).T @ away / count
        covariances[c] = (1 - SHRUNK) * own + SHRUNK * whole + (1 - SHRUNK) * least
    return PoseMixture(
        counts / len(flat), means, covariances, old.joint_names, old.n_frames, old.held_out
    )


def _clusters(flat: Array, means: Array) -> Array:
    """To which mean each frame is closest, (n, C) of zeros and ones, the means being theirs."""
    owned = np.zeros((len(flat), len(means)))
    for _ in range(CLUSTER_ROUNDS):
        distances = ((flat[:, None] - means) ** 2).sum(axis=2)
        owned = np.eye(len(means))[distances.argmin(axis=1)]
        means = owned.T @ flat / owned.sum(axis=0).clip(1)[:, None]
    return owned


def _spread_out(flat: Array, components: int, rng: np.random.Generator) -> Array:
    """First means: frames far from each other (k-means++, Arthur and Vassilvitskii 2007)."""
    chosen = [flat[rng.integers(len(flat))]]
    for _ in range(components - 1):
        nearest = np.min([((flat - c) ** 2).sum(axis=1) for c in chosen], axis=0)
        chosen.append(flat[rng.choice(len(flat), p=nearest / nearest.sum())])
    return np.array(chosen)


def save_pose_mixture(mixture: PoseMixture, path: Path) -> None:
    """Single precision, lower halves of the covariances, no pickles."""
    D = mixture.means.shape[1]
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file,
            shares=mixture.shares,
            means=mixture.means.astype(np.float32),
            covariances=mixture.covariances[:, *np.tril_indices(D)].astype(np.float32),
            joint_names=np.array(mixture.joint_names),
            n_frames=np.array(mixture.n_frames),
            held_out_clips=np.array(mixture.held_out),
        )


def read_pose_mixture(path: Path) -> PoseMixture:
    """As saved. Raises BadFile if it is not such a file."""
    with (
        taken_for(
            path, "mixture of poses", "learn it with python -m workbench.training.pose_mixture"
        ),
        open_arrays(path) as archive,
    ):
        arrays = read_expected(archive, EXPECTED)
        means, halves, shares = arrays["means"], arrays["covariances"], arrays["shares"]
        C, D = means.shape
        if halves.shape[1] != D * (D + 1) // 2 or 3 * len(arrays["joint_names"]) != D:
            raise BadFile(f"covariances of {halves.shape[1]} entries do not fit {D} angles")
        if not ((shares >= 0).all() and shares.sum() > 0):
            raise BadFile("its shares are negative, or all zero")
    lower = np.zeros((C, D, D))
    lower[:, *np.tril_indices(D)] = halves
    diagonal = np.einsum("cdd->cd", lower)[:, :, None] * np.eye(D)
    return PoseMixture(
        shares / shares.sum(),
        means,
        lower + lower.swapaxes(1, 2) - diagonal,
        tuple(map(str, arrays["joint_names"])),
        int(arrays["n_frames"]),
        tuple(map(str, arrays["held_out_clips"])),
    )


def main() -> None:
    """Learn the mixture from a recording and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mocap", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    learned_from, held_out = read_mocap(arguments.mocap).split()
    mixture = learn_pose_mixture(learned_from)
    save_pose_mixture(mixture, arguments.out / FILE_NAME)
    flat = held_out.poses[:, 1:].reshape(len(held_out.poses), -1)
    density = float(logsumexp(mixture.log_density(flat), axis=1).mean())
    print(f"{mixture.n_frames} frames; shares {np.round(mixture.shares, 3).tolist()}")
    print(f"mean log density of held-out frames: {density:.2f}")


if __name__ == "__main__":
    main()
