"""What cameras saw of a person: keypoints of one moment, or of the frames of a clip."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.errors import WorkbenchError

SIDES = ("left", "right")
HEAD = ("eye", "ear")
LIMBS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
COCO = ("nose", *(f"{side}_{part}" for part in HEAD + LIMBS for side in SIDES))
FEET = tuple(f"{side}_{part}" for side in SIDES for part in ("big_toe", "small_toe", "heel"))
FEWEST_PLACING = 4  # keypoints in an image, by which a body is placed in a frame


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

    @property
    def calibration(self) -> tuple[Array | None, ...]:
        """K, R, t and distortion."""
        return self.K, self.R, self.t, self.distortion

    def ordered(self, index: Sequence[int]) -> Self:
        """The keypoints of these numbers; those of number -1 have confidence 0."""
        confidence = np.where(np.array(index) >= 0, self.confidence[..., index], 0.0)
        pixels = np.where(confidence[..., None] > 0, self.pixels[..., index, :], 0.0)
        return replace(self, pixels=pixels, confidence=confidence)

    def __post_init__(self) -> None:
        bad = ~np.isfinite(self.pixels).all(axis=-1) & (self.confidence > 0)
        bad |= ~(np.isfinite(self.confidence) & (self.confidence >= 0))
        if bad.any():
            place = tuple(int(i) for i in np.argwhere(bad)[0])
            *frame, row = place
            raise BadObservation(
                f"{self.name}{''.join(f', frame {t}' for t in frame)}: keypoint {row} is "
                f"{self.pixels[place].tolist()} with confidence {self.confidence[place]}; give "
                "finite numbers, or confidence 0 if it was not seen"
            )
        object.__setattr__(self, "confidence", np.minimum(self.confidence, 1.0))
        if not (self.confidence > 0).any():
            raise BadObservation(
                f"{self.name}: no keypoint has a confidence above 0; leave out this camera"
            )


@dataclass(frozen=True, eq=False)
class Film(Photograph):
    """The keypoints that one camera observed in T frames, and its calibration.

    It is a photograph with `pixels` (T, M, 2) and `confidence` (T, M). Raises BadObservation for
    other shapes, and as a photograph does.
    """

    def __post_init__(self) -> None:
        if self.pixels.shape != (*self.confidence.shape, 2) or self.confidence.ndim != 2:
            raise BadObservation(
                f"{self.name}: the keypoints of a film are (T, M, 2) with confidences (T, M), not "
                f"{self.pixels.shape} and {self.confidence.shape}"
            )
        super().__post_init__()

    def photograph(self, frame: int) -> Photograph:
        """One frame. Raises BadObservation if nothing was observed in it."""
        return Photograph(
            f"{self.name}, frame {frame}",
            self.size,
            self.pixels[frame],
            self.confidence[frame],
            *self.calibration,
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
        seen = np.any([photograph.confidence > 0 for photograph in self.photographs], axis=0)
        return tuple(np.array(self.names)[seen].tolist())

    def ordered(self, names: Sequence[str]) -> "Observations":
        """The keypoints in the order of `names`; those that were not observed have confidence 0.

        Raises BadObservation if none of them was observed.
        """
        index = [self.names.index(name) if name in self.names else -1 for name in names]
        if max(index, default=-1) < 0:
            raise BadObservation(
                f"none of the observed keypoints ({', '.join(self.names)}) is one of the body's "
                f"({', '.join(names)})"
            )
        ordered = tuple(photograph.ordered(index) for photograph in self.photographs)
        return Observations(tuple(names), ordered, self.notes)


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


@dataclass(frozen=True, eq=False)
class Clip:
    """The same keypoints in T frames of one or several cameras that run in step.

    A frame in which a camera saw nothing has confidence 0 there: a gap. Raises BadObservation for
    films of different lengths, for no film, and for fps that are not above zero.

    Attributes:
        names: the M keypoints, in the order of the films' columns.
        films: one per camera.
        fps: frames per second.
        notes: sentences about what was not read or is missing.
    """

    names: tuple[str, ...]
    films: tuple[Film, ...]
    fps: float
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        shapes = sorted({film.confidence.shape for film in self.films})
        if len(shapes) != 1 or shapes[0][1] != len(self.names):
            raise BadObservation(
                f"the films of a clip have the same frames and the {len(self.names)} keypoints "
                f"that are named, not {shapes} frames and keypoints"
            )
        if not 0 < self.fps < np.inf:
            raise BadObservation(f"a clip has a number of frames per second, not {self.fps}")

    @property
    def count(self) -> int:
        """T, the number of frames."""
        return len(self.films[0].confidence)

    @property
    def gaps(self) -> tuple[int, ...]:
        """The frames in which no camera saw anything."""
        seen = np.any([(film.confidence > 0).any(axis=1) for film in self.films], axis=0)
        return tuple(int(t) for t in np.flatnonzero(~seen))


def clip_of(frames: Sequence[Observations | None], fps: float) -> Clip:
    """A clip from what the same cameras observed in each frame; None is a gap.

    Raises BadObservation if there is no frame, or if frames differ in cameras, sizes or keypoints.
    """
    known = [frame for frame in frames if frame is not None]
    if not known:
        raise BadObservation("a clip needs at least one frame in which something was observed")
    first = known[0]
    described = {(seen.names, tuple((p.name, p.size) for p in seen.photographs)) for seen in known}
    if len(described) > 1:
        raise BadObservation(
            "the frames of a clip have the same cameras, image sizes and keypoints, and these do "
            "not; make a clip of the frames that go together"
        )
    nothing, films = np.zeros((len(first.names), 2)), []
    for i, photo in enumerate(first.photographs):
        each = [None if frame is None else frame.photographs[i] for frame in frames]
        pixels = np.array([nothing if p is None else p.pixels for p in each])
        confidence = np.array([nothing[:, 0] if p is None else p.confidence for p in each])
        films.append(Film(photo.name, photo.size, pixels, confidence, *photo.calibration))
    return Clip(first.names, tuple(films), fps)
