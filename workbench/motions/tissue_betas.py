"""Soft tissue as further betas of a body, so that whatever shows a body shows its tissue.

Tissue is displaced at rest, before skinning, as betas displace the surface. It moves no joint,
which betas do through the joint regressor; so the body gets a regressor that finds the same joints
for all of its own betas and does not see the tissue.
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.motions.motion import Motion
from workbench.motions.soft_tissue import SoftTissue


def with_tissue(body: SkinnedBody, tissue: SoftTissue) -> SkinnedBody:
    """The body with B + C betas, the last C of which displace its tissue and move no joint.

    The regressor is the one nearest to the body's of those that give its joints (least squares).
    """
    N = body.n_vertices
    seen = np.hstack([np.ones((N, 1)), body.template, body.shapedirs.reshape(N, -1)])
    every = np.hstack([seen, tissue.directions.reshape(N, -1)])
    wanted = np.zeros((body.n_joints, every.shape[1]))
    wanted[:, : seen.shape[1]] = body.J_regressor @ seen
    change = np.linalg.lstsq(every.T, (wanted - body.J_regressor @ every).T)[0].T
    return replace(
        body,
        shapedirs=np.concatenate([body.shapedirs, tissue.directions], axis=2),
        J_regressor=csr_array(body.J_regressor.toarray() + change),
        capsules=None,
        name=f"{body.name} with soft tissue",
    )


def betas_with_tissue(
    body: SkinnedBody, tissue: SoftTissue, motion: Motion, exaggeration: float = 1.0
) -> Array:
    """The betas (T, B + C) of `with_tissue` in a motion of the tissue's rate, frame by frame.

    Raises BadArgument for another rate or another body.
    """
    phi = tissue.coefficients(body, motion)
    gain = exaggeration * tissue.gain(body, motion.named(body).betas)
    own = np.broadcast_to(motion.betas_on(body), (len(motion), body.n_betas))
    return np.hstack([own, gain * phi])


def displaced_by(tissue: SoftTissue, betas: Array) -> Array:
    """How far tissue is displaced at rest, (T, N, 3) m, by betas (T, B + C) of a body with it."""
    phi = betas[:, betas.shape[1] - tissue.n_coefficients :]
    displaced: Array = np.einsum("tc,ndc->tnd", phi, tissue.directions)
    return displaced
