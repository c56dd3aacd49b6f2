"""A registered scan as a folder: a page with figures, and the registration as files beside it."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.fitting.scans.scan import Scan
from workbench.geometry.meshes import write_mesh
from workbench.plots.registered_scan import (
    caption_registered_scan,
    caption_unseen,
    registered_scan_sheet,
    unseen_sheet,
)
from workbench.registration import OtherEnd, RegisteredScan, Registration, StageOutcome
from workbench.registration.coregistration.folder import SCAN
from workbench.replay import recorded_registration
from workbench.reports.figures import shown
from workbench.reports.folder import SUMMARY, Content, write_folder
from workbench.reports.page import page
from workbench.reports.tables import Columns, Table, number
from workbench.writing import write_arrays

ARRAYS, MESH = "registration.npz", "registration.ply"
FORMAT = 2  # of what is kept; raise it when these files change, so that none of before is taken
FILES = {
    "index.html": "this page",
    ARRAYS: "vertices, faces and confidence, as `workbench train` reads them; pose, betas and "
    "trans of the body; the standard deviation of each vertex",
    SCAN: "the points that were registered, their normals and areas if they are known, for "
    "`workbench coregister`",
    MESH: "the registered surface, with the vertices and faces of the template, in metres",
    SUMMARY: "the numbers of this page, for programs",
}
MM = 1e3


def write_registration(
    found: RegisteredScan,
    folder: str | Path,
    *,
    body: str,
    key: str = "",
    source: str | None = None,
) -> Path:
    """Write the folder of a registered scan, and return its page; whole or not at all.

    `body` is the name of the body; `key` stands for all that the registration depends on, and is
    kept in the summary. `source` is the file by which the folder is known; without one, a folder of
    ours about another file is replaced. Raises BadFile if the place cannot be written or holds
    something else.
    """
    one = found.registration
    contents: dict[str, Content] = {
        "index.html": registration_page(found, body),
        ARRAYS: lambda path: write_arrays(path, arrays(one)),
        SCAN: lambda path: write_arrays(path, points(one.scan)),
        MESH: lambda path: write_mesh(path, one.vertices, one.faces),
    }
    return write_folder(folder, source, contents, summary(found, body, key))


def arrays(one: Registration) -> dict[str, NDArray[Any]]:
    """The arrays of a registration by name. Vertices that were not seen have the confidence 0."""
    return {
        "vertices": one.vertices,
        "faces": one.faces,
        "confidence": one.seen.astype(np.float64),
        **one.values,
        "model": one.model,
        "sd": one.sd,
    }


def points(scan: Scan) -> dict[str, NDArray[Any]]:
    """The arrays of a scan by name; single precision tells apart less than a micrometre."""
    found = {"points": scan.points, "normals": scan.normals, "areas": scan.weights}
    return {name: array.astype(np.float32) for name, array in found.items() if array is not None}


def summary(found: RegisteredScan, body: str, key: str = "") -> dict[str, Any]:
    """The numbers of the page, for programs: lengths in m, times in s."""
    one = found.registration
    last = one.stages[-1]
    return {
        "kind": "registration",
        "key": key,
        "scan": found.job.name,
        "file": str(found.job.path.resolve()),
        "body": body,
        "points": one.scan.n_points,
        "left_out": one.left_out,
        "median_m": last.median,
        "touching": last.touching,
        "seen": float(one.seen.mean()),
        f"{one.size.name}_m": one.size.metres,
        "seconds": sum(stage.seconds for stage in one.stages),
        "warnings": list(one.doubts),
        "notes": list(found.notes),
    }


def registration_page(found: RegisteredScan, body: str) -> str:
    """The page of a registered scan."""
    one = found.registration
    return page(
        "registration.html",
        title=f"{body} on {found.job.path.name}",
        facts=_facts(one),
        warnings=one.doubts,
        notes=found.notes,
        scan=shown(
            registered_scan_sheet(
                one.vertices, one.faces, one.scan.points, one.distances, one.touching, one.facing
            ),
            caption_registered_scan(one.distances, one.touching),
        ),
        unseen=shown(
            unseen_sheet(one.vertices, one.faces, one.seen, one.sd, one.facing),
            caption_unseen(one.seen, one.sd),
        ),
        stages=stages_table(one),
        moved=MM * float(np.linalg.norm(one.vertices - one.model, axis=1).mean()),
        others=others_table(one),
        files=FILES,
        recording=recorded_registration(one),
    )


def _facts(one: Registration) -> dict[str, str]:
    betas = list(one.values.values())[1]
    left = f"; {one.left_out:,} at the boundary were left out" if one.left_out else ""
    hidden = int((~one.seen).sum())
    return {
        "points used": f"{one.scan.n_points:,}{left}",
        "in contact": f"{100 * one.stages[-1].touching:.0f} %",
        "their median distance": f"{MM * one.median:.1f} mm",
        "vertices not seen": f"{hidden:,} of {len(one.seen):,}",
        f"{one.size.name} at rest": f"{one.size.metres:.2f} m",
        "length of the betas": f"{np.linalg.norm(betas):.1f} standard deviations",
        "time": f"{sum(stage.seconds for stage in one.stages):.1f} s",
    }


def stages_table(one: Registration) -> Table:
    """How each stage ended."""
    columns: Columns[StageOutcome] = {
        "stage": lambda stage: stage.name,
        "unknowns": lambda stage: f"{stage.unknowns:,}",
        "iterations": lambda stage: f"{stage.iterations:,}",
        "cost": lambda stage: number(stage.cost),
        "in contact": lambda stage: f"{100 * stage.touching:.0f} %",
        "median distance (mm)": lambda stage: number(MM * stage.median, 3),
        "time (s)": lambda stage: number(stage.seconds, 3),
    }
    return Table.of(one.stages, columns, tuple(range(1, 7)))


def others_table(one: Registration) -> Table | None:
    """The other ends of the fit of the body; None if there were none."""
    if not one.others:
        return None
    columns: Columns[tuple[int, OtherEnd]] = {
        "end": lambda of: str(of[0]),
        "cost above the best": lambda of: f"{100 * of[1].excess:.1f} %",
        "vertices differ by (mm)": lambda of: number(MM * of[1].apart, 3),
    }
    return Table.of(enumerate(one.others, start=2), columns, (0, 1, 2))
