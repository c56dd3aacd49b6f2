"""f(theta), what pose blend shapes are multiplied with: B_P(theta) = sum over n of f_n P_n.

SMPL takes the elements of rotation matrices. What else one may take is here too, each as a value
of `SkinnedBody.features`: whatever they are, posedirs (N, 3, F) hold a shape for each.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.bodies.forward.kinematics import pose_features
from workbench.geometry.rotation import half_turns, rodrigues


@dataclass(frozen=True, eq=False)
class Posture:
    """What features are made from: symbols, or numbers, of one pose of K joints.

    Attributes:
        pose: (3, K) rad.
        bind: (3, K) rad, the pose that the template is drawn in.
        R: (3, 3 K), the rotations of `pose` side by side.
        R_bind: (3, 3 K), those of `bind`.
    """

    pose: cs.MX
    bind: cs.MX
    R: cs.MX
    R_bind: cs.MX

    @staticmethod
    def of(pose: cs.MX, bind: cs.MX) -> "Posture":
        """A pose and the bind pose with their rotations."""
        return Posture(pose, bind, rodrigues(pose), rodrigues(bind))


Features = Callable[[Posture], cs.MX]  # -> (F, 1), zeros in the bind pose unless said otherwise


def rotation_elements(at: Posture) -> cs.MX:
    """vec(R_k - R_k(bind)), row by row, of every joint but the root: F = 9 (K - 1) (SMPL eq. 9).

    The same for every theta of one rotation, and between -2 and 2.
    """
    return pose_features(at.R, at.R_bind)


def rotation_vectors(at: Posture) -> cs.MX:
    """theta itself, less that of the bind pose, of every joint but the root: F = 3 (K - 1) rad.

    Another number for every full turn, and without bounds, though the rotation is the same.
    """
    return cs.vec((at.pose - at.bind)[:, 1:])


def quaternion_elements(at: Posture) -> cs.MX:
    """(n sin t/2, cos t/2) less those of the bind pose, joint by joint: F = 4 (K - 1).

    The features of STAR (Osman et al., ECCV 2020) that belong to the pose. STAR has one more, the
    shape coefficient beta_2, which stands for body mass; features here see no betas, so it is left
    out: 92 features on 24 joints, where STAR has 93. Bounded; after one full turn they have the
    opposite quaternion, and are the same again only after two.
    """
    w, x, y, z = cs.vertsplit(half_turns(at.pose) - half_turns(at.bind), 1)
    return cs.vec(cs.vertcat(x, y, z, w)[:, 1:])


def no_features(at: Posture) -> cs.MX:
    """No features at all: F = 0."""
    return cs.MX(0, 1)


def count_features(features: Features, K: int) -> int:
    """F, on a tree of K joints."""
    pose, bind = cs.MX.sym("pose", 3, K), cs.MX.sym("bind", 3, K)
    found = features(Posture.of(pose, bind))
    return int(found.shape[0])


CLASSICAL: tuple[Features, ...] = (
    rotation_elements,
    rotation_vectors,
    quaternion_elements,
)


def unskinned(points: cs.MX, motions: Sequence[cs.MX], weights: cs.MX) -> cs.MX:
    """The points (3, N) unchanged: there are no bones that move them."""
    return points


@dataclass(frozen=True)
class Powers:
    """x, x^2, ..., x^degree of every number x of theta by itself: F = 3 (K - 1) degree."""

    degree: int

    def __call__(self, at: Posture) -> cs.MX:
        """The features (F, 1), in powers of rad."""
        x = rotation_vectors(at)
        return cs.vertcat(*[x**power for power in range(1, self.degree + 1)])


def products(at: Posture) -> cs.MX:
    """x and all products x y of two numbers of theta: F = n + n (n + 1) / 2, n = 3 (K - 1)."""
    x = rotation_vectors(at)
    rows, columns = np.triu_indices(x.shape[0])
    return cs.vertcat(x, x[rows.tolist()] * x[columns.tolist()])
