"""The mean and the main directions of a population: template and shapedirs."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Index
from workbench.geometry.mirror import Mirror
from workbench.geometry.solids import volume


@dataclass(frozen=True, eq=False)
class ShapeSpace:
    """T(betas) = template + shapedirs betas; betas in standard deviations of the population.

    Attributes:
        template: (N, 3) in metres.
        shapedirs: (N, 3, B) in metres per unit of betas.
        explained: (B,) the share of the population's variance.
    """

    template: Array
    shapedirs: Array
    explained: Array

    def betas(self, people: Array) -> Array:
        """The betas (P, B) of the shapes closest to people (P, N, 3) m."""
        basis = self.shapedirs.reshape(-1, self.shapedirs.shape[2])
        deviations = (people - self.template).reshape(len(people), -1)
        closest: Array = deviations @ basis / (basis**2).sum(axis=0)
        return closest


def learn_shape_space(
    people: Array, faces: Index, mirror: Mirror | None, n_betas: int = 10
) -> ShapeSpace:
    """The principal components of un-posed people (P, N, 3) m, symmetric if there is a mirror.

    The sign of the first makes a positive beta taller; those of the others make it heavier.
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


def _signs(template: Array, directions: Array, faces: Index) -> Array:
    def stature(v: Array) -> float:
        return float(np.ptp(v[:, 1]))

    signs = []
    for k, direction in enumerate(np.moveaxis(directions, 2, 0)):
        more, less = template + direction, template - direction
        grows = volume(more, faces) - volume(less, faces) if k else stature(more) - stature(less)
        signs.append(1.0 if grows > 0 else -1.0)
    return np.array(signs)
