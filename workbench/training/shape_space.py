"""The mean and the main directions of a population: template and shapedirs."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workbench.geometry.solids import volume
from workbench.training.mirror import Mirror

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ShapeSpace:
    """T(betas) = template + shapedirs betas; betas in standard deviations of the population."""

    template: Array  # (N, 3) m
    shapedirs: Array  # (N, 3, B) m
    explained: Array  # (B,): the share of the population's variance

    def betas(self, people: Array) -> Array:
        """The closest betas (P, B) to people (P, N, 3)."""
        basis = self.shapedirs.reshape(-1, self.shapedirs.shape[2])
        deviations = (people - self.template).reshape(len(people), -1)
        closest: Array = deviations @ basis / (basis**2).sum(axis=0)
        return closest


def learn_shape_space(
    people: Array, faces: NDArray[np.int64], mirror: Mirror | None, n_betas: int = 10
) -> ShapeSpace:
    """Principal components of un-posed people (P, N, 3) in m, alike on both sides if mirrored.

    The first is turned so that a positive beta is taller, the others so that it is heavier.
    """
    P, N, _ = people.shape
    mean = people.mean(axis=0)
    template = mean if mirror is None else (mean + mirror.points(mean)) / 2
    deviations = (people - template).reshape(P, -1)
    gram = deviations @ deviations.T
    last = [P - n_betas, P - 1]
    variances, coordinates = scipy.linalg.eigh(gram, subset_by_index=last)
    order = np.argsort(-variances)
    directions = (deviations.T @ coordinates[:, order]).reshape(N, 3, -1) / np.sqrt(P - 1)
    if mirror is not None:
        directions = (directions + mirror.directions(directions)) / 2
    return ShapeSpace(
        template=template,
        shapedirs=directions * _signs(template, directions, faces),
        explained=variances[order] / np.trace(gram),
    )


def _signs(template: Array, directions: Array, faces: NDArray[np.int64]) -> Array:
    def stature(v: Array) -> float:
        return float(np.ptp(v[:, 1]))

    signs = []
    for k, direction in enumerate(np.moveaxis(directions, 2, 0)):
        more, less = template + direction, template - direction
        grows = volume(more, faces) - volume(less, faces) if k else stature(more) - stature(less)
        signs.append(1.0 if grows > 0 else -1.0)
    return np.array(signs)
