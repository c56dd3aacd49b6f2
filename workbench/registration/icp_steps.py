"""Rigid ICP: what a distance costs, and the three forms of a step towards a surface."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.blocks.checks import above_zero
from workbench.errors import BadArgument
from workbench.geometry.rigid import Similarity, procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix


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
        above_zero("a robust loss", scale=self.scale)

    def costs(self, distances: Array) -> Array:
        """1/2 rho of distances (M,) m: (M,) m^2."""
        return distances**2 / (1 + (distances / self.scale) ** 2) / 2

    def weights(self, distances: Array) -> Array:
        """1 / (1 + (d / scale)^2)^2 of distances (M,) m."""
        return np.asarray((1 + (distances / self.scale) ** 2) ** -2)


Loss = LeastSquares | GemanMcClure
"""What distances cost: `costs` are 1/2 rho in m^2, `weights` what they count in a step, 0 to 1."""
TOUCHING = 1e-9  # m: below this the direction of a distance is rounding
UNSEEN = 1e-10  # of the largest eigenvalue of J'J: motions that change no distance


@dataclass(frozen=True, eq=False)
class Contacts:
    """Points where they are now, each with the closest place on the target.

    Attributes:
        points: (M, 3) m.
        closest: (M, 3) m, on the target.
        normals: (M, 3) unit normals of the target there; zeros where it has none.
        weights: (M,), at least 0, how much each counts.
    """

    points: Array
    closest: Array
    normals: Array
    weights: Array


Step = Callable[[Contacts], Similarity]


def point_to_point(contacts: Contacts) -> Similarity:
    """The motion of least squared distances |R p + t - x| from the contacts x, by Procrustes.

    Contacts and motion alternate (Besl and McKay 1992). Neither half raises the cost, so that it
    never rises. But the contacts pull points back that should slide along the surface, so that the
    convergence is linear and often slow.
    """
    return procrustes(contacts.points, contacts.closest, contacts.weights)


def point_to_plane(contacts: Contacts) -> Similarity:
    """The small motion of least squared distances n . (R p + t - x) from the tangent planes.

    R is linearized for the solution and then made a rotation (Chen and Medioni 1992; Low 2004).
    Points may slide. The cost can rise, and where contacts lie on edges or boundaries, the plane is
    another surface than the one whose distance is meant. Raises BadArgument if the target has no
    normals.
    """
    normals = contacts.normals
    if not normals.any():
        raise BadArgument(
            "point_to_plane needs normals of the target, which has none; give the point cloud "
            "normals, or take distance_gauss_newton or point_to_point"
        )
    r = np.einsum("mi,mi->m", normals, contacts.points - contacts.closest)
    return _linear_step(contacts, normals, r)


def distance_gauss_newton(contacts: Contacts) -> Similarity:
    r"""The step of Gauss-Newton on the distances d(R p + t) from the surface itself.

    It is linear in the motion along u = (p - x) / |p - x|, with the contact x and the direction u
    frozen: d ~ |p - x| + u . (w x p + v). That is no approximation of ICP's kind, because the
    derivative with both frozen *is* the derivative of the distance: d(p) = min over x of |p - x|,
    and at the closest place no move of x along the surface changes |p - x| to first order, at an
    edge or a boundary not downwards. So the move of the contact drops out, grad d = u, and only its
    second derivative, which Gauss-Newton leaves out in any case, knows of it (the envelope theorem;
    Danskin 1967). Contacts that are chosen anew at every step thus make Gauss-Newton on the true
    cost; contacts that are kept for several steps would be another problem. The distance is smooth
    except where the closest place jumps and on the surface, where its square still is; there u is
    the normal, and zero if the target has none.

    Inside of faces u is the normal up to its sign, and the step is that of `point_to_plane`. The
    two differ at edges, vertices and boundaries, and for point clouds, where this one is exact.
    """
    return _linear_step(contacts, *gauss_newton_directions(contacts))


def gauss_newton_directions(contacts: Contacts) -> tuple[Array, Array]:
    """u = (p - x) / |p - x| (N, 3) for points p with contacts x, and d = |p - x| (N,) in m."""
    off = contacts.points - contacts.closest
    d = np.linalg.norm(off, axis=1)
    apart = d > TOUCHING
    u = np.where(apart[:, None], off / np.where(apart, d, 1.0)[:, None], contacts.normals)
    return u, np.where(apart, d, 0.0)


def _linear_step(contacts: Contacts, directions: Array, r: Array) -> Similarity:
    """The motion of least sum of w (r + u . (w x p + v))^2, the shortest if several are.

    The turn w is about the mean of the points, in units of their spread, so that rotations
    and translations that no distance notices are told by one threshold.
    """
    weights = contacts.weights / contacts.weights.sum()
    centre = weights @ contacts.points
    arms = contacts.points - centre
    spread = float(np.sqrt(weights @ np.sum(arms**2, axis=1))) or 1.0
    J = np.column_stack([np.cross(arms / spread, directions), directions])  # (M, 6)
    H, g = J.T @ (weights[:, None] * J), J.T @ (weights * r)
    values, vectors = np.linalg.eigh(H)
    seen = values > UNSEEN * max(values[-1], np.finfo(float).tiny)
    step = -(vectors[:, seen] / values[seen]) @ (vectors[:, seen].T @ g)
    R = matrix_from_vector(step[:3] / spread)
    return Similarity(R, centre + step[3:] - R @ centre)


def part_of(motion: Similarity, share: float, centre: Array) -> Similarity:
    """A share of a rigid motion about a point (3,) m: of its turn, and of the way of that point."""
    R = matrix_from_vector(share * vector_from_matrix(motion.R))
    return Similarity(R, centre + share * (motion(centre) - centre) - R @ centre)
