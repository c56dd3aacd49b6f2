"""Scans in files as jobs: each is read and registered by itself, here or in another process."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from workbench.arrays import Array
from workbench.bodies.body import Body
from workbench.errors import BadArgument
from workbench.fitting.jobs import FailedFile, FileJob, check_names_differ, reason_of
from workbench.fitting.scans.files import SMALLEST_LIMIT, contents_of, read_scan
from workbench.geometry.guesses import UNITS, UP_TO_Y, check_given, sizes_of
from workbench.registration.model_fit import FitProgress
from workbench.registration.recipe import Recipe, with_skeleton
from workbench.registration.registering import Registration, register

MOST_POINTS = 40_000  # points of a scan that are registered
RESERVED_NAMES = ("index.html", "registrations.csv", "start.npz", "summary.json")
ScanJob = FileJob  # of a scan to be registered
FailedScan = FailedFile  # a scan that could not be registered


@dataclass(frozen=True)
class Reading:
    """How files of scans are read; what is None is guessed, and the notes say how.

    Raises UnknownName for another unit or axis, and BadArgument for fewer than 1,000 points.

    Attributes:
        unit: m, cm, mm or in.
        up: the axis of the file that points up: x, y, z, -x, -y or -z.
        array: the name of the array of points, for .npz files.
        camera: where the scans were taken from, in the unit and the axes of the file.
        most: the number of points, drawn at random, that are used of a larger scan.
        skeleton: of a scanned hand, a file of 16 or 21 points as `with_skeleton` takes them, in
            the unit and the axes of the scan's file.
    """

    unit: str | None = None
    up: str | None = None
    array: str | None = None
    camera: tuple[float, float, float] | None = None
    most: int = MOST_POINTS
    skeleton: Path | None = None

    def __post_init__(self) -> None:
        check_given(self.unit, self.up)
        if self.most < SMALLEST_LIMIT:
            raise BadArgument(
                f"at least {SMALLEST_LIMIT:,} points of a scan are read, not {self.most}"
            )


@dataclass(frozen=True, eq=False)
class RegisteredScan:
    """A scan that was registered.

    `camera` (3,) m is where it was taken from, in the axes of the registration, None if unknown;
    the notes are on what was guessed, repaired or left out when the file was read.
    """

    job: ScanJob
    registration: Registration
    camera: Array | None
    notes: tuple[str, ...]


def registered(
    body: Body,
    recipe: Recipe,
    reading: Reading,
    job: ScanJob,
    progress: Callable[[FitProgress], object] | None = None,
) -> RegisteredScan | FailedScan:
    """Read a scan and register it. Whatever is wrong with one scan is in the answer, so that one
    bad file among hundreds does not end the others; only Ctrl-C is raised.
    """
    try:
        file = read_scan(
            job.path,
            unit=reading.unit,
            up=reading.up,
            name=reading.array if job.path.suffix.lower() == ".npz" else None,
            camera_position=reading.camera,
            most=reading.most,
            sizes=sizes_of(body.joint_names),
        )
        if reading.skeleton is not None:
            points = contents_of(reading.skeleton).points @ UP_TO_Y[file.up].T * UNITS[file.unit]
            recipe = with_skeleton(recipe, body, points)
        registration = register(
            body, file.scan, recipe=recipe, camera=file.camera_position, progress=progress
        )
    except Exception as error:
        return FailedScan(job, reason_of(error, job.path, "register"))
    if not (registration.touching.any() and registration.seen.any()):
        return FailedScan(job, f"no point of {job.path} touches the surface of the fitted body")
    return RegisteredScan(job, registration, file.camera_position, file.notes)


def jobs_of(files: list[Path], array: str | None = None) -> tuple[ScanJob, ...]:
    """A job for each file, with names that differ, also where capitals do not count: the file's
    without its suffix, or with it where two would be alike or the name is reserved; and the name
    of an array after that of an .npz file, which may hold several scans.

    Raises BadArgument if two files have the same name, in different folders.
    """
    stems = [_folder_name(path.stem) for path in files]
    often = Counter(map(str.casefold, stems))
    names = [
        stem
        if often[stem.casefold()] == 1 and stem.casefold() not in RESERVED_NAMES
        else _folder_name(path.name.replace(".", "-"))
        for stem, path in zip(stems, files, strict=True)
    ]
    if array is not None:
        names = [
            _folder_name(f"{name}-{array}") if path.suffix.lower() == ".npz" else name
            for name, path in zip(names, files, strict=True)
        ]
    check_names_differ(files, names, "register them")
    return tuple(ScanJob(name, path) for name, path in zip(names, files, strict=True))


def _folder_name(name: str) -> str:
    """A name for a folder that tables of registrations and all systems take."""
    encodable = name.encode("utf-8", "replace").decode("utf-8")
    return encodable.replace("#", "-").replace("/", "-").strip(" .") or "scan"
