"""What poses people take: a Gaussian over the 23 joints below the pelvis, learned from mocap.

Run as `python -m workbench.training.pose_prior MOCAP.npz --out workbench/data/poses`, where the
file holds `poses` (F, 72) rad, `ok` (F,), `clip` (F,), `clip_name` and `joint_names`. Every fifth
clip is held out, for those who want to measure something on poses that nothing was learned from.
Frames whose elbows bend backwards are left out: the recording flips them in clips 01_01 and 13_18.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from workbench.errors import BadFile, listed
from workbench.reading.archive import open_arrays
from workbench.reading.damage import taken_for
from workbench.reading.expected import check_numbers, read_expected, reals, texts, truths, wholes
from workbench.training.mirror import mirrored_pose, opposites

Array = NDArray[np.float64]

FILE_NAME = "cmu_gaussian.npz"
HELD_OUT_EVERY = 5
UNMEASURED_STD = 0.1  # rad, of joints that the recording does not move: a guess
ELBOWS = ("left_elbow", "right_elbow")
ELBOW_LIMIT = 0.1  # rad, how far an elbow may bend backwards
LEAST_STD = 0.01  # rad, added to every entry, so that the covariance can be inverted
RECORDED = {
    "joint_names": texts("K"),
    "poses": reals("F", "3 K"),
    "ok": truths("F"),
    "clip": wholes("F"),
    "clip_name": texts("clips"),
}
PRIOR = {
    "mean": reals("D"),
    "covariance": reals("D", "D"),
    "joint_names": texts("K"),
    "n_frames": wholes(),
    "unmeasured": texts("U"),
    "held_out_clips": texts("clips"),
}
LARGEST_ANGLE = np.radians(150)  # blending two rotations 180 degrees apart has no inverse


@dataclass(frozen=True, eq=False)
class PosePrior:
    """pose[3:] ~ N(mean, covariance) in rad, alike on both sides; the pelvis is left out."""

    mean: Array  # (69,)
    covariance: Array  # (69, 69)
    joint_names: tuple[str, ...]  # 23
    n_frames: int
    unmeasured: tuple[str, ...]  # joints whose spread is UNMEASURED_STD
    held_out: tuple[str, ...]  # clips that it was not learned from

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Poses (n, 24, 3) rad, the pelvis unturned."""
        noise = rng.standard_normal((n, len(self.mean)))
        pose = self.mean + noise @ np.linalg.cholesky(self.covariance).T
        return np.concatenate([np.zeros((n, 1, 3)), pose.reshape(n, -1, 3)], axis=1)


class Poses(Protocol):
    """What can draw `n` poses (n, 24, 3) rad."""

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """The pelvis unturned."""


def draw_poses(prior: Poses, n: int, rng: np.random.Generator) -> Array:
    """`n` poses (n, 24, 3) rad of the prior, those with a joint turned too far left out."""
    poses = prior.draw(2 * n, rng)
    possible = (np.linalg.norm(poses, axis=2) < LARGEST_ANGLE).all(axis=1)
    drawn: Array = poses[possible][:n]
    return drawn


@dataclass(frozen=True, eq=False)
class Mocap:
    """Recorded poses (F, 24, 3) rad, their clips (F,), and the names of clips and joints."""

    poses: Array
    clip: NDArray[np.int64]
    clip_names: tuple[str, ...]
    joint_names: tuple[str, ...]

    def split(self) -> tuple["Mocap", "Mocap"]:
        """To learn from, and every fifth clip to measure on: frames of a clip are alike."""
        held_out = self.clip % HELD_OUT_EVERY == HELD_OUT_EVERY - 1
        return self._where(~held_out), self._where(held_out)

    def both_ways(self) -> tuple[Array, NDArray[np.bool_]]:
        """The frames and their mirror images without the root, (2 F, 3 (K - 1)) rad.

        And which joints are still in all of them, (K - 1,).
        """
        turned = mirrored_pose(self.poses, opposites(self.joint_names))
        both = np.concatenate([self.poses, turned])[:, 1:]
        still: NDArray[np.bool_] = (np.ptp(both, axis=0) < 1e-6).all(axis=1)
        return both.reshape(len(both), -1), still

    @property
    def absent(self) -> tuple[str, ...]:
        """The clips that no frame is from."""
        present = {self.clip_names[c] for c in np.unique(self.clip)}
        return tuple(sorted(set(self.clip_names) - present))

    def _where(self, chosen: NDArray[np.bool_]) -> "Mocap":
        return Mocap(self.poses[chosen], self.clip[chosen], self.clip_names, self.joint_names)


def read_mocap(path: Path) -> Mocap:
    """The good frames of a recording. Raises BadFile if an array is missing."""
    with (
        taken_for(path, "recording in the layout described", "give such an .npz"),
        open_arrays(path) as archive,
    ):
        arrays = read_expected(archive, RECORDED)
        names = tuple(map(str, arrays["joint_names"]))
        if arrays["poses"].shape[1] != 3 * len(names) or not set(ELBOWS) <= set(names):
            raise BadFile(f"its poses have {arrays['poses'].shape[1]} angles of {listed(names)}")
        check_numbers("clip", arrays["clip"], len(arrays["clip_name"]))
    poses = arrays["poses"].reshape(len(arrays["poses"]), -1, 3)
    good = arrays["ok"] & _elbows_bend_forwards(poses, names)
    clips = tuple(map(str, arrays["clip_name"]))
    return Mocap(poses[good], arrays["clip"][good], clips, names)


def _elbows_bend_forwards(poses: Array, names: tuple[str, ...]) -> NDArray[np.bool_]:
    """In the T-pose elbows bend about the vertical: the left about -y, the right about +y."""
    left, right = (poses[:, names.index(name), 1] for name in ELBOWS)
    forwards: NDArray[np.bool_] = (left < ELBOW_LIMIT) & (right > -ELBOW_LIMIT)
    return forwards


def learn_pose_prior(mocap: Mocap) -> PosePrior:
    """The Gaussian of the frames and their mirror images."""
    flat, still = mocap.both_ways()
    covariance = np.cov(flat.T) + LEAST_STD**2 * np.eye(flat.shape[1])
    covariance[np.diag_indices_from(covariance)] += np.repeat(UNMEASURED_STD**2 * still, 3)
    names = np.array(mocap.joint_names[1:])
    return PosePrior(
        mean=flat.mean(axis=0),
        covariance=covariance,
        joint_names=tuple(names),
        n_frames=len(mocap.poses),
        unmeasured=tuple(names[still]),
        held_out=mocap.absent,
    )


def save_pose_prior(prior: PosePrior, path: Path) -> None:
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


def read_pose_prior(path: Path) -> PosePrior:
    """As saved. Raises BadFile if it is not such a file."""
    with (
        taken_for(path, "pose prior", "learn it with python -m workbench.training.pose_prior"),
        open_arrays(path) as archive,
    ):
        arrays = read_expected(archive, PRIOR)
    return PosePrior(
        mean=arrays["mean"],
        covariance=arrays["covariance"],
        joint_names=tuple(map(str, arrays["joint_names"])),
        n_frames=int(arrays["n_frames"]),
        unmeasured=tuple(map(str, arrays["unmeasured"])),
        held_out=tuple(map(str, arrays["held_out_clips"])),
    )


def main() -> None:
    """Learn the prior from a recording and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mocap", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    learned_from, _ = read_mocap(arguments.mocap).split()
    prior = learn_pose_prior(learned_from)
    save_pose_prior(prior, arguments.out / FILE_NAME)
    print(f"{prior.n_frames} frames; not moved in them: {', '.join(prior.unmeasured)}")
    print(f"held out: {', '.join(prior.held_out)}")


if __name__ == "__main__":
    main()
