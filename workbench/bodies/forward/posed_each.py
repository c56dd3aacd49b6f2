"""Points of a body at several poses, by arithmetic on all of them together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from workbench.arrays import Array
from workbench.blocks.points import stacked
from workbench.bodies.forward.motion import Kinematics, Motion, Slopes


class ManyAtOrigin(Protocol):
    """Points of a body at M motions and shapes, before translation."""

    @property
    def points(self) -> Array:
        """The posed points, (M, N, 3) m."""

    def __getitem__(self, some: slice) -> ManyAtOrigin:
        """The points of the same body at some of the M motions and shapes."""

    def derivative(self, slopes: Slopes, role: str) -> Array:
        """The transposed derivatives by `pose`, `betas` and so on, (M, size, 3 N)."""


class ArithmeticOfMany(Protocol):
    """What Arithmetic provides in addition, if it takes several motions at once."""

    def evaluate_each(self, motions: Motion, betas: Array, *offsets: Array) -> ManyAtOrigin:
        """The points moved by M motions, of people with betas (M, B), and offsets (M, N, 3) m."""


class OneAt(Protocol):
    """Points at one pose, as far as their gradients are needed; see BodyPointsAt."""

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradients of cotangent (3 N,) . points by `pose`, `betas` and so on, flat."""


@dataclass(frozen=True, eq=False)
class PosedEach:
    """The points at M poses (M, K, 3) rad, betas (M, B) and trans (M, 3) m; see PointsOfEach.

    The derivatives of motions are not kept, because they are asked for once.

    Attributes:
        kinematics: of the body.
        arithmetic: of the points, at several motions at once.
        each: the points at each of several arguments, one by one.
        names: the block that holds each argument, by the word for the argument.
        arguments: the poses, betas and translations, and offsets (M, N, 3) m if any.
    """

    kinematics: Kinematics
    arithmetic: ArithmeticOfMany
    each: Callable[..., Sequence[OneAt]]
    names: Mapping[str, str]
    arguments: tuple[Array, ...]

    @cached_property
    def points(self) -> Array:
        """The points, (M, N, 3) m."""
        return np.asarray(self._at_origin.points + self.arguments[2][:, None])

    @cached_property
    def _at_origin(self) -> ManyAtOrigin:
        poses, betas, _, *offsets = self.arguments
        return self.arithmetic.evaluate_each(self.kinematics.motions(poses, betas), betas, *offsets)

    def write_jacobians(self, some: slice, into: Mapping[str, Array]) -> None:
        """Write the derivatives at some of the poses, (some, 3 N, size)."""
        poses, betas, *_ = (argument[some] for argument in self.arguments)
        slopes, here = self.kinematics.slopes_batch(poses, betas), self._at_origin[some]
        for role, name in self.names.items():
            if name in into:
                into[name][:] = here.derivative(slopes, role).swapaxes(-1, -2)

    def vjps(self, cotangents: Array) -> dict[str, Array]:
        """The gradients (M, size) of cotangent (M, 3 N) . points by each block."""
        each = zip(self.each(*self.arguments), cotangents, strict=True)
        found = stacked([here.vjp(cotangent) for here, cotangent in each])
        return {name: found[role] for role, name in self.names.items() if role in found}
