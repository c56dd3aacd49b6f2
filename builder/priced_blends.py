"""Pose blend shapes whose price grows with the distance from the joint, along the surface.

Romero, Tzionas and Black (Embodied Hands, 2017) made those of MANO local in this way: on a hand
every joint is near every other one in the tree, so that a number of bones says little.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from builder.local_blends import errors_at_rest
from workbench.arrays import Array, Mask
from workbench.geometry.solids import along_edges
from workbench.training.blend_shapes import Sums, local_features
from workbench.training.estimate import Estimate
from workbench.training.first_guess import Start
from workbench.training.objective import Objective
from workbench.training.registrations import training_and_held_out

RIDGES = (1e-5, 1e-4, 1e-3)  # per pose, at the joint
PRICES = (
    1.0,
    10.0,
    30.0,
    100.0,
    300.0,
    1000.0,
)  # how many times the ridge, more, at the distance FAR
FAR = 0.04  # m
MOST = 0.07  # of squared posedirs, farther than FAR: a finished hand, a larger one, has more
REACH = 2  # bones from a joint that carries a vertex


@dataclass(frozen=True, eq=False)
class PricedBlends:
    """Posedirs, and how they were chosen.

    Attributes:
        posedirs: (N, 3, 9 (K - 1)) m.
        ridge: per pose, at the joint itself.
        price: the factor on the ridge at `FAR`, less one.
        far: the share of squared posedirs farther than `FAR` from their joints.
    """

    posedirs: Array
    ridge: float
    price: float
    far: float


def joint_distances(start: Start, joints: Array) -> Array:
    """From each joint but the root to every vertex, (N, K - 1) m.

    The larger of two distances: along edges from the ring where the joint's segment begins, and
    straight from the joint, whose places `joints` (K, 3) m are on the template of `start`.
    """
    rings = start.rings()
    sources = [rings[[k]].nonzero()[1].astype(np.int64) for k in range(1, len(start.parents))]
    along = along_edges(start.template, start.faces, sources).T
    straight = np.linalg.norm(start.template[:, None] - joints[None, 1:], axis=2)
    return np.asarray(np.maximum(along, straight))


def far_share(posedirs: Array, distances: Array) -> float:
    """The share of squared posedirs of joints farther than `FAR` from a vertex."""
    energy = (posedirs.reshape(len(posedirs), 3, -1, 9) ** 2).sum(axis=(1, 3))
    return float(energy[distances > FAR].sum() / energy.sum())


def priced_posedirs(
    objective: Objective,
    estimate: Estimate,
    start: Start,
    ridges: Sequence[float] = RIDGES,
    prices: Sequence[float] = PRICES,
) -> PricedBlends:
    """The blend shapes that explain held-out subjects best, of those that are local.

    Of all pairs of a ridge and a price, those are tried whose posedirs have at most the share
    `MOST` farther than `FAR` from their joints; if none has, the most local ones are taken.
    """
    learned, held_out = (
        Sums.of(errors_at_rest(objective, estimate, rows))
        for rows in training_and_held_out(objective.registrations.subject)
    )
    mean = estimate.templates.mean(axis=0), estimate.joints.mean(axis=0)
    distances = joint_distances(replace(start, template=mean[0]), mean[1])
    support = local_features(estimate.weights, estimate.parents, REACH)

    def tried() -> Iterator[tuple[bool, float, float, float]]:
        for ridge, price in product(ridges, prices):
            found = solved(learned, support, distances, ridge, price)
            far = far_share(found, distances)
            local = far <= MOST
            yield not local, held_out.error(found) if local else far, ridge, price

    _, _, ridge, price = min(tried())
    posedirs = solved(learned + held_out, support, distances, ridge, price)
    return PricedBlends(posedirs, ridge, price, far_share(posedirs, distances))


def solved(sums: Sums, support: Mask, distances: Array, ridge: float, price: float) -> Array:
    """Posedirs (N, 3, F) m by ridge regression, with a ridge of its own for each entry.

    It is ridge (1 + price (d / FAR)^4) for a vertex at the distance d (N, K - 1) m from the joint.
    """
    found = np.zeros_like(sums.products)
    prices = ridge * sums.n_poses * (1 + price * (distances / FAR) ** 4)
    for v, (features, own_prices) in enumerate(zip(support, prices, strict=True)):
        own = np.flatnonzero(features)
        gram = sums.features[np.ix_(own, own)] + np.diag(np.repeat(own_prices, 9)[own])
        found[v][:, own] = np.linalg.solve(gram, sums.products[v][:, own].T).T
    return found
