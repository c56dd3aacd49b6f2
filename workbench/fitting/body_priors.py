"""The priors that decide what observations leave open: on pose, shape and stature."""

from collections.abc import Sequence

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Points
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body, why_not_skinned
from workbench.bodies.capsules import Capsules, capsule_points, capsules_of
from workbench.bodies.hands import hands_of
from workbench.bodies.spaces import PoseSpace, has_pose_space, pose_space
from workbench.errors import BadArgument, BadBody
from workbench.priors.joint_limits import hand_limits
from workbench.priors.poses import numbers_of, shipped_gaussian, shipped_mixture
from workbench.residuals import Residual, apart, gaussian, max_mixture

POSE_PRIOR, CONTACT = "pose prior", "contact"
SMPL_JOINTS = 24  # of the bodies for which the pose prior was learned
TO_THE_WRISTS = 21  # of them, without the root; what is left are fingers as a whole
OTHER_JOINTS = 0.5  # rad: joints of which nothing is known
BESIDE_SPACE = 0.05  # rad, beside what a pose space says: nobody's poses are exactly in it
BESIDE_ON_A_BODY = 0.1  # rad, the same for the hands of a whole body
SHORTEST, TALLEST = 0.4, 2.8  # m
OVERLAP_SIGMA = 0.005  # m, of capsules, which are only about as wide as the limbs
TISSUE_SIGMA = 1.5  # of a coefficient of soft tissue: their root mean square in made-up motions
MEASURED_SIGMA = 0.01  # m, the usual standard deviation of a stature that was measured


def pose_prior(body: Body, pose: cs.MX | None = None) -> Residual:
    """A Gaussian on all joint rotations but the root's: that of `pose_gaussian`.

    `pose` (3, K) rad is the symbol of one of several poses; without it, that of the body's blocks.
    """
    pose = body.blocks()[0].symbol if pose is None else pose
    mean, covariance = pose_gaussian(body)
    return gaussian(pose[:, 1:], mean=mean, covariance=covariance, unit="rad", name=POSE_PRIOR)


def mixture_prior(body: Body) -> Residual:
    """-log of the likeliest of eight Gaussians of all joint rotations but the root's: the pose
    prior of SMPLify (Bogo et al., Keep it SMPL, 2016, eq. 4 and the sentence after it).

    The mixture is `shipped_mixture`, which was learned from motion capture as the Gaussian of
    `pose_prior` was. Raises BadArgument for a body without SMPL's 24 joints.
    """
    learned = shipped_mixture()
    if tuple(body.joint_names[1:]) != tuple(learned.joint_names):
        raise BadArgument(
            f"the mixture of poses is one of SMPL's {SMPL_JOINTS} joints, and body {body.name!r} "
            "has others; take the Gaussian prior, `pose_prior`"
        )
    return max_mixture(
        body.blocks()[0].symbol[:, 1:],
        shares=learned.shares,
        means=learned.means,
        covariances=learned.covariances,
        name=POSE_PRIOR,
    )


def apart_prior(body: Body) -> Residual:
    """How deep the capsules of a body overlap, where they do, with OVERLAP_SIGMA: see `apart`.

    The radii follow the betas. Raises BadBody for a body without capsules.
    """
    ends, capsules = posed_capsules(body)
    radii = capsules.radii_in(body.blocks()[1].symbol)
    return apart(ends, radii, capsules.pairs, sigma=OVERLAP_SIGMA, name=CONTACT)


def posed_capsules(body: Body) -> tuple[Points, Capsules]:
    """The ends (3, 2 C) m of a body's posed capsules, as symbols, and the capsules at rest.

    Raises BadBody for a body without capsules.
    """
    if not isinstance(body, SkinnedBody):
        raise BadBody(why_not_skinned(body, "capsules", "take one"))
    capsules = capsules_of(body)
    return capsule_points(body, *(block.symbol for block in body.blocks())), capsules


def pose_gaussian(body: Body) -> tuple[Array, Array]:
    """The mean (K - 1, 3) rad of `pose_prior`, and a variance or covariance in rad^2.

    For SMPL's 24 joints both were learned from motion capture: `data/poses/cmu_gaussian.npz`, and
    PROVENANCE.md beside it names the source. A hand with a pose space has the space's Gaussian, and
    0.05 rad of standard deviation about each axis beside it. A body that has SMPL's joints down to
    the wrists, such as one of SMPL-H, gets what was learned for these; its fingers have the
    Gaussian of its pose space, with 0.1 rad beside it. Any other joint gets 0.5 rad about its rest
    pose.
    """
    learned = shipped_gaussian()
    if body.n_joints == SMPL_JOINTS:
        return learned.mean, learned.covariance
    if has_pose_space(body):
        space = pose_space(body)
        return space.mean, _covariance(space, BESIDE_SPACE)
    names, recorded = body.joint_names[1:], learned.joint_names[:TO_THE_WRISTS]
    if not {*recorded} <= {*names}:
        return body.bind_pose[1:], np.array(OTHER_JOINTS**2)
    mean, covariance = body.bind_pose[1:].copy(), OTHER_JOINTS**2 * np.eye(3 * len(names))
    _place((mean, covariance), names, recorded, (learned.mean, learned.covariance))
    if {"hands_meanl", "hands_meanr"} <= body.extras.keys():
        space = pose_space(body)
        theirs = space.mean, _covariance(space, BESIDE_ON_A_BODY)
        _place((mean, covariance), names, space.joints, theirs)
    return mean, covariance


def _covariance(space: PoseSpace, beside: float) -> Array:
    rows = space.deviations[:, None] * space.components.reshape(space.n_components, -1)
    return np.asarray(rows.T @ rows + beside**2 * np.eye(rows.shape[1]))


def _place(
    into: tuple[Array, Array], names: Sequence[str], some: Sequence[str], own: tuple[Array, Array]
) -> None:
    """Write the Gaussian of some of the joints, the first in their own, to where they stand."""
    mean, covariance = into
    numbers = numbers_of(some, names)
    joints = numbers[::3] // 3
    n = len(numbers)
    mean[joints] = own[0].reshape(-1, 3)[: len(joints)]
    covariance[np.ix_(numbers, numbers)] = own[1][:n, :n]


def shape_prior(body: Body) -> Residual:
    """A standard normal prior on betas; those of soft tissue have `TISSUE_SIGMA`."""
    variances = np.ones(body.n_betas)
    variances[n_of_shape(body) :] = TISSUE_SIGMA**2
    return gaussian(body.blocks()[1].symbol, covariance=variances, name="shape prior")


def n_of_shape(body: Body) -> int:
    """How many of the first betas say who a person is; the others displace soft tissue."""
    return body.n_betas - int(body.extras.get("tissue", 0))


def usual_priors(body: Body) -> tuple[Residual, ...]:
    """The priors of a body's fits: on pose and shape, and the limits of the joints of its hands."""
    limited = (hand_limits().residual(body),) if hands_of(body) else ()
    return pose_prior(body), shape_prior(body), *limited


def stature(body: SkinnedBody, betas: ArrayLike) -> Array:
    """The height (...,) m of bodies with betas (..., B), from the lowest to the highest vertex.

    These are the vertices that are lowest and highest on the mean person, at rest; so stature is
    linear in betas. A person whose crown or sole is another vertex differs by millimetres.
    """
    mean, derivatives = _linear(body)
    return np.asarray(mean + np.asarray(betas, dtype=float) @ derivatives)


def stature_expression(body: SkinnedBody, betas: cs.MX) -> cs.MX:
    """`stature` in symbols, of betas (B, 1)."""
    mean, derivatives = _linear(body)
    return mean + cs.dot(cs.DM(derivatives), betas)


def stature_prior(body: SkinnedBody, height: float, *, sigma: float = MEASURED_SIGMA) -> Residual:
    """The residual of a measured height in metres, `sigma` its standard deviation.

    One image shows how large a person appears, and not how large or how far away; with a known
    stature, it shows the distance too. Raises BadArgument for a height of no person.
    """
    checked_height(height)
    betas: Block = body.blocks()[1]
    off = stature_expression(body, betas.symbol) - height
    return Residual("stature", off, sigma, "m", blocks=(betas,))


def checked_height(height: float) -> None:
    """Raise BadArgument for a height in metres of no person."""
    if not SHORTEST <= height <= TALLEST:
        hint = "; it is given in metres" if SHORTEST <= height / 100 <= TALLEST else ""
        raise BadArgument(
            f"a stature is between {SHORTEST:g} and {TALLEST:g} m, not {height:g}{hint}"
        )


def _linear(body: SkinnedBody) -> tuple[float, Array]:
    """The stature of the mean person in m, and what each of the betas adds to it, (B,)."""
    if reason := why_not_skinned(body, "a stature", "measure its vertices"):
        raise BadArgument(reason)
    y, derivatives = body.template[:, 1], body.shapedirs[:, 1]
    top, bottom = int(np.argmax(y)), int(np.argmin(y))
    return float(y[top] - y[bottom]), np.asarray(derivatives[top] - derivatives[bottom])
