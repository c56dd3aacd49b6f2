"""Work on many files: what is done is kept, what is missing is done, and a page shows all."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.bars import Bars
from workbench.cli.leaving import interrupts_say
from workbench.cli.output import print_page, say, warn_of
from workbench.fitting.jobs import FailedFile, FileJob
from workbench.reports.page import Entry


class Found(Protocol):
    """What was found of a file."""

    @property
    def job(self) -> FileJob:
        """The file, and its name."""


Done = TypeVar("Done", bound=Found, contravariant=True)


class Folder(Protocol[Done]):
    """A folder in which what was found is kept, under the name of each job."""

    @property
    def place(self) -> Path:
        """The path of the folder, which must exist when the first entry is kept."""

    def kept(self, job: FileJob, key: str) -> Entry | None:
        """The entry of a job that is done already under this key; None if it is not."""

    def keep(self, found: Done, key: str) -> Entry:
        """Write what was found, and return its entry."""


def carry_out(
    console: Console,
    folder: Folder[Done],
    keys: Mapping[FileJob, str],
    work: Callable[[Sequence[FileJob]], Iterable[Sequence[Done | FailedFile]]],
    finish: Callable[[Sequence[Entry], Sequence[FailedFile]], Path],
    files: str,
    done: str,
) -> None:
    """Do the jobs that the folder does not hold under their keys, and finish it.

    `work` yields what it found of some jobs at a time, and `finish` writes what is over all and
    returns the page. In sentences, the `files` are `done`: scans are registered. Exits with 1 if
    a file failed, and raises Interrupted after Ctrl-C.
    """
    kept = {job.name: folder.kept(job, key) for job, key in keys.items()}
    entries = {name: entry for name, entry in kept.items() if entry is not None}
    failed: list[FailedFile] = []
    if entries:
        say(console, f"{len(entries)} of {len(keys)} {files} are {done} already")

    def told() -> str:
        return (
            f"interrupted; {len(entries)} of {len(keys)} {files} are {done} in {folder.place}, and "
            "the same command continues with the others"
        )

    with interrupts_say(told):
        with Bars(console) as bars:
            bars(files, len(entries), len(keys))
            for some in work([job for job in keys if job.name not in entries]):
                for found in some:
                    name = found.job.name
                    if isinstance(found, FailedFile):
                        failed.append(found)
                        why = escape(found.reason)
                        say(console, f"[bold yellow]not {done}:[/] {escape(name)}: {why}")
                    else:
                        entries[name] = folder.keep(found, keys[found.job])
                bars(files, len(entries) + len(failed), len(keys))
        page = finish([entries[job.name] for job in keys if job.name in entries], failed)
    for name, entry in entries.items():
        warn_of(console, entry.facts.get("warnings", ()), f"{name}: ")
    print_page(console, "report", page)
    if failed:
        say(console, f"{len(failed)} of {len(keys)} {files} could not be {done}")
        raise typer.Exit(1)
