"""What cameras saw of one person at one moment: keypoints by name, and the cameras."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.errors import WorkbenchError

Array = NDArray[np.float64]

COCO = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder",
    "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip",
    "left_knee", "right_knee", "left_ankle", "right_ankle",
)  # fmt: skip
FEET = (
    "left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe",
    "right_heel",
)  # fmt: skip


class BadObservation(WorkbenchError):
    """Keypoints or cameras that a fit cannot use."""


@dataclass(frozen=True, eq=False)
class Photograph:
    """What one camera saw: keypoints (M, 2) in px with confidences (M,), and its calibration.

    `R`, `t` take the world to the camera. A camera without K has an unknown focal length.
    Raises BadObservation if a keypoint with a confidence has no finite place, or a confidence is
    no number from 0.
    """

    name: str
    size: tuple[int, int]  # width, height in px
    pixels: Array
    confidence: Array
    K: Array | None = None  # (3, 3) px
    R: Array | None = None  # (3, 3); None: the camera is the world
    t: Array | None = None  # (3,) m
    distortion: Array | None = None  # (<= 5,): k1 k2 p1 p2 k3

    def __post_init__(self) -> None:
        bad = ~np.isfinite(self.pixels).all(axis=1) & (self.confidence > 0)
        bad |= ~(np.isfinite(self.confidence) & (self.confidence >= 0))
        if bad.any():
            row = int(np.argmax(bad))
            raise BadObservation(
                f"{self.name}: keypoint {row} is {self.pixels[row].tolist()} with confidence "
                f"{self.confidence[row]}; give finite numbers, or confidence 0 if it was not seen"
            )
        if not (self.confidence > 0).any():
            raise BadObservation(f"{self.name}: no keypoint has a confidence above 0")


@dataclass(frozen=True, eq=False)
class Observations:
    """The same keypoints in one or several photographs."""

    names: tuple[str, ...]
    photographs: tuple[Photograph, ...]
    notes: tuple[str, ...] = ()  # sentences on what their files hold beside them

    def seen(self) -> tuple[str, ...]:
        """The keypoints that some photograph shows."""
        there = np.any([p.confidence > 0 for p in self.photographs], axis=0)
        return tuple(name for name, one in zip(self.names, there, strict=True) if one)

    def ordered(self, names: Sequence[str]) -> "Observations":
        """The keypoints in the order of `names`; those that were not observed get confidence 0."""
        unknown = np.full(len(names), -1)
        where = {name: i for i, name in enumerate(self.names)}
        index = np.array([where.get(name, -1) for name in names]) if names else unknown
        if (index < 0).all():
            raise BadObservation(
                f"none of the observed keypoints ({', '.join(self.names)}) is one of the body's "
                f"({', '.join(names)})"
            )

        def pick(photograph: Photograph) -> Photograph:
            seen = (index >= 0) & (photograph.confidence[index] > 0)
            pixels = np.where(seen[:, None], photograph.pixels[index], 0.0)
            confidence = np.where(seen, photograph.confidence[index], 0.0)
            return Photograph(
                photograph.name, photograph.size, pixels, confidence,
                photograph.K, photograph.R, photograph.t, photograph.distortion,
            )  # fmt: skip

        return Observations(tuple(names), tuple(pick(p) for p in self.photographs), self.notes)


def photograph(
    name: str,
    size: ArrayLike,
    keypoints: ArrayLike,
    calibration: Mapping[str, ArrayLike] | None = None,
) -> Photograph:
    """From keypoints (M, 3): u, v in px and a confidence; calibration keys K, R, t, distortion."""
    points = np.asarray(keypoints, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadObservation(
            f"{name}: keypoints must be (M, 3): u, v, confidence; not {points.shape}"
        )
    width, height = (int(n) for n in np.asarray(size).ravel())
    numbers = {k: np.asarray(v, dtype=float) for k, v in (calibration or {}).items()}
    return Photograph(name, (width, height), points[:, :2], points[:, 2], **numbers)
