"""Fitting a body to the positions of its joints in space."""

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.fitting.setup import Measure, Setup, distances, rms
from workbench.problem import Problem
from workbench.residuals import Residual, landmarks


def joint_fit(
    body: SkinnedBody | TriangleBody,
    observed: Array,
    question: str,
    *,
    sigma: float,
    priors: tuple[Residual, ...] = (),
    start: Values | None = None,
    truth: Values | None = None,
    compared: tuple[str, ...] = (),
    synthetic: str = "",
) -> Setup:
    """Fit pose, betas and trans to the positions (K, 3) m of a body's joints; sigma is in m.

    `truth` holds pose, betas and trans of the body of which synthetic joints were made; with it,
    distances are measured from that body. `synthetic` says in a sentence what was made up.
    """
    pose, betas, trans = body.blocks()
    target = Block("observed", observed.shape, "m", body.joint_names)
    points = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
    data = landmarks(points, target.symbol, sigma=sigma, name="joints")
    surface = None if truth is None else body.vertices(*truth.values())

    def measures(values: Values) -> tuple[Measure, ...]:
        found = [values[block.name] for block in body.blocks()]
        joints = body.joints(*found)
        if truth is None or surface is None:
            return (rms("joint to observation", distances(joints, observed)),)
        return (
            rms("joint to synthetic truth", distances(joints, body.joints(*truth.values()))),
            rms("vertex to synthetic truth", distances(body.vertices(*found), surface)),
            rms("betas to synthetic truth", values[betas.name] - truth[betas.name], "sd"),
        )

    return Setup(
        problem=Problem((data, *priors), ("pose", "betas", "trans"), blocks=(target,)),
        start=body.start() | (start or {}) | {target.name: observed},
        question=question,
        body=body,
        truth=surface,
        measures=measures,
        priors=tuple(prior.name for prior in priors),
        compared=compared,
        synthetic=synthetic,
        made_of=truth,
    )
