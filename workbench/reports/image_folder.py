"""Fits to many images in one folder: what is done is kept, and a page and a table show all."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from workbench.bodies import SkinnedBody
from workbench.comparison.identity import code_version, digest, file_digest
from workbench.fitting.body_priors import stature
from workbench.fitting.images import INTERVAL_NOTE, DepthInterval
from workbench.fitting.jobs import FailedFile, FileJob, FittedImage, ImageWork
from workbench.fitting.pose_regressor import shipped_regressor
from workbench.reading.arrays import opened, read_expected, reals
from workbench.reports.entries import Entry, csv_text, kept_entry
from workbench.reports.folder import SUMMARY, own_folder, summary_text
from workbench.reports.page import as_json, page
from workbench.reports.tables import number
from workbench.reports.thumbnail import thumbnail
from workbench.writing import write_arrays, write_file

FORMAT = 3  # of what is stored for an image
FITS = "fits"  # the folder of the fits of single images
TABLE = "fits.csv"
CLOSE = 3.0  # between costs: the density at the other hypothesis is at least exp(-3), a twentieth
COLUMNS = (
    "file",
    "status",
    "cost",
    "next cost",
    "mean error (px)",
    "depth (m)",
    "depth, 5 % (m)",
    "depth, 95 % (m)",
    "height (m)",
    "seconds",
    "warnings",
)


@dataclass(frozen=True, eq=False)
class ImageFolder:
    """A folder with the fit of each image, a page and a table over all.

    Raises BadFile if the folder holds something else, or cannot be made.

    Attributes:
        place: where it is.
        work: how images are read and fitted.
        body_name: the body as it was given.
        source: what was given, by which the folder is known as ours.
    """

    place: Path
    work: ImageWork
    body_name: str
    source: str

    def __post_init__(self) -> None:
        own_folder(self.place, self.source)
        (self.place / FITS).mkdir(exist_ok=True)
        self._write_summary([], [])

    def key_of_work(self) -> str:
        """What all fits depend on: the body, the recipe, how files are read, the regressor, and
        the code.
        """
        work, calibration = self.work, self.work.reading.calibration
        lens = "" if calibration is None else file_digest(str(calibration))
        about = (FORMAT, work.body, work.recipe, work.reading, work.hypotheses, shipped_regressor())
        return digest([digest(about), lens, code_version()])

    def key(self, job: FileJob, of_work: str) -> str:
        """16 letters that differ when anything does on which the fit of an image depends."""
        return digest([of_work, file_digest(str(job.path))])

    def kept(self, job: FileJob, key: str) -> Entry | None:
        """The entry of an image that is fitted already under this key; None if it is not."""
        facts, *others = (self._path(job, kind) for kind in ("json", "npz", "svg"))
        return kept_entry(job.name, key, facts, others)

    def keep(self, found: FittedImage, key: str) -> Entry:
        """Write the fit of an image, its arrays first, and return its entry.

        What was there before counts no longer as soon as its facts, which hold its key, are gone.
        """
        self._path(found.job, "json").unlink(missing_ok=True)
        values, others = found.values, found.others
        arrays = {name: np.asarray(value) for name, value in values.items()}
        for i, other in enumerate(others):
            arrays |= {f"hypothesis {i + 2}:{name}": np.asarray(v) for name, v in other.items()}
        write_arrays(self._path(found.job, "npz"), arrays)
        body = self.work.body
        write_file(self._path(found.job, "svg"), thumbnail(found.picture, body.parents))
        betas = values[body.blocks()[1].name]
        height = float(stature(body, betas)) if isinstance(body, SkinnedBody) else None
        facts = {
            "key": key,
            "status": found.status,
            "costs": found.costs,
            "error_px": None if np.isnan(found.error) else found.error,
            "depth_m": found.depth,
            "depth_90_m": None if found.interval is None else ends_of(found.interval),
            "height_m": height,
            "seconds": found.seconds,
            "warnings": found.doubts,
            "notes": found.notes,
        }
        text = as_json(facts)
        write_file(self._path(found.job, "json"), text)
        return Entry(found.job.name, json.loads(text))

    def finish(self, entries: Sequence[Entry], failed: Sequence[FailedFile]) -> Path:
        """Write the page, the table and `poses.npz` of all images; returns the page."""
        write_file(self.place / TABLE, table_of(entries))
        self._write_poses(entries)
        text = page(
            "images.html",
            title=f"{self.body_name} in {len(entries)} images",
            rows=[_row(entry) for entry in entries],
            failed=failed,
            ambiguous=sum(_ambiguous(entry) for entry in entries),
            hypotheses=self.work.hypotheses,
            doubted=sum(bool(entry.facts["warnings"]) for entry in entries),
            found=INTERVAL_NOTE,
        )
        write_file(self.place / "index.html", text)
        self._write_summary(entries, failed)
        return self.place / "index.html"

    def _write_poses(self, entries: Sequence[Entry]) -> None:
        """Pose, betas and trans of all images in one file, in the order of the table."""
        blocks = self.work.body.blocks()
        expected = {block.name: reals(*block.shape) for block in blocks}
        rows: dict[str, list[Any]] = {block.name: [] for block in blocks}
        for entry in entries:
            with opened(self.place / FITS / f"{entry.name}.npz", "fit", "fit it again") as archive:
                for name, found in read_expected(archive, expected).items():
                    rows[name].append(found)
        if entries:
            files = np.array([entry.name for entry in entries])
            stacked = {name: np.array(found) for name, found in rows.items()}
            write_arrays(self.place / "poses.npz", {**stacked, "file": files})

    def _path(self, job: FileJob, kind: str) -> Path:
        return self.place / FITS / f"{job.name}.{kind}"

    def _write_summary(self, entries: Sequence[Entry], failed: Sequence[FailedFile]) -> None:
        about = {
            "kind": "images",
            "body": self.body_name,
            "recipe": {"sigma": self.work.recipe.sigma, "outlier": self.work.recipe.outlier},
            "hypotheses": self.work.hypotheses,
            "images": [entry.name for entry in entries],
            "warnings": {e.name: e.facts["warnings"] for e in entries if e.facts["warnings"]},
            "failed": {one.job.name: one.reason for one in failed},
        }
        files = ["index.html", TABLE, "poses.npz", SUMMARY]
        write_file(self.place / SUMMARY, summary_text(self.source, about, files))


def table_of(entries: Sequence[Entry]) -> str:
    """The table of all images (.csv)."""
    rows = []
    for entry in entries:
        told = entry.facts
        costs, ends = [*told["costs"], None], told["depth_90_m"] or (None, None)
        row = (entry.name, told["status"], *costs[:2], told["error_px"], told["depth_m"], *ends)
        rows.append((*row, told["height_m"], told["seconds"], "; ".join(told["warnings"])))
    return csv_text(COLUMNS, rows)


def ends_of(interval: DepthInterval) -> tuple[float, float]:
    """The ends of the 90 % interval, m."""
    return interval.low, interval.high


def _ambiguous(entry: Entry) -> bool:
    costs = entry.facts["costs"]
    return len(costs) > 1 and costs[1] - costs[0] < CLOSE


def _row(entry: Entry) -> dict[str, Any]:
    told = entry.facts
    costs, ends = told["costs"], told["depth_90_m"]
    return {
        "name": entry.name,
        "status": told["status"].lower().replace("_", " "),
        "cost": number(costs[0], 4),
        "next": number(costs[1] - costs[0], 3) if len(costs) > 1 else "–",
        "error": "–" if told["error_px"] is None else number(told["error_px"], 3),
        "depth": f"{told['depth_m']:.2f}",
        "ends": "–" if ends is None else f"{ends[0]:.2f} to {ends[1]:.2f}",
        "picture": quote(f"{FITS}/{entry.name}.svg"),
        "height": "–" if told["height_m"] is None else f"{told['height_m']:.2f}",
        "warnings": told["warnings"],
        "notes": told["notes"],
    }
