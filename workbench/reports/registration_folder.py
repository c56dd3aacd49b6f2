"""Registrations of many scans in one folder: what is done is kept, and training reads the table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.files.saving import save_body
from workbench.comparison.identity import code_version, digest, file_digest
from workbench.registration import FailedScan, Reading, Recipe, RegisteredScan, ScanJob
from workbench.registration.registering import HEIGHT, LENGTH
from workbench.reports.entries import Entry, csv_text, kept_entry
from workbench.reports.folder import SUMMARY, own_folder, summary_text
from workbench.reports.page import page
from workbench.reports.registration_page import ARRAYS, FORMAT, write_registration
from workbench.reports.tables import number
from workbench.training.folder import COLUMNS, TABLE, Row
from workbench.writing import write_file

START = "start.npz"  # the body, from which training starts
MM = 1e3


@dataclass(frozen=True, eq=False)
class RegistrationFolder:
    """A folder with one folder for each registered scan, a page over all, and a table of subjects.

    Raises BadFile if the folder holds something else, or cannot be made.

    Attributes:
        place: where it is.
        body: the body whose template is registered.
        body_name: as it was given.
        recipe: how scans are registered.
        reading: how their files are read.
        source: what was given, by which the folder is known as ours.
    """

    place: Path
    body: Body
    body_name: str
    recipe: Recipe
    reading: Reading
    source: str

    def __post_init__(self) -> None:
        own_folder(self.place, self.source)
        self._write_summary([])

    def key(self, job: ScanJob) -> str:
        """16 letters that differ when anything does on which the registration depends: the file's
        contents, the body, the recipe, how the file is read, and the code.
        """
        about = (FORMAT, self.recipe, self.reading, self.body, self.recipe.vertex_stages(self.body))
        return digest([digest(about), file_digest(str(job.path)), code_version()])

    def kept(self, job: ScanJob, key: str) -> Entry | None:
        """The entry of a scan that is registered already under this key; None if it is not."""
        folder = self.place / job.name
        return kept_entry(job.name, key, folder / SUMMARY, [folder / ARRAYS])

    def keep(self, found: RegisteredScan, key: str) -> Entry:
        """Write the folder of a scan, and return its entry."""
        folder = self.place / found.job.name
        write_registration(found, folder, body=self.body_name, key=key)
        entry = self.kept(found.job, key)
        assert entry is not None  # it has just been written
        return entry

    def finish(
        self, entries: Sequence[Entry], rows: Sequence[Row], failed: Sequence[FailedScan]
    ) -> Path:
        """Write the page over all scans and, for training, the table of subjects and the body.

        `rows` has for each entry its subject, its gender and its set. Returns the page. Without
        entries there is no table.
        """
        write_file(self.place / "index.html", self._page(entries, failed))
        if entries:
            write_file(self.place / TABLE, table_of(rows))
        if isinstance(self.body, SkinnedBody):
            save_body(self.body, self.place / START)
        else:
            (self.place / START).unlink(missing_ok=True)  # of a body that was used before
        self._write_summary(entries, failed)
        return self.place / "index.html"

    def _page(self, entries: Sequence[Entry], failed: Sequence[FailedScan]) -> str:
        return page(
            "registrations.html",
            title=f"{self.body_name} on {len(entries)} scans",
            rows=[_row(entry) for entry in entries],
            size=next((_size(entry.facts) for entry in entries), HEIGHT),
            failed=failed,
            doubted=sum(bool(entry.facts["warnings"]) for entry in entries),
            trains=bool(entries) and isinstance(self.body, SkinnedBody),
        )

    def _write_summary(self, entries: Sequence[Entry], failed: Sequence[FailedScan] = ()) -> None:
        about = {
            "kind": "registrations",
            "body": self.body_name,
            "scans": [entry.name for entry in entries],
            "failed": {one.job.name: one.reason for one in failed},
        }
        files = ["index.html", TABLE, START, SUMMARY]
        write_file(self.place / SUMMARY, summary_text(self.source, about, files))


def table_of(rows: Sequence[Row]) -> str:
    """The table of subjects (.csv) of registered scans, as `open_folder` reads it."""
    return csv_text(COLUMNS, ((row.file, row.subject, row.gender, row.set) for row in rows))


def _size(told: Mapping[str, Any]) -> str:
    """Which size a summary tells: the height of a person, or the length of a hand."""
    return HEIGHT if f"{HEIGHT}_m" in told else LENGTH


def _row(entry: Entry) -> dict[str, Any]:
    told = entry.facts
    return {
        "name": entry.name,
        "median": "–" if told["median_m"] is None else number(MM * told["median_m"], 3),
        "touching": f"{100 * told['touching']:.0f} %",
        "hidden": f"{100 * (1 - told['seen']):.0f} %",
        "size": f"{told[f'{_size(told)}_m']:.2f}",
        "seconds": number(told["seconds"], 3),
        "warnings": told["warnings"],
    }
