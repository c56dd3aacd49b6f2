"""Scans in files as jobs: each is read and registered by itself, here or in another process."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.errors import BadArgument, WorkbenchError, cut
from workbench.fitting.scan_files import read_scan
from workbench.registration.model_fit import Progress
from workbench.registration.registering import Recipe, Registration, register

LOG = logging.getLogger(__name__)
MOST = 40_000  # points of a scan that are registered
LONGEST = 500  # letters of the reason of a failure


@dataclass(frozen=True)
class Reading:
    """How files of scans are read; what is None is guessed, and the notes say how.

    Attributes:
        unit: m, cm, mm or in.
        up: the axis of the file that points up: x, y, z, -x, -y or -z.
        array: the name of the array of points, for .npz files.
        camera: where the scans were taken from, in the unit and the axes of the file.
        most: the number of points, drawn at random, that are used of a larger scan.
    """

    unit: str | None = None
    up: str | None = None
    array: str | None = None
    camera: tuple[float, float, float] | None = None
    most: int = MOST


@dataclass(frozen=True)
class ScanJob:
    """One scan to be registered: a name for it, and its file."""

    name: str
    path: Path


@dataclass(frozen=True, eq=False)
class RegisteredScan:
    """A scan that was registered.

    Attributes:
        job: its name and its file.
        registration: what was found.
        camera: (3,) m where it was taken from, in the axes of the registration; None if unknown.
        notes: sentences on what was guessed, repaired or left out when the file was read.
    """

    job: ScanJob
    registration: Registration
    camera: Array | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class FailedScan:
    """A scan that could not be registered, and why, in a sentence."""

    job: ScanJob
    reason: str


def registered(
    body: Body,
    recipe: Recipe,
    reading: Reading,
    job: ScanJob,
    progress: Callable[[Progress], object] | None = None,
) -> RegisteredScan | FailedScan:
    """Read a scan and register it. Whatever is wrong with one scan is in the answer, so that one
    bad file among hundreds does not end the others; only Ctrl-C is raised.
    """
    try:
        read = read_scan(
            job.path,
            unit=reading.unit,
            up=reading.up,
            name=reading.array if job.path.suffix.lower() == ".npz" else None,
            camera_position=reading.camera,
            most=reading.most,
        )
        found = register(
            body, read.scan, recipe=recipe, camera=read.camera_position, progress=progress
        )
    except WorkbenchError as error:
        return FailedScan(job, cut(error, LONGEST))
    except MemoryError:
        return FailedScan(job, f"there is not enough memory to register {job.path}")
    except Exception as error:
        LOG.warning("%s could not be registered", job.path, exc_info=True)
        return FailedScan(
            job, cut(f"an unforeseen error, {type(error).__name__}: {error}", LONGEST)
        )
    return RegisteredScan(job, found, read.camera_position, read.notes)


def jobs_of(files: list[Path]) -> tuple[ScanJob, ...]:
    """A job for each file, with names that differ: the file's without its suffix, or with it where
    two would be alike. Raises BadArgument if two files have the same name, in different folders.
    """
    stems = [path.stem for path in files]
    names = [
        path.stem if stems.count(path.stem) == 1 else path.name.replace(".", "-") for path in files
    ]
    for name, path in zip(names, files, strict=True):
        if names.count(name) > 1:
            same = [str(p) for n, p in zip(names, files, strict=True) if n == name]
            raise BadArgument(
                f"{' and '.join(same)} have the same name, and results are stored under it; "
                f"rename {path.name}, or register them one after the other"
            )
    return tuple(ScanJob(name, path) for name, path in zip(names, files, strict=True))
