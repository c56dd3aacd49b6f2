"""Points on a body by arithmetic: in the body's own words, and under the names of a problem.

Arithmetic knows a pose, betas and a translation (`BodyPoints`). A problem knows blocks by the names
that it gives them, and a pose may be made of several of these. `Named` stands between the two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, TypeGuard

import numpy as np
from scipy.sparse import csr_array, kron

from workbench.arrays import Array, Index
from workbench.blocks import PointsAt
from workbench.bodies.forward.arithmetic import Arithmetic, Surface
from workbench.bodies.forward.assembly import ROLES, Assembly, Maps, assembly_of
from workbench.bodies.forward.motion import Kinematics, Posed
from workbench.bodies.forward.numeric import Chunk, many_points
from workbench.bodies.forward.rows import Rows, Target


class BodyPoints(Protocol):
    """Points on a body by arithmetic on its pose, betas and translation."""

    def at(self, pose: Array, betas: Array, trans: Array) -> PointsAt:
        """The points at pose (K, 3) rad, betas (B,) and trans (3,) m.

        Derivatives go by the names `pose`, `betas` and `trans`.
        """

    def many(self, pose: Array, betas: Array, trans: Array) -> Array:
        """(M, N, 3) m of M poses (M, K, 3) rad, betas (M, B) and translations (M, 3) m."""


class Each(Protocol):
    """Points that know several sets of arguments at once better than one after the other."""

    def each(self, poses: Array, betas: Array, trans: Array) -> Sequence[PointsAt]:
        """The points at poses (M, K, 3) rad, betas (M, B) and trans (M, 3) m."""


class ByRows(Protocol):
    """Points whose derivative can be written row by row, to wherever the rows are wanted."""

    def tangent_by_rows(self, into: Mapping[str, Target], scale: Array | None) -> None:
        """As `tangent` of PointsAt; rows that nobody wants are left out."""


@dataclass(frozen=True, eq=False)
class Named:
    """Points on a body whose pose, betas and trans are affine maps of a problem's blocks.

    See NumericPoints. `wanted` has the entries by which derivatives are taken of those blocks that
    are free in part; of all others they are taken by every entry.
    """

    points: BodyPoints
    maps: Maps
    wanted: Mapping[str, Index] = field(default_factory=dict)
    _assemblies: dict[tuple[str, ...], Assembly] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks."""
        return tuple(dict.fromkeys(name for one in self.maps for name in one.reads))

    @cached_property
    def plain(self) -> tuple[str, str, str] | None:
        """The names of three blocks, if the arguments are these and nothing else."""
        pose, betas, trans = (one.plain for one in self.maps)
        if pose is None or betas is None or trans is None or self.wanted:
            return None
        # of one block in two roles the derivatives have to be added
        return (pose, betas, trans) if len({pose, betas, trans}) == 3 else None

    def only(self, wanted: Mapping[str, Index]) -> Named:
        """The same with derivatives by these entries of these blocks only."""
        return Named(self.points, self.maps, {**wanted})

    def at(self, values: Mapping[str, Array]) -> NamedAt:
        """Where the blocks have these values."""
        return NamedAt(self, self.points.at(*(one.value(values) for one in self.maps)))

    def each(self, values: Sequence[Mapping[str, Array]]) -> list[PointsAt]:
        """At several sets of values, in fewer calls than by `at` for each."""
        arguments = [[one.value(some) for some in values] for one in self.maps]
        if _knows_each(self.points):
            found = self.points.each(*(np.array(argument) for argument in arguments))
        else:
            found = [self.points.at(*one) for one in zip(*arguments, strict=True)]
        return [NamedAt(self, here) for here in found]

    def many(self, values: Mapping[str, Array]) -> Array:
        """The points of M sets of values, (M, N, 3) m."""
        return self.points.many(*(one.many(values) for one in self.maps))

    def assembly(self, names: tuple[str, ...]) -> Assembly:
        """How the derivative by these blocks is put together."""
        if names not in self._assemblies:
            self._assemblies[names] = assembly_of(self.maps, names, self.wanted)
        return self._assemblies[names]


@dataclass(frozen=True, eq=False)
class NamedAt:
    """The points at one set of values; see PointsAt."""

    of: Named
    here: PointsAt

    @property
    def points(self) -> Array:
        """The points at these values, (N, 3) m."""
        return self.here.points

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[block] (size, 3 N)."""
        if self.of.plain is not None:
            ours = zip(ROLES, self.of.plain, strict=True)
            self.here.tangent({our: into[name] for our, name in ours if name in into}, scale)
        elif into:
            self._put_together(self.of.assembly(tuple(into)), into, scale)

    def _put_together(
        self, assembly: Assembly, into: Mapping[str, Array], scale: Array | None
    ) -> None:
        width = next(iter(into.values())).shape[1]
        rooms = {role: np.empty((part.held, width)) for role, part in assembly.parts.items()}
        targets = {role: part.target(into, rooms[role]) for role, part in assembly.parts.items()}
        if _writes_rows(self.here):
            self.here.tangent_by_rows(targets, scale)
        else:
            wholes = {
                role: target.room(width) if isinstance(target, Rows) else target
                for role, target in targets.items()
            }
            self.here.tangent(wholes, scale)
            for role, target in targets.items():
                if isinstance(target, Rows):
                    target.fill(wholes[role])
        for name, entries in assembly.combined.items():
            total = np.zeros((len(entries), width))
            for role, part in assembly.parts.items():
                if name in part.matrices:
                    total += part.matrices[name] @ rooms[role]
            into[name][entries] = total

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By the blocks, flat; by the entries that are wanted of each."""
        found, of = self.here.adjoint(pull), self.of
        if of.plain is not None:
            return {name: found[role] for role, name in zip(ROLES, of.plain, strict=True)}
        gradient: dict[str, Array] = {}
        for role, one in zip(ROLES, of.maps, strict=True):
            for name, part in one.pulled(found[role]).items():
                gradient[name] = gradient[name] + part if name in gradient else part
        return {n: g[of.wanted[n]] if n in of.wanted else g for n, g in gradient.items()}


def _knows_each(points: object) -> TypeGuard[Each]:
    return hasattr(type(points), "each")


def _writes_rows(here: object) -> TypeGuard[ByRows]:
    # isinstance of a protocol is slow
    return hasattr(type(here), "tangent_by_rows")


@dataclass(frozen=True, eq=False)
class NumericSurface:
    """Vertices of a linearly blended body whose arrays are all numbers; see BodyPoints."""

    kinematics: Kinematics
    arithmetic: Arithmetic
    chunks: Callable[[], list[Chunk]]  # of the same vertices, for matrix products

    def at(self, pose: Array, betas: Array, trans: Array) -> SurfaceAt:
        """The vertices at one pose, betas and translation."""
        return SurfaceAt(self, self.kinematics.at(pose, betas), trans)

    def each(self, poses: Array, betas: Array, trans: Array) -> list[SurfaceAt]:
        """The vertices at M poses, betas and translations, which share their kinematics."""
        posed = self.kinematics.each(poses, betas)
        return [SurfaceAt(self, one, t) for one, t in zip(posed, trans, strict=True)]

    def many(self, pose: Array, betas: Array, trans: Array) -> Array:
        """(M, N, 3) m, by matrix products."""
        G, features = self.kinematics.motions(pose, betas)
        found = many_points(self._chunks, G, features, betas)
        found += trans[:, None]
        return found

    @cached_property
    def _chunks(self) -> list[Chunk]:
        return self.chunks()


@dataclass(frozen=True, eq=False)
class SurfaceAt:
    """The vertices at one pose (K, 3) rad, betas (B,) and trans (3,) m; see PointsAt."""

    of: NumericSurface
    posed: Posed
    trans: Array

    @cached_property
    def surface(self) -> Surface:
        """The surface before translation."""
        motion = self.posed.motion
        return self.of.arithmetic.at(motion, self.posed.betas)

    @cached_property
    def points(self) -> Array:
        """The posed vertices, (N, 3) m."""
        return self.surface.points + self.trans

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[name] (size, 3 N)."""
        self.tangent_by_rows(into, scale)

    def tangent_by_rows(self, into: Mapping[str, Target], scale: Array | None) -> None:
        """The same, to wherever the rows are wanted."""
        slopes = self.posed.slopes
        self.surface.tangent(slopes, into, scale)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        pulled = pull.reshape(-1, 3)
        on_G, on_features, on_betas = self.surface.adjoint(pulled)
        back = self.posed.adjoint(on_G, on_features)
        on_pose, through_joints = back
        return {
            "pose": on_pose.ravel(),
            "betas": on_betas + through_joints,
            "trans": pulled.sum(axis=0),
        }


@dataclass(frozen=True, eq=False)
class NumericMeans:
    """Weighted means of the points of a surface: `regressor` (M, N); see BodyPoints."""

    surface: BodyPoints
    regressor: csr_array

    @cached_property
    def on_coordinates(self) -> csr_array:
        """The matrix of weighted means, for each coordinate: (3 M, 3 N)."""
        return csr_array(kron(self.regressor, np.eye(3), format="csr"))

    def at(self, pose: Array, betas: Array, trans: Array) -> MeansAt:
        """The means at one pose, betas and translation."""
        return MeansAt(self, self.surface.at(pose, betas, trans))

    def many(self, pose: Array, betas: Array, trans: Array) -> Array:
        """(M, L, 3) m, from the surface's points."""
        whole = self.surface.many(pose, betas, trans)
        return np.array([self.regressor @ points for points in whole])


@dataclass(frozen=True, eq=False)
class MeansAt:
    """The means at one pose, betas and trans; see PointsAt."""

    of: NumericMeans
    surface: PointsAt

    @cached_property
    def points(self) -> Array:
        """The weighted means of the posed vertices, (M, 3) m."""
        return np.asarray(self.of.regressor @ self.surface.points)

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[name] (size, 3 M)."""
        N = self.of.regressor.shape[1]
        whole = {name: np.empty((len(a), 3 * N)) for name, a in into.items()}
        self.surface.tangent(whole, None)
        for name, array in into.items():
            array[...] = (self.of.on_coordinates @ whole[name].T).T
            if scale is not None:
                array *= scale

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        return self.surface.adjoint(self.of.on_coordinates.T @ pull)
