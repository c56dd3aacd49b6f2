"""`workbench fit FOLDER`: the keypoints of many images, each of one person by itself."""

from pathlib import Path

from rich.console import Console
from rich.markup import escape

from workbench.cli.cluster import executing
from workbench.cli.many import carry_out
from workbench.cli.output import say
from workbench.errors import BadFile, some_of
from workbench.fitting.jobs import ImageWork, image_jobs, in_parts
from workbench.reports.many import ImageFolder

KEYPOINTS = ".json"


def fit_folder(
    console: Console,
    given: Path,
    work: ImageWork,
    *,
    body: str,
    out: Path,
    workers: int,
    dask: str | None,
) -> None:
    """Fit a body to each file of keypoints in a folder; continues where it was interrupted.

    Raises BadFile for a folder without such files, and Interrupted after Ctrl-C.
    """
    jobs = image_jobs(files_in(console, given))
    source = given.resolve()
    folder = ImageFolder(out / f"fit-{source.name}", work, body, str(source))
    of_work = folder.key_of_work()
    keys = {job: folder.key(job, of_work) for job in jobs}
    with executing(console, workers, dask) as executor:
        carry_out(
            console,
            folder,
            keys,
            lambda missing: executor(work, in_parts(missing)),
            folder.finish,
            "images",
            "fitted",
        )


def files_in(console: Console, given: Path) -> list[Path]:
    """The files of keypoints in a folder, in the order of their names."""
    inside = sorted(file for file in given.iterdir() if file.is_file())
    found = [f for f in inside if f.suffix.lower() == KEYPOINTS and not f.name.startswith(".")]
    if not found:
        raise BadFile(
            f"the folder {given} holds no keypoints, which are {KEYPOINTS} files of COCO, "
            "COCO-WholeBody or OpenPose"
        )
    if others := [file.name for file in inside if file not in found]:
        say(console, f"note: not taken for keypoints: {escape(some_of(others))}")
    return found
