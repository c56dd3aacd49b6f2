"""A clip: the keypoints of one person in the frames of one or several films."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.fitting.observations import BadObservation, Observations, Photograph


@dataclass(frozen=True, eq=False)
class Film:
    """The keypoints that one camera observed in T frames, and its calibration.

    Raises BadObservation for shapes that do not go together, for a keypoint with a confidence above
    0 that has no finite position, and if nothing was observed in any frame.

    Attributes:
        name: the camera's name.
        size: width and height of the images in px.
        pixels: (T, M, 2) the keypoints in px.
        confidence: (T, M) how far each is trusted, from 0 (not observed) to 1.
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
        if self.pixels.shape != (*self.confidence.shape, 2) or self.confidence.ndim != 2:
            raise BadObservation(
                f"{self.name}: the keypoints of a film are (T, M, 2) with confidences (T, M), not "
                f"{self.pixels.shape} and {self.confidence.shape}"
            )
        if not (self.confidence > 0).any():
            raise BadObservation(f"{self.name}: no frame shows a keypoint; leave out this camera")
        for t in np.flatnonzero((self.confidence > 0).any(axis=1)):
            self.photograph(int(t))  # which refuses numbers that are not finite

    def photograph(self, frame: int) -> Photograph:
        """One frame. Raises BadObservation if nothing was observed in it."""
        return Photograph(
            f"{self.name}, frame {frame}",
            self.size,
            self.pixels[frame],
            self.confidence[frame],
            self.K,
            self.R,
            self.t,
            self.distortion,
        )


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


def clip_of(frames: Sequence[Observations | None], fps: float, notes: tuple[str, ...] = ()) -> Clip:
    """A clip from what the same cameras observed in each frame; None is a gap.

    Raises BadObservation if there is no frame, or if frames differ in cameras, sizes or keypoints.
    """
    known = [one for one in frames if one is not None]
    if not known:
        raise BadObservation("a clip needs at least one frame in which something was observed")
    first = known[0]
    described = {(one.names, tuple((p.name, p.size) for p in one.photographs)) for one in known}
    if len(described) > 1:
        raise BadObservation(
            "the frames of a clip have the same cameras, image sizes and keypoints, and these do "
            "not; make a clip of the frames that go together"
        )
    T, M = len(frames), len(first.names)
    films = []
    for i, photo in enumerate(first.photographs):
        pixels, confidence = np.zeros((T, M, 2)), np.zeros((T, M))
        for t, one in enumerate(frames):
            if one is not None:
                pixels[t] = one.photographs[i].pixels
                confidence[t] = one.photographs[i].confidence
        calibration = photo.K, photo.R, photo.t, photo.distortion
        films.append(Film(photo.name, photo.size, pixels, confidence, *calibration))
    return Clip(first.names, tuple(films), fps, notes)
