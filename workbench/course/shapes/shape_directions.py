"""The shape space: its directions, what they explain, and where joints go with them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.bodies.skinned import SkinnedBody


def along(body: SkinnedBody, direction: int, amount: float) -> Array:
    """Betas (B,) of one direction alone, `amount` in its unit, standard deviations."""
    betas = np.zeros(body.n_betas)
    betas[direction] = amount
    return betas


def variances(body: SkinnedBody) -> Array:
    """The variance that each direction gives the surface, (B,) m^2 summed over coordinates.

    With betas in standard deviations, as in SMPL's files, it is the column's squared length.
    """
    return np.asarray(np.sum(body.shapedirs**2, axis=(0, 1)))


def reconstruction_errors(body: SkinnedBody, people: ArrayLike) -> Array:
    """The rms distance of vertices after fitting 0, 1, ..., B directions: (B + 1, P) m.

    People (P, N, 3) m are at rest, and their betas are the best ones. They may stand anywhere,
    because their mean point is moved to the template's.
    """
    shapes = np.asarray(people, dtype=float) - body.template
    shapes = (shapes - shapes.mean(axis=1, keepdims=True)).reshape(len(shapes), -1)
    S = body.shapedirs - body.shapedirs.mean(axis=0)
    flat = S.reshape(-1, body.n_betas)
    found = [shapes]
    for b in range(1, body.n_betas + 1):
        Q, _ = np.linalg.qr(flat[:, :b])
        found.append(shapes - (shapes @ Q) @ Q.T)
    return np.asarray([np.linalg.norm(rest, axis=1) / np.sqrt(body.n_vertices) for rest in found])


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
