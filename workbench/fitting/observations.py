"""Keypoints of one person at one moment, as one or several cameras observed them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.errors import WorkbenchError

SIDES = ("left", "right")
HEAD = ("eye", "ear")
LIMBS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
COCO = ("nose", *(f"{side}_{part}" for part in HEAD + LIMBS for side in SIDES))
FEET = tuple(f"{side}_{part}" for side in SIDES for part in ("big_toe", "small_toe", "heel"))


class BadObservation(WorkbenchError):
    """The error for keypoints or cameras that a fit cannot use."""


@dataclass(frozen=True, eq=False)
class Photograph:
    """The keypoints that one camera observed, and its calibration.

    Confidences above 1 count as 1. Raises BadObservation if a keypoint with a confidence above 0
    has no finite position, if a confidence is negative or not finite, or if no keypoint has a
    confidence above 0.

    Attributes:
        name: the camera's name.
        size: width and height of the image in px.
        pixels: (M, 2) the keypoints in px.
        confidence: (M,) how far each keypoint is trusted, from 0 (not observed) to 1.
        K: (3, 3) the matrix of the pinhole in px; None if the focal length is unknown.
        R: (3, 3) the rotation from the world to the camera; None if the camera is the world.
        t: (3,) the translation from the world to the camera in m.
        distortion: up to five coefficients k1, k2, p1, p2, k3.
    """

    name: str
    size: tuple[int, int]
    pixels: Array
    confidence: Array
    K: Array | None = None
    R: Array | None = None
    t: Array | None = None
    distortion: Array | None = None

    def __post_init__(self) -> None:
        bad = ~np.isfinite(self.pixels).all(axis=1) & (self.confidence > 0)
        bad |= ~(np.isfinite(self.confidence) & (self.confidence >= 0))
        if bad.any():
            row = int(np.argmax(bad))
            raise BadObservation(
                f"{self.name}: keypoint {row} is {self.pixels[row].tolist()} with confidence "
                f"{self.confidence[row]}; give finite numbers, or confidence 0 if it was not seen"
            )
        object.__setattr__(self, "confidence", np.minimum(self.confidence, 1.0))
        if not (self.confidence > 0).any():
            raise BadObservation(
                f"{self.name}: no keypoint has a confidence above 0; leave out this camera"
            )


@dataclass(frozen=True, eq=False)
class Observations:
    """The same keypoints in one or several photographs of a person.

    Attributes:
        names: the M keypoints, in the order of the photographs' rows.
        photographs: one per camera.
        notes: sentences about contents of the files that were not read.
    """

    names: tuple[str, ...]
    photographs: tuple[Photograph, ...]
    notes: tuple[str, ...] = ()

    def observed(self) -> tuple[str, ...]:
        """The names of the keypoints that at least one photograph shows."""
        seen = [photograph.confidence > 0 for photograph in self.photographs]
        return tuple(name for i, name in enumerate(self.names) if any(one[i] for one in seen))

    def ordered(self, names: Sequence[str]) -> "Observations":
        """The keypoints in the order of `names`; those that were not observed have confidence 0.

        Raises BadObservation if none of them was observed.
        """
        where = {name: i for i, name in enumerate(self.names)}
        index = np.array([where.get(name, -1) for name in names], dtype=int)
        if (index < 0).all():
            raise BadObservation(
                f"none of the observed keypoints ({', '.join(self.names)}) is one of the body's "
                f"({', '.join(names)})"
            )

        def pick(photograph: Photograph) -> Photograph:
            there = (index >= 0) & (photograph.confidence[index] > 0)
            pixels = np.where(there[:, None], photograph.pixels[index], 0.0)
            confidence = np.where(there, photograph.confidence[index], 0.0)
            return replace(photograph, pixels=pixels, confidence=confidence)

        return Observations(tuple(names), tuple(pick(p) for p in self.photographs), self.notes)


def photograph(
    name: str,
    size: ArrayLike,
    keypoints: ArrayLike,
    calibration: Mapping[str, ArrayLike] | None = None,
) -> Photograph:
    """A photograph from keypoints (M, 3), which are u, v in px and a confidence each.

    `size` is the image's width and height in px; `calibration` may hold `K`, `R`, `t` and
    `distortion`. Raises BadObservation for keypoints of another shape.
    """
    points = np.asarray(keypoints, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadObservation(
            f"{name}: keypoints must be (M, 3): u, v, confidence; not {points.shape}"
        )
    width, height = (int(n) for n in np.asarray(size).ravel())
    numbers = {k: np.asarray(v, dtype=float) for k, v in (calibration or {}).items()}
    return Photograph(name, (width, height), points[:, :2], points[:, 2], **numbers)


def pinhole(focal: float, width: int, height: int) -> Array:
    """The matrix K (3, 3) px of a camera with square pixels, centred on the image."""
    return np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]], dtype=float)
