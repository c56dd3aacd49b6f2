"""Points on a body by arithmetic, under the body's own names or under those of a problem.

Arithmetic knows a pose, betas, a translation and perhaps offsets (`BodyPoints`). A problem knows
blocks by the names that it gives them, and a pose may be made of several of these. `Named` stands
between the two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, cast

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks.points import LoopedPoints, NumericPoints, PointsAt, PointsOfEach
from workbench.bodies.forward.arithmetic import Arithmetic, AtOrigin, Displaced
from workbench.bodies.forward.assembly import ROLES, Assembly, Maps, assembly_of, plain_names
from workbench.bodies.forward.motion import Kinematics, Posed
from workbench.bodies.forward.posed_each import ArithmeticOfMany, PosedEach
from workbench.bodies.forward.rows import Target

Writer = Callable[[Mapping[str, Target], Array | None], None]  # see BodyPointsAt.write_jacobian


class BodyPointsAt(Protocol):
    """Points of a body at one pose, betas and translation, and offsets if any; see PointsAt."""

    @property
    def points(self) -> Array:
        """The points, (N, 3) m."""

    def write_jacobian(self, into: Mapping[str, Target], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas` and so on, (size, 3 N) each.

        Each column is multiplied by its scale (3 N,); rows that are not wanted are left out.
        """

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradients of cotangent (3 N,) . points by `pose`, `betas` and so on, flat."""


class BodyPoints(Protocol):
    """Points of a body by arithmetic on its arguments, in the order of `ROLES`.

    These are its pose, betas and translation; those of displaced landmarks have offsets as well.
    """

    @property
    def evaluate(self) -> Callable[..., BodyPointsAt]:
        """The points at pose (K, 3) rad, betas (B,), trans (3,) m and offsets (N, 3) m if any."""

    @property
    def evaluate_each(self) -> Callable[..., Sequence[BodyPointsAt]]:
        """The points at each of M arguments: (M, K, 3) rad, (M, B), (M, 3) m and (M, N, 3) m."""

    @property
    def evaluate_batch(self) -> Callable[..., Array]:
        """The points (M, N, 3) m of M arguments, of the same shapes."""

    def together(self, names: Mapping[str, str], *arguments: Array) -> PointsOfEach | None:
        """The points at each of M arguments, by arithmetic on all of them; None if it takes one.

        `names` are those of the blocks that hold the arguments, by the words of `ROLES`.
        """


@dataclass(frozen=True, eq=False)
class Named(NumericPoints):
    """Points on a body whose arguments are affine maps of a problem's blocks.

    `wanted` has the entries by which derivatives are taken of those blocks that
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
    def plain(self) -> tuple[str, ...] | None:
        """The names of the blocks pose, betas, trans and so on, if the arguments are whole blocks.

        None if an argument is made of blocks in another way, or a block is free in part.
        """
        return None if self.wanted else plain_names(self.maps)

    def only(self, wanted: Mapping[str, Index]) -> Named:
        """These points, with derivatives by the named entries of the named blocks only."""
        return Named(self.points, self.maps, {**wanted})

    def evaluate(self, values: Mapping[str, Array]) -> NamedAt:
        """Where the blocks have these values."""
        return NamedAt(self, self.points.evaluate(*(one.value(values) for one in self.maps)))

    def evaluate_each(self, values: Mapping[str, Array], count: int) -> PointsOfEach:
        """The points at M = `count` sets of values, in fewer calls than by `evaluate` for each."""
        if self.plain is not None:
            arguments = [one.value_batch(values) for one in self.maps]
            together = self.points.together(dict(zip(ROLES, self.plain, strict=False)), *arguments)
            if together is not None:
                return together
        each = [{name: values[name][i] for name in self.reads} for i in range(count)]
        arguments = [np.array([one.value(some) for some in each]) for one in self.maps]
        return LoopedPoints([NamedAt(self, here) for here in self.points.evaluate_each(*arguments)])

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        """The points of M sets of values, (M, N, 3) m."""
        return self.points.evaluate_batch(*(one.value_batch(values) for one in self.maps))

    def assembly(self, names: tuple[str, ...]) -> Assembly:
        """How the derivative by these blocks is put together."""
        if names not in self._assemblies:
            self._assemblies[names] = assembly_of(self.maps, names, self.wanted)
        return self._assemblies[names]


@dataclass(frozen=True, eq=False)
class NamedAt(PointsAt):
    """The points at one set of values."""

    of: Named
    here: BodyPointsAt

    @property
    def points(self) -> Array:
        """The points at these values, (N, 3) m."""
        return self.here.points

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write the transposed derivative into[block] (size, 3 N)."""
        self._write(self.here.write_jacobian, into, scale)

    def write_jacobian_over_zeros(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """The same where `into` holds zeros wherever the derivative is always zero."""
        self._write(
            getattr(self.here, "write_jacobian_over_zeros", self.here.write_jacobian), into, scale
        )

    def _write(self, by: Writer, into: Mapping[str, Array], scale: Array | None) -> None:
        if self.of.plain is not None:
            ours = zip(ROLES, self.of.plain, strict=False)
            by({our: into[name] for our, name in ours if name in into}, scale)
        elif into:
            self._put_together(by, self.of.assembly(tuple(into)), into, scale)

    def _put_together(
        self, by: Writer, assembly: Assembly, into: Mapping[str, Array], scale: Array | None
    ) -> None:
        width = next(iter(into.values())).shape[1]
        rooms = {role: np.zeros((part.held, width)) for role, part in assembly.parts.items()}
        targets = {role: part.target(into, rooms[role]) for role, part in assembly.parts.items()}
        by(targets, scale)
        for name, entries in assembly.combined.items():
            total = np.zeros((len(entries), width))
            for role, part in assembly.parts.items():
                if name in part.matrices:
                    total += part.matrices[name] @ rooms[role]
            into[name][entries] = total

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """Gradients of cotangent . points by the blocks, flat; by the entries that are wanted."""
        found, of = self.here.vjp(cotangent), self.of
        if of.plain is not None:
            return {name: found[role] for role, name in zip(ROLES, of.plain, strict=False)}
        gradient: dict[str, Array] = {}
        for role, one in zip(ROLES, of.maps, strict=False):
            for name, part in one.vjp(found[role]).items():
                gradient[name] = gradient[name] + part if name in gradient else part
        return {n: g[of.wanted[n]] if n in of.wanted else g for n, g in gradient.items()}


@dataclass(frozen=True, eq=False)
class PosedPoints:
    """Points of a body that follow from its kinematics; see BodyPoints.

    Attributes:
        kinematics: of the body.
        arithmetic: of the points at one motion and shape, and offsets if any.
        at_origin: the points (M, N, 3) m of poses (M, K, 3) rad and betas (M, B), and offsets
            (M, N, 3) m if any, untranslated.
    """

    kinematics: Kinematics
    arithmetic: Arithmetic
    at_origin: Callable[..., Array]

    def evaluate(self, pose: Array, betas: Array, trans: Array, *offsets: Array) -> PosedPointsAt:
        """The points at one pose, betas, translation, and offsets (N, 3) m of landmarks."""
        posed = self.kinematics.evaluate(pose, betas)
        return PosedPointsAt(self.arithmetic, posed, trans, offsets)

    def evaluate_each(
        self, poses: Array, betas: Array, trans: Array, *offsets: Array
    ) -> list[PosedPointsAt]:
        """The points at each of M poses (M, K, 3) rad, betas (M, B) and translations (M, 3) m.

        The kinematics of all of them are computed together.
        """
        posed = self.kinematics.evaluate_each(poses, betas)
        each = zip(posed, trans, *offsets, strict=True)
        return [PosedPointsAt(self.arithmetic, p, t, tuple(more)) for p, t, *more in each]

    def together(self, names: Mapping[str, str], *arguments: Array) -> PointsOfEach | None:
        """The same by arithmetic on all of them; None where there is none, as for a surface."""
        if not hasattr(self.arithmetic, "evaluate_each"):
            return None
        arithmetic = cast(ArithmeticOfMany, self.arithmetic)
        return PosedEach(self.kinematics, arithmetic, self.evaluate_each, names, arguments)

    def evaluate_batch(self, poses: Array, betas: Array, trans: Array, *offsets: Array) -> Array:
        """The points (M, N, 3) m of M poses, betas and translations, all at once."""
        found = self.at_origin(poses, betas, *offsets)
        found += trans[:, None]
        return found


@dataclass(frozen=True, eq=False)
class PosedPointsAt:
    """The points at one pose (K, 3) rad, betas (B,) and trans (3,) m; see BodyPointsAt.

    `offsets` is empty, or holds the offsets (N, 3) m that displace landmarks at rest.
    """

    arithmetic: Arithmetic
    posed: Posed
    trans: Array
    offsets: tuple[Array, ...] = ()

    @cached_property
    def here(self) -> AtOrigin:
        """The points before translation."""
        return self.arithmetic.evaluate(self.posed.motion, self.posed.betas, *self.offsets)

    @cached_property
    def points(self) -> Array:
        """The points, (N, 3) m."""
        at_origin = self.here.points
        found = np.empty_like(at_origin)
        for d in range(3):  # one coordinate at a time, so that the inner loop runs along points
            np.add(at_origin[:, d], self.trans[d], out=found[:, d])
        return found

    def write_jacobian(self, into: Mapping[str, Target], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas` and so on, (size, 3 N) each."""
        slopes = self.posed.slopes  # first, because it finds the motion as well
        self.here.write_jacobian(slopes, into, scale)

    def write_jacobian_over_zeros(self, into: Mapping[str, Target], scale: Array | None) -> None:
        """The same where `into` holds zeros wherever the derivative is always zero."""
        slopes = self.posed.slopes
        getattr(self.here, "write_jacobian_over_zeros", self.here.write_jacobian)(
            slopes, into, scale
        )

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradients of cotangent (3 N,) . points by `pose`, `betas` and so on, flat."""
        posed, pulled = self.posed, cotangent.reshape(-1, 3)
        on_G, on_features, on_betas = self.here.vjp(pulled)
        on_pose, by_joints = posed.kinematics.vjp(posed.pose, posed.betas, on_G, on_features)
        found = {"pose": on_pose.ravel(), "betas": on_betas + by_joints}
        if self.offsets:
            found["offsets"] = cast(Displaced, self.here).pulled_by_offsets(pulled).ravel()
        return {**found, "trans": pulled.sum(axis=0)}
