"""Shape from 3D joints alone: what 24 points say about ten numbers, and what they leave open."""

import numpy as np

from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument
from workbench.experiments.synthetic_people import MADE_OF_THE_MODEL, person_at_origin
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.compared_solvers import SECOND_ORDER
from workbench.fitting.landmarks import joint_fit
from workbench.fitting.setup import Setup


def shape_from_landmarks(
    body: str = "default", seed: int = 0, pose_sigma: float = 0.3, noise: float = 0.01
) -> Setup:
    """The joints in space of a posed and shaped body of the model (synthetic), with noise.

    `pose_sigma` in rad, `noise` in m, which is the residuals' sigma as well.
    """
    if not noise > 0:
        raise BadArgument(f"noise must be above zero metres, not {noise}; it is the sigma as well")
    model = load_skinned(body)
    rng = np.random.default_rng(seed)
    truth = person_at_origin(model, rng, pose_sigma)
    joints = model.joints(*truth.values())
    return joint_fit(
        model,
        joints + noise * rng.standard_normal(joints.shape),
        f"The {model.n_joints} joints of a body of the model (synthetic; pose {pose_sigma} rad, "
        f"shape 1 sd, seed {seed}) are known to {1e3 * noise:g} mm. What do they say about its "
        "shape, and what do they leave open?",
        sigma=noise,
        priors=(shape_prior(model), pose_prior(model)),
        truth=truth,
        compared=SECOND_ORDER,
        synthetic=MADE_OF_THE_MODEL,
    )
