"""`workbench fit FOLDER`: the keypoints of many images, each of one person by itself."""

from pathlib import Path

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.bars import Bars
from workbench.cli.cluster import cluster
from workbench.cli.leaving import Interrupted
from workbench.cli.output import print_page, say, warn_without_effect
from workbench.errors import BadFile, some_of
from workbench.fitting.image_jobs import FailedImage, ImageJob, ImageWork, image_jobs, in_parts
from workbench.interrupts import caused_by
from workbench.reports.image_folder import ImageEntry, ImageFolder
from workbench.training.executor import Executor, Processes, by_backend

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
    if workers > 1 and dask is not None:
        why = "with --dask, the cluster says how many there are"
        warn_without_effect(console, "--workers", why)
    source = given.resolve()
    folder = ImageFolder(out / f"fit-{source.name}", work, body, str(source))
    executor: Executor = Processes(workers) if dask is None else by_backend
    with cluster(dask):
        _carry_out(console, folder, jobs, executor)


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


def _carry_out(
    console: Console, folder: ImageFolder, jobs: tuple[ImageJob, ...], executor: Executor
) -> None:
    of_work = folder.key_of_work()
    keys = {job.name: folder.key(job, of_work) for job in jobs}
    entries: dict[str, ImageEntry] = {}
    for job in jobs:
        kept = folder.kept(job, keys[job.name])
        if kept is not None:
            entries[job.name] = kept
    if entries:
        say(console, f"{len(entries)} of {len(jobs)} images are fitted already")
    missing = [job for job in jobs if job.name not in entries]
    failed: list[FailedImage] = []
    try:
        with Bars(console) as bars:
            bars("images", len(entries), len(jobs))
            for some in executor(folder.work, in_parts(missing)):
                for found in some:
                    if isinstance(found, FailedImage):
                        failed.append(found)
                    else:
                        entries[found.job.name] = folder.keep(found, keys[found.job.name])
                bars("images", len(entries) + len(failed), len(jobs))
    except (KeyboardInterrupt, SystemError) as error:
        if not caused_by(error, KeyboardInterrupt):
            raise
        raise Interrupted(
            f"interrupted; {len(entries)} of {len(jobs)} images are fitted in {folder.place}, and "
            "the same command continues with the others"
        ) from error
    page = folder.finish([entries[job.name] for job in jobs if job.name in entries], failed)
    for one in failed:
        say(console, f"[bold yellow]not fitted:[/] {escape(one.job.name)}: {escape(one.reason)}")
    print_page(console, "report", page)
    if failed:
        say(console, f"{len(failed)} of {len(jobs)} images could not be fitted")
        raise typer.Exit(1)
