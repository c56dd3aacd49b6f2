"""A synthetic person whose recorded pose goes through its own body, and is to be kept apart."""

import numpy as np

from workbench.blocks import Block
from workbench.bodies import SkinnedBody, capsule_gaps, capsule_points, capsules_of
from workbench.bodies.catalogue import load_body
from workbench.errors import BadArgument
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.setup import SECOND_ORDER, Measure, Setup, distances, rms
from workbench.priors.poses import draw_poses, shipped_mixture
from workbench.problem import Problem
from workbench.residuals import apart, landmarks

DRAWS = 100  # poses of which one is taken


def self_contact(
    body: str = "small",
    seed: int = 3,
    noise: float = 0.01,
    sigma: float = 0.001,
    depth: float = 0.03,
) -> Setup:
    """Fit a body to its joints, which noise of so many m moved, in a pose that penetrates itself.

    The pose is the one of `DRAWS` draws of the mixture of poses whose capsules overlap most nearly
    by `depth` m. What remains of the overlap has the standard deviation `sigma` in m.
    """
    model = load_body(body)
    if not isinstance(model, SkinnedBody):
        raise BadArgument(f"the body {body!r} has no capsules; take small or default")
    rng = np.random.default_rng(seed)
    poses = draw_poses(shipped_mixture(), DRAWS, rng)
    overlap = -capsule_gaps(model, poses).min(axis=1)
    taken = poses[int(np.argmin(abs(overlap - depth)))]
    pose, betas, trans = model.blocks()
    symbols = pose.symbol, betas.symbol, trans.symbol
    joints = model.joints(taken)
    observed = Block("observed", joints.shape, "m", model.joint_names)
    data = landmarks(model.joint_points(*symbols), observed.symbol, sigma=noise, name="joints")
    capsules, ends = capsules_of(model), capsule_points(model, *symbols)
    contact = apart(ends, capsules.radii_in(betas.symbol), capsules.pairs, sigma=sigma)
    priors = (pose_prior(model), shape_prior(model))
    at = model.start() | {observed.name: joints + noise * rng.standard_normal(joints.shape)}

    def measures(values: dict[str, np.ndarray]) -> tuple[Measure, ...]:
        found = [values[block.name] for block in model.blocks()]
        gaps = capsule_gaps(model, *found)
        deepest = int(np.argmin(gaps))
        pair = capsules.pair_names[deepest].replace("_", " ")
        return (
            Measure("deepest overlap", float(1e3 * max(0.0, -gaps[deepest])), "mm", pair),
            rms("joint to observation", distances(model.joints(*found), at[observed.name])),
        )

    return Setup(
        problem=Problem(
            (data, *priors, contact), [b.name for b in model.blocks()], blocks=(observed,)
        ),
        start=at,
        question=f"The joints of a pose (seed {seed}) in which the body goes through itself were "
        f"observed to {1e3 * noise:g} mm. Which pose near it keeps the limbs apart?",
        body=model,
        measures=measures,
        priors=("pose prior", "shape prior"),
        compared=SECOND_ORDER,
        synthetic="the pose is a draw of the prior, in which nothing keeps limbs apart; nobody was "
        "observed",
    )
