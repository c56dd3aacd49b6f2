"""Which poses people take: a Gaussian, a mixture of eight, and Student's t, from motion capture.

All are over rotation vectors of the joints below the pelvis. One Gaussian of walking, sitting and
jumping together also draws what lies between them, which nobody does; a mixture draws each by
itself. SMPLify's prior has eight components as well (Bogo et al., Keep it SMPL, 2016, section 3.3).
`data/poses/PROVENANCE.md` says where the priors come from.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array, Index
from workbench.errors import BadFile
from workbench.reading.arrays import AGAIN, opened, read_expected, reals, texts, wholes

FOLDER = files("workbench") / "data" / "poses"
GAUSSIAN_FILE, MIXTURE_FILE = "cmu_gaussian.npz", "cmu_mixture.npz"
EXPECTED = {"joint_names": texts("K"), "n_frames": wholes(), "held_out_clips": texts("clips")}
GAUSSIAN = EXPECTED | {
    "mean": reals("D"),
    "covariance": reals("D", "D"),
    "unmeasured": texts("U"),
}
MIXTURE = EXPECTED | {
    "shares": reals("C"),
    "means": reals("C", "D"),
    "covariances": reals("C", "lower half"),
}
LARGEST_ANGLE = np.radians(150)  # blending two rotations 180 degrees apart has no inverse


@dataclass(frozen=True, eq=False)
class PoseGaussian:
    """pose[3:] ~ N(mean, covariance) in rad, the same on both sides; the pelvis is left out."""

    mean: Array  # (69,) rad
    covariance: Array  # (69, 69) rad^2
    joint_names: tuple[str, ...]  # the names of the 23 joints
    n_frames: int  # the number of recorded poses that it was learned from
    # the joints that move in no recording, whose standard deviation is a guess
    unmeasured: tuple[str, ...]
    held_out: tuple[str, ...]  # the names of the clips that it was not learned from

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Draw n poses (n, 24, 3) rad, in which the pelvis is not turned."""
        noise = rng.standard_normal((n, len(self.mean)))
        return _with_pelvis(self.mean + noise @ np.linalg.cholesky(self.covariance).T)


@dataclass(frozen=True, eq=False)
class PoseMixture:
    """pose[3:] ~ sum over c of shares_c N(means_c, covariances_c) in rad, without the pelvis."""

    shares: Array  # (C,) the weights of the components, which sum to one
    means: Array  # (C, D) rad
    covariances: Array  # (C, D, D) rad^2
    joint_names: tuple[str, ...]  # the names of the D / 3 joints
    n_frames: int  # the number of recorded poses that it was learned from
    held_out: tuple[str, ...]  # the names of the clips that it was not learned from

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Draw n poses (n, K, 3) rad, in which the pelvis is not turned."""
        component = rng.choice(len(self.shares), size=n, p=self.shares)
        noise = rng.standard_normal((n, self.means.shape[1]))
        factors = np.linalg.cholesky(self.covariances)
        drawn = self.means[component] + np.einsum("nde,ne->nd", factors[component], noise)
        return _with_pelvis(drawn)

    def log_density(self, flat: Array) -> Array:
        """The log density of each component at poses (n, D), log shares included: (n, C)."""
        from scipy.stats import multivariate_normal  # a second to import

        components = zip(np.log(self.shares), self.means, self.covariances, strict=True)
        densities = [
            share + multivariate_normal.logpdf(flat, *moments) for share, *moments in components
        ]
        return np.column_stack(densities)


def numbers_of(chosen: Sequence[str], names: Sequence[str]) -> Index:
    """Where the three numbers of each of some joints stand among those of all `names`."""
    joints = np.array([names.index(name) for name in chosen])
    return np.asarray((3 * joints[:, None] + np.arange(3)).ravel())


def _with_pelvis(flat: Array) -> Array:
    """Poses (n, K, 3) rad from those (n, 3 (K - 1)) of the joints below the pelvis."""
    return np.concatenate([np.zeros((len(flat), 1, 3)), flat.reshape(len(flat), -1, 3)], axis=1)


def draw_poses(prior: PoseGaussian | PoseMixture, n: int, rng: np.random.Generator) -> Array:
    """Draw `n` poses (n, 24, 3) rad of the prior, none with a joint turned by 150 degrees or more.

    They are the first `n` such poses among 2 n draws; of a very wide prior there may be fewer.
    """
    poses = prior.draw(2 * n, rng)
    possible = (np.linalg.norm(poses, axis=2) < LARGEST_ANGLE).all(axis=1)
    return np.asarray(poses[possible][:n])


def _origin(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """The joints of a prior, and what it was learned from."""
    return {
        "joint_names": tuple(map(str, arrays["joint_names"])),
        "n_frames": int(arrays["n_frames"]),
        "held_out": tuple(map(str, arrays["held_out_clips"])),
    }


def read_pose_gaussian(path: Path) -> PoseGaussian:
    """Read a Gaussian from a file. Raises BadFile if there is none in it."""
    with opened(path, "pose prior", AGAIN) as archive:
        arrays = read_expected(archive, GAUSSIAN)
    return PoseGaussian(
        mean=arrays["mean"],
        covariance=arrays["covariance"],
        unmeasured=tuple(map(str, arrays["unmeasured"])),
        **_origin(arrays),
    )


def read_pose_mixture(path: Path) -> PoseMixture:
    """Read a mixture from a file. Raises BadFile if there is none in it."""
    with opened(path, "mixture of poses", AGAIN) as archive:
        arrays = read_expected(archive, MIXTURE)
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
        **_origin(arrays),
    )


def shipped_gaussian() -> PoseGaussian:
    """The Gaussian that comes with the workbench."""
    with as_file(FOLDER / GAUSSIAN_FILE) as path:
        return read_pose_gaussian(path)


def shipped_mixture() -> PoseMixture:
    """The mixture that comes with the workbench."""
    with as_file(FOLDER / MIXTURE_FILE) as path:
        return read_pose_mixture(path)
