"""Learning a mixture of Gaussians of poses: `workbench/data/poses/cmu_mixture.npz`.

Run as `python -m builder.pose_mixture MOCAP.npz --out workbench/data/poses`, with a recording as
`workbench.priors.recordings` describes it.
"""

from pathlib import Path

import numpy as np
from scipy.special import logsumexp

from builder.from_a_recording import asked
from builder.mirrored_poses import both_ways
from builder.packing import write_arrays
from builder.pose_gaussian import LEAST_STD, UNMEASURED_STD
from workbench.arrays import Array
from workbench.priors.poses import MIXTURE_FILE, PoseMixture
from workbench.priors.recordings import PoseRecording

COMPONENTS = 8
CLUSTER_ROUNDS = 30  # of k-means, to begin with
ROUNDS, ENOUGH = 200, 1e-5  # of expectation and maximisation; gain per frame that ends them
SHRUNK = 0.02  # towards the covariance of all frames: a component may see few of them


def learn_pose_mixture(
    mocap: PoseRecording, components: int = COMPONENTS, seed: int = 0
) -> PoseMixture:
    """By expectation and maximisation over the frames and their mirror images.

    Joints that the recording does not move get a spread of their own, as in `pose_prior`.
    """
    flat, still = both_ways(mocap)
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
    arrays = {
        "shares": mixture.shares,
        "means": mixture.means.astype(np.float32),
        "covariances": mixture.covariances[:, *np.tril_indices(D)].astype(np.float32),
        "joint_names": np.array(mixture.joint_names),
        "n_frames": np.array(mixture.n_frames),
        "held_out_clips": np.array(mixture.held_out),
    }
    write_arrays(path, arrays)


def main() -> None:
    """Learn the mixture from a recording and write it."""
    learned_from, held_out, out = asked(__doc__)
    mixture = learn_pose_mixture(learned_from)
    save_pose_mixture(mixture, out / MIXTURE_FILE)
    flat = held_out.poses[:, 1:].reshape(len(held_out.poses), -1)
    density = float(logsumexp(mixture.log_density(flat), axis=1).mean())
    print(f"{mixture.n_frames} frames; shares {np.round(mixture.shares, 3).tolist()}")
    print(f"mean log density of held-out frames: {density:.2f}")


if __name__ == "__main__":
    main()
