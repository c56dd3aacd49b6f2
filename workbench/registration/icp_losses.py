"""How much a distance between a point and its contact costs, and how much it pulls.

A loss is 1/2 rho(d) in m^2, with rho(d) ~ d^2 where d is small. Its weight is rho'(d) / (2 d): in a
weighted least-squares step these weights give the gradient of the loss. As rho is concave in d^2,
the weighted squares lie above the loss and touch it at the present distances, so that a step which
does not raise them does not raise the loss either (iteratively reweighted least squares, Holland
and Welsch 1977). How much a point counts (its area, its confidence) is another number, which
multiplies both and is no part of the loss.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadArgument


class Loss(Protocol):
    """What distances cost."""

    def costs(self, distances: Array) -> Array:
        """1/2 rho of distances (M,) m: (M,) m^2."""

    def weights(self, distances: Array) -> Array:
        """How much each of the distances (M,) m counts in a least-squares step: (M,), 0 to 1."""


@dataclass(frozen=True)
class LeastSquares:
    """rho(d) = d^2: every point counts the same."""

    def costs(self, distances: Array) -> Array:
        """1/2 d^2 of distances (M,) m: (M,) m^2."""
        return distances**2 / 2

    def weights(self, distances: Array) -> Array:
        """Ones (M,): by least squares, every point counts the same."""
        return np.ones(len(distances))


@dataclass(frozen=True)
class GemanMcClure:
    """rho(d) = d^2 / (1 + (d / scale)^2), at most scale^2 however far a point is (1987).

    Attributes:
        scale: the distance, m, at which rho is half of what it can be. It says where outliers
            begin, and says nothing about the noise of the others.

    Raises BadArgument for a scale that is not above zero.

    >>> GemanMcClure(0.02).weights(np.array([0.0, 0.02, 2.0])).round(4)
    array([1.  , 0.25, 0.  ])
    """

    scale: float

    def __post_init__(self) -> None:
        if not 0 < self.scale < np.inf:
            raise BadArgument(f"the scale of a robust loss must be above 0 m, not {self.scale}")

    def costs(self, distances: Array) -> Array:
        """1/2 rho of distances (M,) m: (M,) m^2."""
        return distances**2 / (1 + (distances / self.scale) ** 2) / 2

    def weights(self, distances: Array) -> Array:
        """1 / (1 + (d / scale)^2)^2 of distances (M,) m."""
        return np.asarray((1 + (distances / self.scale) ** 2) ** -2)


@dataclass(frozen=True)
class Trimmed:
    """The squares of the smallest distances alone (Chetverikov et al. 2002).

    Attributes:
        share: the share of the points that count, above 0 and at most 1. It should be below the
            share of the points that have a counterpart. Points are counted whatever their weight,
            so that only with equal weights the cost of alternation never rises.

    Raises BadArgument for another share.

    >>> Trimmed(0.5).weights(np.array([0.01, 0.3, 0.02, 0.5]))
    array([1., 0., 1., 0.])
    """

    share: float

    def __post_init__(self) -> None:
        if not 0 < self.share <= 1:
            raise BadArgument(
                f"the share of points that count must be above 0 and at most 1, not {self.share}"
            )

    def costs(self, distances: Array) -> Array:
        """1/2 d^2 of the smallest of the distances (M,) m, and 0 for the others: (M,) m^2."""
        return self.weights(distances) * distances**2 / 2

    def weights(self, distances: Array) -> Array:
        """1 for the smallest of the distances (M,) m, and 0 for the others."""
        kept = max(1, round(self.share * len(distances)))
        weights = np.zeros(len(distances))
        weights[np.argsort(distances, kind="stable")[:kept]] = 1.0
        return weights
