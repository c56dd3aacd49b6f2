"""Images and other files as jobs: each is worked on by itself, here or in another process."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument, WorkbenchError, cut
from workbench.fitting.doubts import doubts
from workbench.fitting.files.keypoints import read_observations
from workbench.fitting.images import (
    INTERVAL_NOTE,
    ByHeight,
    DepthInterval,
    ImageFits,
    Smplify,
    depth_interval,
)
from workbench.fitting.keypoints import reprojection_errors
from workbench.fitting.observations import Observations
from workbench.interrupts import caused_by
from workbench.solvers import Status

LOG = logging.getLogger(__name__)
LONGEST_REASON = 500  # letters of the reason of a failure
IMAGES_AT_ONCE = 25  # of a job: what is derived for a problem is derived once for all of them


@dataclass(frozen=True)
class FileJob:
    """A file to be worked on, and a name for it."""

    name: str
    path: Path


@dataclass(frozen=True)
class FailedFile:
    """A file with which the work failed, and why, in a sentence."""

    job: FileJob
    reason: str


def check_names_differ(files: Sequence[Path], names: Sequence[str], work: str) -> None:
    """Raise BadArgument if two files have the same name, also where capitals do not count.

    `work` says what can be done with one after the other: `register them`.
    """
    folded = [name.casefold() for name in names]
    for path, name in zip(files, folded, strict=True):
        if folded.count(name) > 1:
            same = [str(p) for p, n in zip(files, folded, strict=True) if n == name]
            raise BadArgument(
                f"{' and '.join(same)} have the same name, and results are stored under it; "
                f"rename {path.name}, or {work} one after the other"
            )


def reason_of(error: Exception, path: Path, work: str) -> str:
    """Why the work on a file failed, in a sentence, so that others can go on.

    `work` says what was to be done: `register`. An error that nobody foresaw is logged with its
    traceback. Raises KeyboardInterrupt if that is what caused the error.
    """
    if isinstance(error, WorkbenchError):
        return cut(error, LONGEST_REASON)
    if isinstance(error, MemoryError):
        return f"there is not enough memory to {work} {path}"
    if caused_by(error, KeyboardInterrupt):
        raise KeyboardInterrupt from error
    LOG.warning("could not %s %s", work, path, exc_info=error)
    return cut(f"an unforeseen error, {type(error).__name__}: {error}", LONGEST_REASON)


@dataclass(frozen=True)
class ImageReading:
    """How files of keypoints are read: the arguments of `read_observations`."""

    size: tuple[int, int] | None = None
    focal: float | None = None
    calibration: Path | None = None
    person: int | None = None
    camera_to_world: bool = False

    def observations(self, files: Sequence[Path]) -> Observations:
        """The keypoints in files of one moment."""
        return read_observations(files, **vars(self))


@dataclass(frozen=True, eq=False)
class FittedPicture:
    """What is drawn of a fitted image: the joints (K, 2) px of the body, the keypoints (M, 2) px
    that were observed, and their confidence (M,).
    """

    joints: Array
    observed: Array
    confidence: Array


@dataclass(frozen=True, eq=False)
class FittedImage:
    """The body that was fitted to one image.

    Attributes:
        values: pose, betas, trans, and the focal length if it was free.
        others, costs: those of the other hypotheses, and the costs of all, the lowest first.
        status: how the best run ended.
        error: the mean distance in px of keypoints with a confidence above 0.2; NaN without any.
        depth: the distance in m of the body's root from the camera's plane.
        interval: the same with its standard deviation; None if the distance is not determined.
        notes: sentences on what the file holds and was not read.
        doubts: what speaks against the fit, in sentences.
    """

    job: FileJob
    values: Values
    others: tuple[Values, ...]
    costs: tuple[float, ...]
    status: str
    error: float
    depth: float
    interval: DepthInterval | None
    picture: FittedPicture
    seconds: float
    notes: tuple[str, ...]
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ImageWork:
    """How images are read and fitted; called with some of them, it returns what it found of each.

    `hypotheses` is the number of starts of each image.
    """

    body: SkinnedBody | TriangleBody
    recipe: ByHeight | Smplify = field(default_factory=ByHeight)
    reading: ImageReading = field(default_factory=ImageReading)
    hypotheses: int = 1

    def __call__(self, jobs: Sequence[FileJob]) -> list[FittedImage | FailedFile]:
        """What was found of each image, in their order. Only Ctrl-C is raised."""
        fits = ImageFits(self.body, self.recipe)
        return [self._fitted(fits, job) for job in jobs]

    def _fitted(self, fits: ImageFits, job: FileJob) -> FittedImage | FailedFile:
        try:
            observed = self.reading.observations([job.path])
            setup = fits.setup(observed, job.name, hypotheses=self.hypotheses)
            assert setup.strategy is not None
            solution = setup.strategy(None).solve(setup.problem, setup.start)
        except Exception as error:
            return FailedFile(job, reason_of(error, job.path, "fit"))
        if solution.status is Status.STOPPED:
            raise KeyboardInterrupt  # the solver kept it for its own end
        if not np.isfinite(solution.cost):
            return FailedFile(job, f"the fit has no finite cost: {solution.message}")
        whole = setup.start | solution.values
        body, view = self.body, setup.views[0]
        pose, betas, trans = (whole[block.name] for block in body.blocks())
        landmarks = body.landmark(view.landmarks, pose, betas, trans)
        off = reprojection_errors(
            view.observed, view.camera.pixels(landmarks, whole), view.confidence
        )
        joints = body.joints(pose, betas, trans)
        return FittedImage(
            job,
            dict(solution.values),
            tuple(dict(hypothesis.values) for hypothesis in solution.hypotheses[1:]),
            tuple(hypothesis.cost for hypothesis in solution.hypotheses) or (solution.cost,),
            solution.status.name,
            float(np.mean(off)) if off.size else np.nan,
            float(view.camera.depths(joints[:1], whole)[0]),
            depth_interval(setup, whole),
            FittedPicture(view.camera.pixels(joints, whole), view.observed, view.confidence),
            solution.seconds,
            tuple(note for note in setup.notes if note != INTERVAL_NOTE),
            doubts(setup, whole, solution, again=False),
        )


def image_jobs(files: Sequence[Path]) -> tuple[FileJob, ...]:
    """A job for each file, by its name without the suffix. Raises BadArgument for two alike."""
    names = [path.stem for path in files]
    check_names_differ(files, names, "fit them")
    return tuple(FileJob(name, path) for name, path in zip(names, files, strict=True))


def in_parts(jobs: Sequence[FileJob]) -> list[tuple[FileJob, ...]]:
    """The jobs, `IMAGES_AT_ONCE` at a time."""
    starts = range(0, len(jobs), IMAGES_AT_ONCE)
    return [tuple(jobs[i : i + IMAGES_AT_ONCE]) for i in starts]
