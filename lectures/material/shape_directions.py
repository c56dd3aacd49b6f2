"""The directions of the shape space, and where joints go with them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.bodies.skinned import SkinnedBody


def along(body: SkinnedBody, direction: int, amount: float) -> Array:
    """Betas (B,) of one direction alone, `amount` in its unit, standard deviations."""
    betas = np.zeros(body.n_betas)
    betas[direction] = amount
    return betas


def joint_moves(body: SkinnedBody, betas: Sequence[float] | Array) -> Array:
    """How far each joint is from the mean person's, (K,) m."""
    moved: Array = np.linalg.norm(body.joints(betas=betas) - body.joints(), axis=1)
    return moved


def with_joints_of_the_mean(body: SkinnedBody, betas: Sequence[float] | Array) -> SkinnedBody:
    """The person of these betas on the mean person's skeleton, which J(beta) prevents.

    Its joint regressor has the smallest rows that give the mean person's joints from this surface.
    """
    person = body.vertices(betas=betas)
    points = np.column_stack([person, np.ones(len(person))])
    wanted = np.column_stack([body.joints(), np.ones(body.n_joints)])
    rows = np.linalg.lstsq(points.T, wanted.T, rcond=None)[0].T
    return replace(
        body,
        template=person,
        shapedirs=np.zeros_like(body.shapedirs),
        J_regressor=csr_array(rows),
        name=f"{body.name} on the mean's joints",
    )
