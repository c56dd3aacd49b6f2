"""What is known of poses before any is seen, learned from a recording of motion capture.

    python -m builder.pose_priors gaussian MOCAP.npz --out workbench/data/poses

writes `cmu_gaussian.npz`, and `mixture` writes `cmu_mixture.npz`.
The recording is as `builder.recordings` describes it. `regressor` writes
`regressor.npz`, the regressor of poses; it takes three minutes, and nothing but the
package and scikit-learn (the extra `learn`)."""

import argparse
from pathlib import Path

import numpy as np
from scipy.special import logsumexp

from builder.recordings import PoseRecording, read_recording
from builder.stored import write_arrays
from lectures.material.regressor_training import save_regressor, train_pose_regressor
from workbench import load_body
from workbench.arrays import Array, Index, Mask
from workbench.errors import BadArgument
from workbench.fitting.pose_regressor import REGRESSOR_FILE
from workbench.geometry.mirror import AXIAL, opposites
from workbench.priors.poses import (
    GAUSSIAN_FILE,
    MIXTURE_FILE,
    PoseGaussian,
    PoseMixture,
    shipped_mixture,
)

UNMEASURED_STD = 0.1  # rad, of joints that the recording does not move: a guess
LEAST_STD = 0.01  # rad, added to every entry, so that the covariance can be inverted
COMPONENTS = 8
CLUSTER_ROUNDS = 30  # of k-means, to begin with
ROUNDS, ENOUGH = 200, 1e-5  # of expectation and maximisation; gain per frame that ends them
SHRUNK = 0.02  # towards the covariance of all frames: a component may see few of them
PEOPLE, PASSES, HIDDEN = 30_000, 200, (320, 320)


def mirrored_pose(pose: Array, joints: Index) -> Array:
    """Poses (..., K, 3) rad as seen in a mirror; `joints` (K,) are the opposites."""
    mirrored: Array = pose[..., joints, :] * AXIAL
    return mirrored


def both_ways(mocap: PoseRecording) -> tuple[Array, Mask]:
    """The frames of a recording and their mirror images without the root, (2 F, 3 (K - 1)) rad.

    The second array (K - 1,) says which joints do not move in any of them.
    """
    turned = mirrored_pose(mocap.poses, opposites(mocap.joint_names))
    both = np.concatenate([mocap.poses, turned])[:, 1:]
    still: Mask = (np.ptp(both, axis=0) < 1e-6).all(axis=1)
    return both.reshape(len(both), -1), still


def learn_pose_gaussian(mocap: PoseRecording) -> PoseGaussian:
    """The Gaussian of the frames and their mirror images."""
    flat, still = both_ways(mocap)
    covariance = np.cov(flat.T) + LEAST_STD**2 * np.eye(flat.shape[1])
    covariance[np.diag_indices_from(covariance)] += np.repeat(UNMEASURED_STD**2 * still, 3)
    names = np.array(mocap.joint_names[1:])
    return PoseGaussian(
        mean=flat.mean(axis=0),
        covariance=covariance,
        joint_names=tuple(names),
        n_frames=len(mocap.poses),
        unmeasured=tuple(names[still]),
        held_out=mocap.absent,
    )


def save_pose_gaussian(prior: PoseGaussian, path: Path) -> None:
    """Single precision, no pickles."""
    np.savez_compressed(
        path,
        mean=prior.mean.astype(np.float32),
        covariance=prior.covariance.astype(np.float32),
        joint_names=np.array(prior.joint_names),
        n_frames=np.array(prior.n_frames),
        unmeasured=np.array(prior.unmeasured),
        unmeasured_std=np.array(UNMEASURED_STD),
        held_out_clips=np.array(prior.held_out),
    )


def build_gaussian(recording: Path | None, folder: Path) -> None:
    """Learn the prior from a recording and write it."""
    learned_from, _ = _split(recording)
    prior = learn_pose_gaussian(learned_from)
    save_pose_gaussian(prior, folder / GAUSSIAN_FILE)
    print(f"{prior.n_frames} frames; not moved in them: {', '.join(prior.unmeasured)}")
    print(f"held out: {', '.join(prior.held_out)}")


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


def build_mixture(recording: Path | None, folder: Path) -> None:
    """Learn the mixture from a recording and write it."""
    learned_from, held_out = _split(recording)
    mixture = learn_pose_mixture(learned_from)
    save_pose_mixture(mixture, folder / MIXTURE_FILE)
    flat = held_out.poses[:, 1:].reshape(len(held_out.poses), -1)
    density = float(logsumexp(mixture.log_density(flat), axis=1).mean())
    print(f"{mixture.n_frames} frames; shares {np.round(mixture.shares, 3).tolist()}")
    print(f"mean log density of held-out frames: {density:.2f}")


def build_regressor(recording: Path | None, folder: Path) -> None:
    """Train the regressor and write it."""

    def progress(done: int, loss: float) -> None:
        if done % 10 == 0:
            print(f"{done} of {PASSES} passes, loss {loss:.5f}", flush=True)

    regressor = train_pose_regressor(
        load_body("default"),
        shipped_mixture(),
        n=PEOPLE,
        passes=PASSES,
        hidden=HIDDEN,
        progress=progress,
    )
    save_regressor(regressor, folder / REGRESSOR_FILE)


def _split(recording: Path | None) -> tuple[PoseRecording, PoseRecording]:
    """The clips to learn from, and those that are held out."""
    if recording is None:
        raise BadArgument("this prior is learned from a recording; give its file")
    return read_recording(recording).split()


def main() -> None:
    """Learn one prior and write it."""
    kinds = {
        "gaussian": build_gaussian,
        "mixture": build_mixture,
        "regressor": build_regressor,
    }
    parser = argparse.ArgumentParser(prog="python -m builder.pose_priors", description=__doc__)
    parser.add_argument("kind", choices=kinds)
    parser.add_argument("recording", type=Path, nargs="?")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    kinds[arguments.kind](arguments.recording, arguments.out)


if __name__ == "__main__":
    main()
