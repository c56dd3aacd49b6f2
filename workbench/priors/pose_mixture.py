"""What poses people take: eight Gaussians over the joints below the pelvis, learned from mocap.

One Gaussian of walking, sitting and jumping together also draws what lies between them, which
nobody does; a mixture draws each by itself. SMPLify's prior has eight components as well (Bogo et
al. 2016, section 3.3).
"""

from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import scipy.linalg

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.reading.archive import open_arrays
from workbench.reading.damage import taken_for
from workbench.reading.expected import read_expected, reals, texts, wholes

FILE_NAME = "cmu_mixture.npz"
EXPECTED = {
    "shares": reals("C"),
    "means": reals("C", "D"),
    "covariances": reals("C", "lower half"),
    "joint_names": texts("K"),
    "n_frames": wholes(),
    "held_out_clips": texts("clips"),
}


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


def read_pose_mixture(path: Path) -> PoseMixture:
    """As saved. Raises BadFile if it is not such a file."""
    with (
        taken_for(path, "mixture of poses", "install the workbench again"),
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


def shipped_mixture() -> PoseMixture:
    """The mixture that comes with the workbench; `data/poses/PROVENANCE.md` says where from."""
    with as_file(files("workbench") / "data" / "poses" / FILE_NAME) as path:
        return read_pose_mixture(path)
