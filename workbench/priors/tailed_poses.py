"""Which poses people take, with tails: Student's t, learned from motion capture.

Most poses of a recording are nearer to the mean than the Gaussian of their covariance expects, and
a few are much farther away: what a person does makes all joints move little, or several move much.
`data/poses/PROVENANCE.md` says where the prior comes from.
"""

from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from scipy.special import gammaln

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.priors.poses import EXPECTED, squared_distances
from workbench.reading.arrays import AGAIN, opened, read_expected, reals

STUDENT_FILE = "cmu_student.npz"
STUDENT = EXPECTED | {"mean": reals("D"), "scale": reals("D", "D"), "dof": reals()}


@dataclass(frozen=True, eq=False)
class PoseStudent:
    """Rotation vectors of K joints ~ t(dof, mean, scale) in 3 K dimensions, the same on both sides.

    Only joints that move in the recording are among them.

    Attributes:
        mean: (3 K,) rad.
        scale: (3 K, 3 K) rad^2; the covariance is dof / (dof - 2) times as large.
        dof: the degrees of freedom, nu.
        joint_names: the names of the K joints.
        n_frames: the number of recorded poses that it was learned from.
        held_out: the names of the clips that it was not learned from.
    """

    mean: Array
    scale: Array
    dof: float
    joint_names: tuple[str, ...]
    n_frames: int
    held_out: tuple[str, ...]

    def squares(self, flat: Array) -> Array:
        """The squared distances m^2 (n,) from the mean of poses (n, 3 K), by `scale`."""
        return squared_distances(flat, self.mean, self.scale)[0]

    def log_density(self, flat: Array) -> Array:
        """The log density (n,) at poses (n, 3 K) rad."""
        nu, d = self.dof, len(self.mean)
        squares, log_volume = squared_distances(flat, self.mean, self.scale)
        within = log_volume + 0.5 * d * np.log(nu * np.pi)
        constant = gammaln((nu + d) / 2) - gammaln(nu / 2) - within
        return np.asarray(constant - 0.5 * (nu + d) * np.log1p(squares / nu))


def read_pose_student(path: Path) -> PoseStudent:
    """Read a Student's t from a file. Raises BadFile if there is none in it."""
    with opened(path, "pose prior with tails", AGAIN) as archive:
        arrays = read_expected(archive, STUDENT)
        D = len(arrays["mean"])
        if 3 * len(arrays["joint_names"]) != D:
            raise BadFile(f"{D} angles are not those of {len(arrays['joint_names'])} joints")
        if not 0 < arrays["dof"] < np.inf:
            raise BadFile(f"its degrees of freedom are {arrays['dof']:g}, but must be above 0")
    return PoseStudent(
        mean=arrays["mean"],
        scale=arrays["scale"],
        dof=float(arrays["dof"]),
        joint_names=tuple(map(str, arrays["joint_names"])),
        n_frames=int(arrays["n_frames"]),
        held_out=tuple(map(str, arrays["held_out_clips"])),
    )


def shipped_student() -> PoseStudent:
    """The Student's t that comes with the workbench."""
    with as_file(files("workbench") / "data" / "poses" / STUDENT_FILE) as path:
        return read_pose_student(path)
