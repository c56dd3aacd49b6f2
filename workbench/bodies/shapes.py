"""The shape space: its directions, what they explain, and where joints go with them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from workbench.bodies.skinned import SkinnedBody

Array = NDArray[np.float64]


def along(body: SkinnedBody, direction: int, amount: float) -> Array:
    """Betas (B,) of one direction alone, `amount` in its unit, standard deviations."""
    betas = np.zeros(body.n_betas)
    betas[direction] = amount
    return betas


def variances(body: SkinnedBody) -> Array:
    """Of each direction the variance it gives the surface, m^2 summed over coordinates, (B,).

    With betas in standard deviations, as in SMPL's files, it is the column's squared length.
    """
    return np.asarray(np.sum(body.shapedirs**2, axis=(0, 1)))


def left_over(body: SkinnedBody, people: ArrayLike) -> Array:
    """What the first 0, 1, ..., B directions leave of people (P, N, 3) m at rest: (B + 1, P) m.

    Root mean square distance of vertices after the best betas; people may stand anywhere, for
    their mean point is brought to the template's.
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
    """By how much each joint stands elsewhere than the mean person's, (K,) m."""
    moved: Array = np.linalg.norm(body.joints(betas=betas) - body.joints(), axis=1)
    return moved


def with_joints_of_the_mean(body: SkinnedBody, betas: Sequence[float] | Array) -> SkinnedBody:
    """The person of these betas on the mean person's skeleton: what J(beta) is there to prevent.

    Its joints are regressed by the rows, as small as can be, that give the mean's from this skin.
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
