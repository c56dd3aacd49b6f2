"""People drawn from the model itself, where to begin looking for them, and what is then known.

All of them are synthetic: nobody was measured.
"""

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument
from workbench.experiments.keypoint_fit import learned_poses
from workbench.experiments.known import Known
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.problem import Problem
from workbench.solvers import Ipopt, LevenbergMarquardt

Array = NDArray[np.float64]
TRANS_SIGMA = 0.2  # m
TIGHT = 1e-9  # of the gradient: costs are then known to more digits than anybody compares


def bent_person(body: SkinnedBody, rng: np.random.Generator, pose_sigma: float) -> Values:
    """Every joint turned by pose_sigma rad per axis, shape 1 sd, moved by 0.2 m per axis."""
    return _named(
        body,
        body.bind_pose + pose_sigma * rng.standard_normal((body.n_joints, 3)),
        rng.standard_normal(body.n_betas),
        TRANS_SIGMA * rng.standard_normal(3),
    )


def likely_person(body: SkinnedBody, rng: np.random.Generator) -> Values:
    """A draw from what the priors of a keypoint fit say: nobody is surprised by the answer.

    The root, which has no prior, is turned by 0.3 rad per axis.
    """
    found = bent_person(body, rng, 0.3)
    pose = body.blocks()[0].name
    if body.n_joints == 24:
        mean, covariance = learned_poses()
        drawn = mean + np.linalg.cholesky(covariance) @ rng.standard_normal(mean.size)
        found[pose] = np.vstack([found[pose][:1], drawn.reshape(23, 3)])
    return found


def beginning(body: SkinnedBody, seed: int, start: int, sigma: float) -> Values:
    """Start 0 is the template at the origin; the k-th other one is `sigma` rad off it per axis.

    It also has another shape and place, and depends on the person's seed, and on nothing else:
    every solver begins there.
    """
    if start < 0:
        raise BadArgument(f"start must be from 0 on, not {start}")
    if start == 0:
        return body.start()
    return bent_person(body, np.random.default_rng((seed, start)), sigma)


def made_of(body: SkinnedBody, truth: Values) -> Known:
    """That data without noise are explained by the person that they were made of.

    Rotations are told by angles up to half a turn: a whole turn more is the same body.
    """
    pose = body.blocks()[0].name
    turns = vector_from_matrix(matrix_from_vector(truth[pose]))
    return Known("the synthetic person that the data were made of", 0.0, truth | {pose: turns})


def polished(problem: Problem, start: Values, truth: Values) -> Known:
    """What a solver finds that begins at the person whom noisy data were made of."""
    solver = Ipopt(gradient_tolerance=TIGHT) if problem.bounded else LevenbergMarquardt(
        gradient_tolerance=TIGHT, max_iterations=500
    )  # fmt: skip
    found = solver.solve(problem, start | truth)
    how = f"{found.solver} from the synthetic person that the data were made of"
    return Known(f"{how}; no proof that there is none lower", found.cost, found.values)


def _named(body: SkinnedBody, *numbers: Array) -> Values:
    return dict(zip((block.name for block in body.blocks()), numbers, strict=True))
