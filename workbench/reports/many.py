"""A folder of many images or scans: what is done, what is left, and the page of all."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import quote

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.files.saving import save_body
from workbench.fitting.body_priors import stature
from workbench.fitting.images import INTERVAL_NOTE
from workbench.fitting.jobs import FailedFile, FileJob, FittedImage, FittedPicture, ImageWork
from workbench.fitting.pose_regressor import shipped_regressor
from workbench.identity import code_version, digest, file_digest
from workbench.plots.palette import BLUE, VERMILLION
from workbench.reading.arrays import opened, read_expected, reals
from workbench.registration import FailedScan, Reading, Recipe, RegisteredScan, ScanJob
from workbench.registration.registering import HEIGHT, LENGTH
from workbench.reports.folder import SUMMARY, own_folder, summary_text
from workbench.reports.page import Entry, as_json, csv_text, kept_entry, number, page
from workbench.reports.registration import ARRAYS, FORMAT, subjects_csv, write_registration
from workbench.training.folder import TABLE, Row
from workbench.writing import write_arrays, write_file

FITS_FORMAT = 3  # of what is stored for an image
FITS = "fits"  # the folder of the fits of single images
FITS_TABLE = "fits.csv"
CLOSE_COSTS = 3.0  # apart: the density at the other hypothesis is at least exp(-3), a twentieth
FITS_COLUMNS = (
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
    """

    FILES: ClassVar = "images"  # in sentences: images are fitted
    DONE: ClassVar = "fitted"
    place: Path  # where it is
    work: ImageWork  # how images are read and fitted
    body_name: str  # the body as it was given
    source: str  # what was given, by which the folder is known as ours

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
        how = work.body, work.recipe, work.reading, work.hypotheses, shipped_regressor()
        return digest([digest((FITS_FORMAT, *how)), lens, code_version()])

    def key(self, job: FileJob, of_work: str) -> str:
        """16 letters that differ when anything does on which the fit of an image depends."""
        return digest([of_work, file_digest(str(job.path))])

    def kept(self, job: FileJob, key: str) -> Entry | None:
        """The entry of an image that is fitted already under this key; None if it is not."""
        facts, *others = (self._path(job, kind) for kind in ("json", "npz", "svg"))
        return kept_entry(job.name, key, facts, others)

    def keep(self, fit: FittedImage, key: str) -> Entry:
        """Write the fit of an image, and return its entry.

        Facts of before, which hold a key, are removed first, and new ones are written last, so that
        an interrupt leaves no entry of which a part is missing.
        """
        self._path(fit.job, "json").unlink(missing_ok=True)
        values, others = fit.values, fit.others
        arrays = {name: np.asarray(value) for name, value in values.items()}
        for i, other in enumerate(others):
            arrays |= {f"hypothesis {i + 2}:{name}": np.asarray(v) for name, v in other.items()}
        write_arrays(self._path(fit.job, "npz"), arrays)
        body = self.work.body
        write_file(self._path(fit.job, "svg"), thumbnail(fit.picture, body.parents))
        betas = values[body.blocks()[1].name]
        height = float(stature(body, betas)) if isinstance(body, SkinnedBody) else None
        facts = {
            "key": key,
            "status": fit.status,
            "costs": fit.costs,
            "error_px": None if np.isnan(fit.error) else fit.error,
            "depth_m": fit.depth,
            "depth_90_m": None if fit.interval is None else (fit.interval.low, fit.interval.high),
            "height_m": height,
            "seconds": fit.seconds,
            "warnings": fit.doubts,
            "notes": fit.notes,
        }
        text = as_json(facts)
        write_file(self._path(fit.job, "json"), text)
        return Entry(fit.job.name, json.loads(text))

    def finish(self, entries: Sequence[Entry], failed: Sequence[FailedFile]) -> Path:
        """Write the page, the table and `poses.npz` of all images; returns the page."""
        write_file(self.place / FITS_TABLE, fits_csv(entries))
        self._write_poses(entries)
        several = [entry.facts["costs"] for entry in entries if len(entry.facts["costs"]) > 1]
        text = page(
            "images.html",
            title=f"{self.body_name} in {len(entries)} images",
            rows=[_fit_row(entry) for entry in entries],
            failed=failed,
            ambiguous=sum(costs[1] - costs[0] < CLOSE_COSTS for costs in several),
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
                for name, array in read_expected(archive, expected).items():
                    rows[name].append(array)
        if entries:
            files = np.array([entry.name for entry in entries])
            stacked = {name: np.array(array) for name, array in rows.items()}
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
            "failed": {failure.job.name: failure.reason for failure in failed},
        }
        files = ["index.html", FITS_TABLE, "poses.npz", SUMMARY]
        write_file(self.place / SUMMARY, summary_text(self.source, about, files))


def fits_csv(entries: Sequence[Entry]) -> str:
    """The table of all images (.csv)."""
    rows = []
    for entry in entries:
        facts = entry.facts
        costs, ends = [*facts["costs"], None], facts["depth_90_m"] or (None, None)
        row = (entry.name, facts["status"], *costs[:2], facts["error_px"], facts["depth_m"], *ends)
        rows.append((*row, facts["height_m"], facts["seconds"], "; ".join(facts["warnings"])))
    return csv_text(FITS_COLUMNS, rows)


def _fit_row(entry: Entry) -> dict[str, Any]:
    facts = entry.facts
    costs, ends = facts["costs"], facts["depth_90_m"]
    return {
        "name": entry.name,
        "status": facts["status"].lower().replace("_", " "),
        "cost": number(costs[0], 4),
        "next": number(costs[1] - costs[0], 3) if len(costs) > 1 else "–",
        "error": "–" if facts["error_px"] is None else number(facts["error_px"], 3),
        "depth": f"{facts['depth_m']:.2f}",
        "ends": "–" if ends is None else f"{ends[0]:.2f} to {ends[1]:.2f}",
        "picture": quote(f"{FITS}/{entry.name}.svg"),
        "height": "–" if facts["height_m"] is None else f"{facts['height_m']:.2f}",
        "warnings": facts["warnings"],
        "notes": facts["notes"],
    }


START = "start.npz"  # the body, from which training starts
MM = 1e3


@dataclass(frozen=True, eq=False)
class RegistrationFolder:
    """A folder with one folder for each registered scan, a page over all, and a table of subjects.

    Raises BadFile if the folder holds something else, or cannot be made.
    """

    FILES: ClassVar = "scans"  # in sentences: scans are registered
    DONE: ClassVar = "registered"
    place: Path  # where it is
    body: Body  # the body whose template is registered
    body_name: str  # as it was given
    recipe: Recipe  # how scans are registered
    reading: Reading  # how their files are read
    source: str  # what was given, by which the folder is known as ours
    rows: Mapping[str, Row]  # for training: subject, gender and set, by the scan's name

    def __post_init__(self) -> None:
        own_folder(self.place, self.source)
        self._write_summary([])

    def key(self, job: ScanJob) -> str:
        """16 letters that differ when anything does on which the registration depends: the file's
        contents, the body, the recipe, how the file is read, and the code.
        """
        stages = self.recipe.stages_of_vertices(self.body)
        about = (FORMAT, self.recipe, self.reading, self.body, stages)
        return digest([digest(about), file_digest(str(job.path)), code_version()])

    def kept(self, job: ScanJob, key: str) -> Entry | None:
        """The entry of a scan that is registered already under this key; None if it is not."""
        folder = self.place / job.name
        return kept_entry(job.name, key, folder / SUMMARY, [folder / ARRAYS])

    def keep(self, registered: RegisteredScan, key: str) -> Entry:
        """Write the folder of a scan, and return its entry."""
        folder = self.place / registered.job.name
        write_registration(registered, folder, body=self.body_name, key=key)
        entry = self.kept(registered.job, key)
        assert entry is not None  # it has just been written
        return entry

    def finish(self, entries: Sequence[Entry], failed: Sequence[FailedScan]) -> Path:
        """Write the page over all scans and, for training, the table of subjects and the body.

        Returns the page. Without entries there is no table.
        """
        write_file(self.place / "index.html", self._page(entries, failed))
        if entries:
            write_file(
                self.place / TABLE, subjects_csv([self.rows[entry.name] for entry in entries])
            )
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
            rows=[_registration_row(entry) for entry in entries],
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
            "failed": {failure.job.name: failure.reason for failure in failed},
        }
        files = ["index.html", TABLE, START, SUMMARY]
        write_file(self.place / SUMMARY, summary_text(self.source, about, files))


def _size(facts: Mapping[str, Any]) -> str:
    """Which size a summary tells: the height of a person, or the length of a hand."""
    return HEIGHT if f"{HEIGHT}_m" in facts else LENGTH


def _registration_row(entry: Entry) -> dict[str, Any]:
    facts = entry.facts
    return {
        "name": entry.name,
        "median": "–" if facts["median_m"] is None else number(MM * facts["median_m"], 3),
        "touching": f"{100 * facts['touching']:.0f} %",
        "hidden": f"{100 * (1 - facts['seen']):.0f} %",
        "size": f"{facts[f'{_size(facts)}_m']:.2f}",
        "seconds": number(facts["seconds"], 3),
        "warnings": facts["warnings"],
    }


PICTURE_HEIGHT, MARGIN = 120.0, 8.0  # px of the picture, and of it around the person


def thumbnail(picture: FittedPicture, parents: Sequence[int]) -> str:
    """The body's bones as lines, and the observed keypoints as circles, cropped to both.

    The higher the confidence of a keypoint, the more opaque its circle.
    """
    seen = picture.confidence > 0
    inside = np.concatenate([picture.joints, picture.observed[seen]])
    inside = inside[np.isfinite(inside).all(axis=1)]
    low, high = (inside.min(axis=0), inside.max(axis=0)) if len(inside) else (np.zeros(2),) * 2
    scale = (PICTURE_HEIGHT - 2 * MARGIN) / max(
        float(high[1] - low[1]), float(high[0] - low[0]), 1.0
    )
    size = scale * (high - low) + 2 * MARGIN

    def placed(points: Array) -> Array:
        return np.asarray(scale * (points - low) + MARGIN)

    joints = placed(picture.joints)
    lines = [
        f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"/>'
        for a, b in ((joints[parent], joints[k]) for k, parent in enumerate(parents) if k)
        if np.isfinite([a, b]).all()
    ]
    circles = [
        f'<circle cx="{u:.1f}" cy="{v:.1f}" r="2.2" stroke-opacity="{min(float(c), 1):.2f}"/>'
        for (u, v), c in zip(placed(picture.observed[seen]), picture.confidence[seen], strict=True)
    ]
    width, height = (f"{number:.0f}" for number in size)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" fill="none">'
        f'<g stroke="{BLUE}" stroke-width="2" stroke-linecap="round">{"".join(lines)}</g>'
        f'<g stroke="{VERMILLION}" stroke-width="1.2">{"".join(circles)}</g></svg>\n'
    )
