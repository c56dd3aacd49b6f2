"""What poses people take: a Gaussian over the 23 joints below the pelvis, learned from mocap."""

from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import Protocol

import numpy as np

from workbench.arrays import Array
from workbench.reading.archive import open_arrays
from workbench.reading.damage import taken_for
from workbench.reading.expected import read_expected, reals, texts, wholes

FILE_NAME = "cmu_gaussian.npz"
EXPECTED = {
    "mean": reals("D"),
    "covariance": reals("D", "D"),
    "joint_names": texts("K"),
    "n_frames": wholes(),
    "unmeasured": texts("U"),
    "held_out_clips": texts("clips"),
}
LARGEST_ANGLE = np.radians(150)  # blending two rotations 180 degrees apart has no inverse


@dataclass(frozen=True, eq=False)
class PoseGaussian:
    """pose[3:] ~ N(mean, covariance) in rad, alike on both sides; the pelvis is left out."""

    mean: Array  # (69,)
    covariance: Array  # (69, 69)
    joint_names: tuple[str, ...]  # 23
    n_frames: int
    unmeasured: tuple[str, ...]  # joints that no recording moved; their spread is a guess
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


def read_pose_gaussian(path: Path) -> PoseGaussian:
    """As saved. Raises BadFile if it is not such a file."""
    with (
        taken_for(path, "pose prior", "install the workbench again"),
        open_arrays(path) as archive,
    ):
        arrays = read_expected(archive, EXPECTED)
    return PoseGaussian(
        mean=arrays["mean"],
        covariance=arrays["covariance"],
        joint_names=tuple(map(str, arrays["joint_names"])),
        n_frames=int(arrays["n_frames"]),
        unmeasured=tuple(map(str, arrays["unmeasured"])),
        held_out=tuple(map(str, arrays["held_out_clips"])),
    )


def shipped_gaussian() -> PoseGaussian:
    """The Gaussian that comes with the workbench; `data/poses/PROVENANCE.md` says where from."""
    with as_file(files("workbench") / "data" / "poses" / FILE_NAME) as path:
        return read_pose_gaussian(path)
