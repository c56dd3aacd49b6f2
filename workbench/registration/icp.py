"""Rigid registration of points to a fixed surface or point cloud by iterated closest points.

Two steps are repeated: `Target.closest` finds contacts, and a form, a function of `icp_steps`,
turns them into a motion. A step that raises the cost is halved.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from workbench.arrays import Array, Mask
from workbench.blocks.checks import from_zero
from workbench.errors import BadArgument
from workbench.geometry.rigid import Similarity
from workbench.geometry.surface_tree import ClosestPoints, SurfaceTree
from workbench.registration.icp_steps import (
    Contacts,
    LeastSquares,
    Loss,
    Step,
    distance_gauss_newton,
    part_of,
)

MOST_TRIED = 16  # nearest points of a cloud among which one that faces the right way is looked for


def _vectors(name: str, vectors: ArrayLike, count: int | None = None) -> Array:
    """Finite vectors (M, 3); of so many points, if the count is known. Raises BadArgument."""
    numbers = np.asarray(vectors, dtype=float)
    if numbers.shape != (count or len(np.atleast_1d(numbers)), 3) or not numbers.size:
        shape = "M, 3), with M at least 1" if count is None else f"{count}, 3), one for each point"
        raise BadArgument(f"{name} must be an array ({shape}, not {numbers.shape}")
    if not np.isfinite(numbers).all():
        raise BadArgument(f"{name} must be finite; leave out what was not measured")
    return numbers


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points (N, 3) m, with unit normals (N, 3) or without, as a target.

    Attributes:
        points: (N, 3) m.
        normals: (N, 3); without them, distances have no direction to compare with.

    Raises BadArgument for arrays of other shapes, or with numbers that are not finite.
    """

    points: Array
    normals: Array | None = None

    def __post_init__(self) -> None:
        self.__dict__["points"] = _vectors("points of a cloud", self.points)
        if self.normals is not None:
            count = len(self.points)
            self.__dict__["normals"] = _vectors("normals of a cloud", self.normals, count)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    def closest(
        self,
        points: Array,
        within: float = np.inf,
        normals: Array | None = None,
        facing: float = 0.5,
    ) -> ClosestPoints:
        """The nearest point of the cloud to each of M points (M, 3) m.

        It is within `within` m, and if both sides have normals, theirs have a cosine of at least
        `facing`; of the nearest 16 points the first such one is taken. `faces` holds the numbers
        of the points, -1 where there is none. Distances are not negative, as a cloud has no inside.
        """
        compared = normals is not None and self.normals is not None
        count = min(MOST_TRIED, len(self.points)) if compared else 1
        neighbours = self._tree.query(points, k=[*range(1, count + 1)], distance_upper_bound=within)
        distances, numbers = np.asarray(neighbours[0]), np.asarray(neighbours[1])  # (M, count) both
        candidate = np.isfinite(distances)
        numbers = np.where(candidate, numbers, 0)
        if normals is not None and self.normals is not None:
            candidate &= np.einsum("mi,mki->mk", normals, self.normals[numbers]) >= facing
        rows, first = np.arange(len(points)), candidate.argmax(axis=1)
        has_contact, chosen = candidate[rows, first], numbers[rows, first]
        normals_there = np.zeros_like(self.points) if self.normals is None else self.normals
        mask = has_contact[:, None]
        return ClosestPoints(
            faces=np.where(has_contact, chosen, -1),
            shares=mask * np.array([1.0, 0.0, 0.0]),
            points=np.where(mask, self.points[chosen], points),
            distances=np.where(has_contact, distances[rows, first], within),
            normals=np.where(mask, normals_there[chosen], 0.0),
        )


Target = SurfaceTree | PointCloud
"""What points are registered to: what has their method `closest`."""
STAY = Similarity(np.eye(3), np.zeros(3))
SQUARES = LeastSquares()


class Stopped(Enum):
    """Why a registration stopped."""

    SETTLED = "no point moves any more"
    NO_LOWER = "no part of the step lowers the cost; contacts switch here"
    OUT_OF_ITERATIONS = "the points still move; allow more iterations"
    NO_CONTACT = "no point has a contact; begin nearer, widen the gate or turn the normals round"


@dataclass(frozen=True, eq=False)
class IcpIterate:
    """A motion of the points as they were given, with the contacts there in a few numbers.

    Attributes:
        cost: m^2, half the sum of losses times weights. A point without a contact costs what one
            at the gate does; without a gate, it costs nothing.
        rms: m, the root mean square of the distances in contact; NaN if there are none.
        in_contact: the share of points that have a contact.
        moved: m, how far the point that moved farthest came from the iterate before.
    """

    motion: Similarity
    cost: float
    rms: float
    in_contact: float
    moved: float


@dataclass(frozen=True, eq=False)
class Alignment:
    """Where points were moved to by `Icp.align`.

    Attributes:
        motion: the rigid motion from the points as they were given.
        stopped: why the registration stopped.
        trace: all iterates, the start first and the end last.
    """

    motion: Similarity
    stopped: Stopped
    trace: tuple[IcpIterate, ...] = field(repr=False)

    @property
    def R(self) -> Array:
        """(3, 3), the rotation."""
        return self.motion.R

    @property
    def t(self) -> Array:
        """(3,) m, the translation after the rotation."""
        return self.motion.t

    @property
    def iterations(self) -> int:
        """The number of steps."""
        return len(self.trace) - 1

    @property
    def cost(self) -> float:
        """m^2, at the end; see `IcpIterate`."""
        return self.trace[-1].cost

    @property
    def rms(self) -> float:
        """m, the root mean square of the distances of points in contact."""
        return self.trace[-1].rms

    @property
    def in_contact(self) -> float:
        """The share of points that have a contact at the end."""
        return self.trace[-1].in_contact


@dataclass(frozen=True)
class Icp:
    """Points move rigidly onto a target: contacts, a step, new contacts, until nothing moves.

    Attributes:
        step: the form: `distance_gauss_newton`, `point_to_plane`, `point_to_point`, or a function
            of yours from contacts to a motion.
        loss: what distances cost: `LeastSquares()` or `GemanMcClure(scale)`.
        gate: m; a point that is farther from the target has no contact.
        facing: the least cosine between the normals of a point and of its contact.
        max_iterations: at most so many steps.
        tolerance: m; the registration ends when no point moves farther than this.
        halvings: how often a step that raises the cost is halved, as Gauss-Newton's can far from
            the target. If even the shortest of these steps raises the cost, the registration ends.
            With 0, steps are taken as they are, as `point_to_plane` does in the papers.

    >>> from workbench.registration import PointCloud
    >>> cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1.5)])
    >>> found = Icp().align(cube + [0.1, 0.0, -0.2], PointCloud(cube))
    >>> found.t.round(6), found.stopped.name
    (array([-0.1,  0. ,  0.2]), 'SETTLED')
    """

    step: Step = distance_gauss_newton
    loss: Loss = SQUARES
    gate: float = np.inf
    facing: float = 0.5
    max_iterations: int = 200
    tolerance: float = 1e-6
    halvings: int = 5

    def __post_init__(self) -> None:
        counts = {"max_iterations": self.max_iterations, "halvings": self.halvings}
        from_zero("ICP", tolerance=self.tolerance, **counts)
        if not self.gate > 0:
            raise BadArgument(f"the gate must be a distance above 0 m, not {self.gate}")

    def align(
        self,
        points: ArrayLike,
        target: Target,
        start: Similarity = STAY,
        *,
        weights: ArrayLike | None = None,
        normals: ArrayLike | None = None,
        callback: Callable[[IcpIterate], None] | None = None,
    ) -> Alignment:
        """The motion that takes points (M, 3) m onto the target, from a rigid start.

        `weights` (M,) say how much each point counts; `normals` (M, 3) turn with the points, and
        contacts must face the same way. `callback` sees every iterate. Raises BadArgument for
        arrays that do not fit or are not finite, and for a start with a scale.
        """
        places = _vectors("points", points)
        M = len(places)
        counts = np.ones(M) if weights is None else np.asarray(weights, dtype=float)
        if counts.shape != (M,) or not np.isfinite(counts).all():
            raise BadArgument(f"weights must be {M} finite numbers, one for each point")
        if (counts < 0).any() or not counts.any():
            raise BadArgument("weights must be at least 0, and one of them above 0")
        if start.scale != 1:
            raise BadArgument(f"the start must be rigid, of scale 1, not {start.scale}")
        turning = None if normals is None else _vectors("normals", normals, M)
        source = places, counts, turning
        trace: list[IcpIterate] = []

        def keep(place: _Place, moved: float) -> None:
            trace.append(place.iterate(moved))
            if callback:
                callback(trace[-1])

        place = _Place(self, source, target, start)
        keep(place, 0.0)
        stopped = Stopped.OUT_OF_ITERATIONS
        for _ in range(self.max_iterations):
            if not place.contact.any():
                stopped = Stopped.NO_CONTACT
                break
            following = self._next(place)
            if following is None:
                stopped = Stopped.NO_LOWER
                break
            distance, place = place.distance_to(following), following
            keep(place, distance)
            if distance <= self.tolerance:
                stopped = Stopped.SETTLED
                break
        return Alignment(place.motion, stopped, tuple(trace))

    def _next(self, place: "_Place") -> "_Place | None":
        """The place after one step, or None if the cost falls along no part of it."""
        motion = self.step(place.contacts())
        moved = place.after(motion)
        settled = place.distance_to(moved) <= self.tolerance
        if not self.halvings or moved.cost <= place.cost or settled:
            return moved
        centre = place.points.mean(axis=0)
        for k in range(1, self.halvings + 1):
            moved = place.after(part_of(motion, 0.5**k, centre))
            if moved.cost <= place.cost:
                return moved
        return None


_Source = tuple[Array, Array, Array | None]  # points (M, 3) m, their weights (M,) and normals


class _Place:
    """A motion, the points there and their contacts."""

    def __init__(self, icp: Icp, source: _Source, target: Target, motion: Similarity) -> None:
        self.icp, self.source, self.target, self.motion = icp, source, target, motion
        points, self.weights, turning = source
        self.points: Array = motion(points)
        normals = None if turning is None else turning @ motion.R.T
        self.nearest = target.closest(self.points, icp.gate, normals, icp.facing)
        touching = np.asarray(self.nearest.faces) >= 0
        self.contact: Mask = touching & (self.weights > 0)
        counted = touching if np.isinf(icp.gate) else np.ones_like(touching)
        self.distances = np.where(touching, np.abs(self.nearest.distances), icp.gate)
        self.loss_weights = np.zeros(len(self.points))
        self.loss_weights[counted] = icp.loss.weights(self.distances[counted])
        self.contact &= self.loss_weights > 0
        self.cost = float(self.weights[counted] @ icp.loss.costs(self.distances[counted]))

    def contacts(self) -> Contacts:
        """The points that have a contact, with it."""
        touching = self.contact
        return Contacts(
            self.points[touching],
            self.nearest.points[touching],
            self.nearest.normals[touching],
            (self.weights * self.loss_weights)[touching],
        )

    def after(self, step: Similarity) -> "_Place":
        """The place after a step from here."""
        return _Place(self.icp, self.source, self.target, step.after(self.motion))

    def distance_to(self, other: "_Place") -> float:
        """How far, m, the point that moves farthest comes on the way to another place."""
        return float(np.linalg.norm(other.points - self.points, axis=1).max())

    def iterate(self, moved: float) -> IcpIterate:
        """What the trace keeps."""
        touching = np.asarray(self.nearest.faces) >= 0
        w, d = self.weights[touching], self.distances[touching]
        rms = float(np.sqrt(w @ d**2 / w.sum())) if w.any() else np.nan
        return IcpIterate(self.motion, self.cost, rms, float(touching.mean()), moved)
