"""Landmarks with offsets in numbers: points that follow from four arguments instead of three."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from workbench.arrays import Array
from workbench.bodies.forward.landmark_numbers import LandmarkArithmetic, LandmarksAtOrigin
from workbench.bodies.forward.motion import Kinematics, Posed
from workbench.bodies.forward.numeric_sources import pulled_back
from workbench.bodies.forward.rows import Target


@dataclass(frozen=True, eq=False)
class DisplacedPoints:
    """Landmarks that offsets displace at rest; see BodyPoints.

    Attributes:
        kinematics: of the body.
        landmarks: the arithmetic of the landmarks at one motion, shape and offsets.
    """

    kinematics: Kinematics
    landmarks: LandmarkArithmetic

    def evaluate(
        self, pose: Array, betas: Array, trans: Array, offsets: Array
    ) -> DisplacedPointsAt:
        """The landmarks at one pose, betas and translation, displaced by offsets (L, 3) m."""
        return DisplacedPointsAt(
            self.landmarks, self.kinematics.evaluate(pose, betas), trans, offsets
        )

    def evaluate_each(
        self, poses: Array, betas: Array, trans: Array, offsets: Array
    ) -> list[DisplacedPointsAt]:
        """The landmarks at each of M poses, betas, translations and offsets (M, L, 3) m."""
        each = zip(self.kinematics.evaluate_each(poses, betas), trans, offsets, strict=True)
        return [DisplacedPointsAt(self.landmarks, *one) for one in each]

    def evaluate_batch(self, poses: Array, betas: Array, trans: Array, offsets: Array) -> Array:
        """The landmarks (M, L, 3) m of M poses, betas, translations and offsets, all at once."""
        motions = self.kinematics.motions(poses, betas)
        return self.landmarks.evaluate_batch(motions, betas, offsets) + trans[:, None]


@dataclass(frozen=True, eq=False)
class DisplacedPointsAt:
    """The landmarks at one pose (K, 3) rad, betas (B,), trans (3,) m and offsets (L, 3) m.

    See BodyPointsAt.
    """

    landmarks: LandmarkArithmetic
    posed: Posed
    trans: Array
    offsets: Array

    @cached_property
    def here(self) -> LandmarksAtOrigin:
        """The landmarks before translation."""
        return self.landmarks.evaluate(self.posed.motion, self.posed.betas, self.offsets)

    @cached_property
    def points(self) -> Array:
        """The landmarks, (L, 3) m."""
        return self.here.points + self.trans

    def tangent(self, into: Mapping[str, Target], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas`, `trans` and `offsets`."""
        self.here.tangent(self.posed.slopes, into, scale)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """The gradients of pull . points, pull (3 L,), by the four arguments, flat."""
        pulled = pull.reshape(-1, 3)
        by_offsets = self.here.pulled_by_offsets(pulled).ravel()
        return {**pulled_back(self.posed, self.here, pulled), "offsets": by_offsets}
