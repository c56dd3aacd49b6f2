"""Features of other kinds: kernels around examples, which say how near a pose is to each; powers.

Scattered data interpolation (Lewis, Cordner, Fong, Pose Space Deformation, SIGGRAPH 2000): posedirs
(N, 3, n) hold a shape for every example, and the feature f_i(theta) is its coefficient. The cost
grows with n, and far from all examples nothing is known.

The lecture of Pons-Moll and Swoboda (Body Models II, 2018) writes the kernel as
exp(-|x - x_i|^2 / tau). Here it is exp(-|x - x_i|^2 / width^2): the same with tau = width^2, so
that the width has the unit of x.
"""

from dataclasses import dataclass

import casadi as cs
import numpy as np
import scipy.linalg

from workbench.arrays import Array
from workbench.bodies.forward.surface import Features, Posture, rotation_vectors
from workbench.bodies.readonly import readonly
from workbench.errors import BadArgument


@dataclass(frozen=True, eq=False)
class Examples:
    """Where the examples are, and how wide the kernel around each of them is.

    Raises BadArgument for a width that is not positive, NotNumbers for places that are no numbers.

    Attributes:
        places: (n, D), the features `of` at each example.
        width: in the unit of these features, rad for rotation vectors; at this distance a kernel
            has fallen to 1/e.
        of: the features in whose space distances are measured.
    """

    places: Array
    width: float
    of: Features = rotation_vectors

    def __post_init__(self) -> None:
        if not self.width > 0:
            raise BadArgument(f"the width of a kernel must be positive, not {self.width}")
        self.__dict__["places"] = readonly("the places of examples", self.places)

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
class GaussianKernels:
    """f_i = exp(-|x - x_i|^2 / width^2): far from every example all of them are 0."""

    examples: Examples

    def __call__(self, at: Posture) -> cs.MX:
        """The features (n, 1), each between 0 and 1."""
        return cs.exp(self.examples.exponents(at))

    def interpolating(self, shapes: Array) -> Array:
        """Posedirs (N, 3, n) that reproduce the shapes (n, N, 3) of the examples exactly.

        They solve the linear system whose matrix holds the kernels between examples. Raises
        BadArgument where two examples are so close, or the width so large, that it is singular.
        """
        n, N, _ = shapes.shape
        try:
            factor = scipy.linalg.cho_factor(self.examples.matrix(), lower=True)
        except scipy.linalg.LinAlgError:
            raise BadArgument(
                f"{n} examples cannot be told apart by kernels of width {self.examples.width:.3g}; "
                "take a smaller width, or leave out examples that are the same"
            ) from None
        return as_posedirs(scipy.linalg.cho_solve(factor, shapes.reshape(n, -1)).reshape(n, N, 3))


@dataclass(frozen=True, eq=False)
class NormalisedKernels:
    """Gaussian kernels divided by their sum: far from every example the nearest one has it all."""

    examples: Examples

    def __call__(self, at: Posture) -> cs.MX:
        """The features (n, 1), positive and of sum one."""
        exponents = self.examples.exponents(at)
        return cs.exp(exponents - cs.logsumexp(exponents))


def as_posedirs(shapes: Array) -> Array:
    """Shapes (n, N, 3) in the order of axes of posedirs, (N, 3, n)."""
    return np.ascontiguousarray(shapes.transpose(1, 2, 0))


@dataclass(frozen=True)
class Powers:
    """x, x^2, ..., x^degree of every number x of theta by itself: F = 3 (K - 1) degree."""

    degree: int

    def __call__(self, at: Posture) -> cs.MX:
        """The features (F, 1), in powers of rad."""
        x = rotation_vectors(at)
        return cs.vertcat(*[x**power for power in range(1, self.degree + 1)])


def products(at: Posture) -> cs.MX:
    """x and all products x y of two numbers of theta: F = n + n (n + 1) / 2, n = 3 (K - 1)."""
    x = rotation_vectors(at)
    rows, columns = np.triu_indices(x.shape[0])
    return cs.vertcat(x, x[rows.tolist()] * x[columns.tolist()])
