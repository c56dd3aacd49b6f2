"""Points in contact with a surface: contacts chosen anew at every point of a solver, or held.

Each point of a scan is compared with the closest place on a surface whose vertices move with the
unknowns. Which place that is changes with them, so that no graph can express it. With the contact
held, what is compared is an affine function of the vertices, q(V) = q_0 + W (V - V_0), which has a
graph (`Problem.frozen`). For a distance, W is the derivative of the true distance too.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Mask
from workbench.blocks import Block, NumericPoints, PointsAt, PointSource, Tree
from workbench.blocks.functions import sparse_constant
from workbench.errors import BadResidual


@dataclass(frozen=True, eq=False)
class ContactNumbers:
    """What contacts say where a surface is now, and how it changes with the surface's vertices."""

    numbers: Array  # (M, d) m, such as one signed distance of each of M points
    in_contact: Mask  # (M,) which points have a contact; the numbers of the others are constant
    derivative: Callable[[], csr_array]  # makes `jacobian`, when it is first asked for

    @cached_property
    def jacobian(self) -> csr_array:
        """(M d, 3 N) W, the derivative of the numbers by the coordinates of N vertices, contacts
        held.
        """
        return self.derivative()


Search = Callable[[Array], ContactNumbers]  # from the vertices (N, 3) m of a surface


@dataclass(frozen=True, eq=False)
class MovingContacts(NumericPoints):
    """A source of d numbers for each of M points in contact with a surface; see PointSource."""

    surface: PointSource  # of the surface's N vertices
    arithmetic: NumericPoints  # the vertices by arithmetic
    count: int  # M, the number of points
    search: Search  # finds the contacts with vertices at given places
    labels = None

    @property
    def expression(self) -> cs.MX | None:
        """None: no graph chooses contacts."""
        return None

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks that the surface depends on."""
        return self.surface.blocks

    @property
    def tree(self) -> Tree | None:
        """The kinematic tree that moves the surface, where there is one."""
        return self.surface.tree

    @property
    def numeric(self) -> "MovingContacts":
        """Itself, for it computes its numbers."""
        return self

    @property
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks that the surface depends on."""
        return self.arithmetic.reads

    def contacts(self, values: Mapping[str, Array]) -> ContactNumbers:
        """The contacts where the blocks have these values."""
        return self.search(self.arithmetic.evaluate(values).points)

    def evaluate(self, values: Mapping[str, Array]) -> "_ContactsAt":
        """The numbers where the blocks have these values."""
        here = self.arithmetic.evaluate(values)
        return _ContactsAt(here, self.search(here.points))

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        """The numbers (M, d) for several values of each block."""
        batch = self.arithmetic.evaluate_batch(values)
        return np.stack([self.search(vertices).numbers for vertices in batch])

    def nonzeros(self, name: str) -> int | None:
        """How many nonzeros the derivative by a block can have; None if it is dense."""
        pattern = self.arithmetic.pattern(name)
        if pattern is None:
            return None
        of_a_vertex = -(-pattern.nnz // max(1, pattern.shape[0] // 3))
        return CORNERS * of_a_vertex * self.count

    def frozen(self, values: Mapping[str, Array]) -> "MovingContacts":
        """The contacts as they are at these values, held."""
        here = self.arithmetic.evaluate(values).points
        contacts = self.search(here)
        W = contacts.jacobian
        at_zero = contacts.numbers - (W @ here.ravel()).reshape(contacts.numbers.shape)

        def held(vertices: Array) -> ContactNumbers:
            numbers = at_zero + (W @ vertices.ravel()).reshape(at_zero.shape)
            return ContactNumbers(numbers, np.ones(len(numbers), dtype=bool), lambda: W)

        return _HeldContacts(self.surface, self.arithmetic, self.count, held, at_zero, W)


CORNERS = 3  # of a triangle: the vertices that one contact depends on


@dataclass(frozen=True, eq=False)
class _HeldContacts(MovingContacts):
    """A source of q_0 + W V, d numbers of M points: q_0 (M, d) m are those of vertices at zero."""

    at_zero: Array
    jacobian: csr_array

    @cached_property
    def expression(self) -> cs.MX | None:
        vertices = self.surface.expression
        if vertices is None:
            return None
        moved = cs.MX(sparse_constant(self.jacobian)) @ cs.vec(cs.densify(vertices))
        return cs.reshape(moved, *self.at_zero.shape[::-1]) + cs.DM(self.at_zero.T)

    def frozen(self, values: Mapping[str, Array]) -> "_HeldContacts":
        return self

    def nonzeros(self, name: str) -> None:
        return None

    def pattern(self, name: str) -> csc_array | None:
        pattern = self.arithmetic.pattern(name)
        if pattern is None:
            return None
        ones = csc_array((np.ones(pattern.nnz), pattern.indices, pattern.indptr), pattern.shape)
        product = csc_array(_with_entries(np.ones(self.jacobian.nnz), self.jacobian) @ ones)
        product.sort_indices()
        return product


@dataclass(frozen=True, eq=False)
class _ContactsAt(PointsAt):
    here: PointsAt
    contacts: ContactNumbers

    @property
    def points(self) -> Array:
        return self.contacts.numbers

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        W = self.contacts.jacobian
        by_block = {name: np.zeros((len(target), W.shape[1])) for name, target in into.items()}
        self.here.write_jacobian(by_block, None)
        if scale is not None:
            W = _with_entries(W.data * np.repeat(scale, np.diff(W.indptr)), W)
        for name, target in into.items():
            target[...] = (W @ by_block[name].T).T

    def jacobian(self, name: str) -> csc_array:
        product = csc_array(self.contacts.jacobian @ self.here.jacobian(name))
        product.sort_indices()
        return product

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        return self.here.vjp(np.asarray(self.contacts.jacobian.T @ cotangent))


def _with_entries(entries: Array, matrix: csr_array) -> csr_array:
    """A matrix with other entries in the same places."""
    return csr_array((entries, matrix.indices, matrix.indptr), shape=matrix.shape)


TOUCHING = 1e-9  # m: the direction of a shorter offset is one of rounding errors


@dataclass(frozen=True, eq=False)
class Offsets:
    """The offsets of M points from the places on a surface with which they are in contact."""

    vectors: Array  # (M, 3) m, o = p - s
    normals: Array  # (M, 3) the unit normals of the surface at these places
    distances: Array  # (M,) m, |o|, below zero behind the surface

    @property
    def directions(self) -> Array:
        """(M, 3) the unit vectors u with |o| = +-u . o; the normals where o is only rounding."""
        clear = np.abs(self.distances) > TOUCHING
        directions = self.normals.copy()
        directions[clear] = self.vectors[clear] / self.distances[clear, None]
        return directions


@dataclass(frozen=True)
class Form:
    """How d numbers follow from the offset of a point, and how they change with it.

    `of` takes offsets to the numbers (M, d) in m and their derivatives by the offset, (M, d, 3).
    """

    name: str
    numbers: int  # d
    of: Callable[[Offsets], tuple[Array, Array]]


distance = Form("distance", 1, lambda o: (o.distances[:, None], o.directions[:, None]))
"""u . (p - s), the signed distance of the point from the surface: one number.

The direction u = (p - s) / |p - s| is held with the contact. Where the surface moves by ds, the
distance changes by -u . ds, whether or not s slides along the surface, because u is perpendicular
to it (the envelope theorem). The derivative with the contact held is therefore that of the distance
itself.
"""

offset = Form("offset", 3, lambda o: (o.vectors, np.tile(np.eye(3), (len(o.vectors), 1, 1))))
"""p - s, the vector from the surface to the point: three numbers.

Its length is the distance and its cost the same, but with the contact held a point is also kept
from sliding along the surface. Gauss-Newton takes shorter steps, and more of them.
"""


def loose(share: float) -> Form:
    """The distance, of which only a share counts in front of the surface: one number.

    Points in front of the surface may lie on clothes, points behind it may not: a body is never
    outside of what it wears. Raises BadResidual for a share that is not from 0 to 1.
    """
    if not isinstance(share, (int, float)) or not 0 <= share <= 1:
        raise BadResidual(f"the share of a loose distance is a number from 0 to 1, not {share!r}")

    def of(o: Offsets) -> tuple[Array, Array]:
        counted = np.where(o.distances > 0, share, 1.0)[:, None]
        return counted * o.distances[:, None], counted[..., None] * o.directions[:, None]

    return Form("loose distance", 1, of)
