"""f(theta), what pose blend shapes are multiplied with: B_P(theta) = sum over n of f_n P_n.

SMPL takes the elements of rotation matrices. What else one may take is here too, each as a value
of `SkinnedBody.features`: whatever they are, posedirs (N, 3, F) hold a shape for each. STAR's read
a shape coefficient as well.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as cs

from workbench.bodies.forward.kinematics import pose_features
from workbench.errors import BadArgument
from workbench.geometry.rotation import quaternions_of_vectors, rodrigues


@dataclass(frozen=True, eq=False)
class Posture:
    """What features are made from: symbols, or numbers, of one person in one pose of K joints.

    Attributes:
        pose: (3, K) rad.
        bind: (3, K) rad, the pose that the template is drawn in.
        R: (3, 3 K), the rotations of `pose` side by side.
        R_bind: (3, 3 K), those of `bind`.
        betas: (B, 1), the person's shape.
    """

    pose: cs.MX
    bind: cs.MX
    R: cs.MX
    R_bind: cs.MX
    betas: cs.MX

    @staticmethod
    def of(pose: cs.MX, bind: cs.MX, betas: cs.MX) -> "Posture":
        """A pose and the bind pose with their rotations, and a person's betas."""
        return Posture(pose, bind, rodrigues(pose), rodrigues(bind), betas)


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

    The features of STAR (Osman et al., ECCV 2020) that belong to the pose: 92 on 24 joints.
    Bounded; after one full turn they have the opposite quaternion, and are the same again only
    after two. `star_features` have beta_2 as well.
    """
    w, x, y, z = cs.vertsplit(quaternions_of_vectors(at.pose) - quaternions_of_vectors(at.bind), 1)
    return cs.vec(cs.vertcat(x, y, z, w)[:, 1:])


def star_features(at: Posture) -> cs.MX:
    """Quaternion elements and beta_2, the second shape coefficient: F = 4 (K - 1) + 1.

    The 93 features of STAR on 24 joints (Osman, Bolkart, Black, STAR: Sparse Trained Articulated
    Human Body Regressor, ECCV 2020), in the order of its files. Their beta_2 is a person's mass.
    The feature is linear: it adds the shape posedirs[:, :, -1] beta_2 to the rest surface in every
    pose, and the joints, which are regressed before pose blend shapes, do not move. So the features
    are zero in the bind pose only for people whose beta_2 is zero, and where joints are given a
    change of this shape cancels against one of shapedirs[:, :, 1].

    The body needs two betas. It is evaluated by its graph, without the fast arithmetic of SMPL;
    `workbench train` learns SMPL's features alone, and posedirs of these are learned as a
    `Problem` with `freed("posedirs")`, which is linear in them.
    """
    B = at.betas.shape[0]
    if B < 2:
        raise BadArgument(f"star_features need beta_2, which is not among betas of shape ({B},)")
    return cs.vertcat(quaternion_elements(at), at.betas[1])


def count_features(features: Features, K: int, B: int) -> int:
    """F, on a tree of K joints, for a person of B betas."""
    pose, bind = cs.MX.sym("pose", 3, K), cs.MX.sym("bind", 3, K)
    found = features(Posture.of(pose, bind, cs.MX.sym("betas", B)))
    return int(found.shape[0])
