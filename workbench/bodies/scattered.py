"""Blend shapes between examples: features that say how near a pose is to each of n known ones.

Scattered data interpolation (Lewis, Cordner, Fong, SIGGRAPH 2000): posedirs (N, 3, n) hold a shape
for every example, and f_i(theta) is its share. What it costs grows with n, and far from all
examples it knows nothing.

The lecture of Pons-Moll and Swoboda (Body Models II, 2018) writes the kernel as
exp(-|x - x_i|^2 / tau). Here it is exp(-|x - x_i|^2 / width^2): the same with tau = width^2, so
that what is asked for has the unit of x.
"""

from dataclasses import dataclass

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.bodies.features import Features, Posture, rotation_vectors
from workbench.bodies.owned import owned
from workbench.errors import BadArgument

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Examples:
    """Where the examples are: `places` (n, D) in the space of `of`, and the kernel's width there.

    The width is the root of the tau with which the kernel is also written, exp(-|x - x_i|^2 / tau).
    Raises BadArgument for a width that is not positive, NotNumbers for places that are none.
    """

    places: Array
    width: float  # rad, for rotation vectors: a kernel falls to 1/e at this distance
    of: Features = rotation_vectors

    def __post_init__(self) -> None:
        if not self.width > 0:
            raise BadArgument(f"the width of a kernel must be positive, not {self.width}")
        self.__dict__["places"] = owned("the places of examples", self.places)

    def exponents(self, at: Posture) -> cs.MX:
        """-|x - x_i|^2 / width^2, (n, 1)."""
        x = self.of(at)
        away = cs.MX(cs.DM(self.places)) - cs.repmat(x.T, len(self.places), 1)
        return -cs.sum2(away**2) / self.width**2

    def matrix(self) -> Array:
        """exp(-|x_i - x_j|^2 / width^2), (n, n)."""
        away = self.places[:, None] - self.places
        return np.asarray(np.exp(-np.sum(away**2, axis=2) / self.width**2))


@dataclass(frozen=True, eq=False)
class Gaussians:
    """f_i = exp(-|x - x_i|^2 / width^2): far from every example all of them are 0."""

    examples: Examples

    def __call__(self, at: Posture) -> cs.MX:
        """(n, 1), each between 0 and 1."""
        return cs.exp(self.examples.exponents(at))

    def exactly(self, shapes: Array) -> Array:
        """Posedirs (N, 3, n) with which the examples' own shapes (n, N, 3) come out exactly.

        The matrix of kernels between examples is solved for them. Raises BadArgument where two
        examples are so close, or the width so large, that it cannot be.
        """
        n, N, _ = shapes.shape
        kernels = self.examples.matrix()
        try:
            factor = np.linalg.cholesky(kernels)
        except np.linalg.LinAlgError:
            raise BadArgument(
                f"{n} examples cannot be told apart by kernels of width {self.examples.width:.3g}; "
                "take a smaller width, or leave out examples that are the same"
            ) from None
        flat = np.linalg.solve(factor.T, np.linalg.solve(factor, shapes.reshape(n, -1)))
        return np.ascontiguousarray(flat.reshape(n, N, 3).transpose(1, 2, 0))


@dataclass(frozen=True, eq=False)
class Shares:
    """The same divided by their sum: far from every example the nearest one has it all."""

    examples: Examples

    def __call__(self, at: Posture) -> cs.MX:
        """(n, 1), positive, of sum one."""
        exponents = self.examples.exponents(at)
        return cs.exp(exponents - cs.logsumexp(exponents))


def shapes_as_directions(shapes: Array) -> Array:
    """Shapes (n, N, 3) as posedirs (N, 3, n)."""
    return np.ascontiguousarray(shapes.transpose(1, 2, 0))
