"""Learning a Gaussian of poses from a recording: `workbench/data/poses/cmu_gaussian.npz`.

Run as `python -m builder.pose_gaussian MOCAP.npz --out workbench/data/poses`, with a recording as
`workbench.priors.recordings` describes it.
"""

from pathlib import Path

import numpy as np

from builder.from_a_recording import asked
from builder.mirrored_poses import both_ways
from workbench.priors.poses import GAUSSIAN_FILE, PoseGaussian
from workbench.priors.recordings import PoseRecording

UNMEASURED_STD = 0.1  # rad, of joints that the recording does not move: a guess
LEAST_STD = 0.01  # rad, added to every entry, so that the covariance can be inverted


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


def main() -> None:
    """Learn the prior from a recording and write it."""
    learned_from, _, out = asked(__doc__)
    prior = learn_pose_gaussian(learned_from)
    save_pose_gaussian(prior, out / GAUSSIAN_FILE)
    print(f"{prior.n_frames} frames; not moved in them: {', '.join(prior.unmeasured)}")
    print(f"held out: {', '.join(prior.held_out)}")


if __name__ == "__main__":
    main()
