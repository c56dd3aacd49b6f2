"""The page of a registered scan, and of a coregistration."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.files.saving import save_body
from workbench.fitting.scans.scan import Scan
from workbench.geometry.meshes import write_mesh
from workbench.plots.body import Figurine, front, line_up_coloured
from workbench.plots.scans import (
    caption_joint_cost,
    caption_registered_scan,
    plot_joint_cost,
    registered_scan_sheet,
)
from workbench.plots.style import figure_of
from workbench.registration import OtherEnd, RegisteredScan, Registration, StageOutcome
from workbench.registration.coregistration import Coregistration, TriangleCoregistration
from workbench.registration.coregistration.folder import (
    BODY_FILE,
    SCAN_FILE,
    RegisteredScans,
    beyond_betas,
    distances,
)
from workbench.reports.folder import SUMMARY, Content, summary_text, write_folder
from workbench.reports.page import (
    Columns,
    Shown,
    Table,
    csv_text,
    drawn,
    number,
    page,
    plotted,
    shown,
)
from workbench.reports.replay import recorded_registration
from workbench.reports.run import measurements_summary, measurements_table
from workbench.training.folder import COLUMNS, TABLE, Row
from workbench.writing import write_arrays, write_file

ARRAYS, MESH = "registration.npz", "registration.ply"
FORMAT = 2  # of what is kept; raise it when these files change, so that older ones are not reused
FILES = {
    "index.html": "this page",
    ARRAYS: "vertices, faces and confidence, as `workbench train` reads them; pose, betas and "
    "trans of the body; the standard deviation of each vertex",
    SCAN_FILE: "the points that were registered, their normals and areas if they are known, for "
    "`workbench coregister`",
    MESH: "the registered surface, with the vertices and faces of the template, in metres",
    SUMMARY: "the numbers of this page, for programs",
}
MM = 1e3


def write_registration(
    registered: RegisteredScan,
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
    registration = registered.registration
    contents: dict[str, Content] = {
        "index.html": registration_page(registered, body),
        ARRAYS: lambda path: write_arrays(path, arrays(registration)),
        SCAN_FILE: lambda path: write_arrays(path, points(registration.scan)),
        MESH: lambda path: write_mesh(path, registration.vertices, registration.faces),
    }
    return write_folder(folder, source, contents, summary(registered, body, key))


def arrays(registration: Registration) -> dict[str, NDArray[Any]]:
    """The arrays of a registration by name. Vertices that were not seen have the confidence 0."""
    return {
        "vertices": registration.vertices,
        "faces": registration.faces,
        "confidence": registration.seen.astype(np.float64),
        **registration.values,
        "model": registration.model,
        "sd": registration.sd,
    }


def points(scan: Scan) -> dict[str, NDArray[Any]]:
    """The arrays of a scan by name; single precision tells apart less than a micrometre."""
    named = {"points": scan.points, "normals": scan.normals, "areas": scan.weights}
    return {name: array.astype(np.float32) for name, array in named.items() if array is not None}


def summary(registered: RegisteredScan, body: str, key: str = "") -> dict[str, Any]:
    """The numbers of the page, for programs: lengths in m, times in s."""
    registration = registered.registration
    last = registration.stages[-1]
    return {
        "kind": "registration",
        "key": key,
        "scan": registered.job.name,
        "file": str(registered.job.path.resolve()),
        "body": body,
        "points": registration.scan.n_points,
        "left_out": registration.left_out,
        "median_m": last.median,
        "touching": last.touching,
        "seen": float(registration.seen.mean()),
        f"{registration.size.name}_m": registration.size.metres,
        "measurements": measurements_summary(registration.measurements),
        "seconds": sum(stage.seconds for stage in registration.stages),
        "warnings": list(registration.doubts),
        "notes": list(registered.notes),
    }


def registration_page(registered: RegisteredScan, body: str) -> str:
    """The page of a registered scan."""
    registration = registered.registration
    return page(
        "registration.html",
        title=f"{body} on {registered.job.path.name}",
        facts=_facts(registration),
        warnings=registration.doubts,
        notes=registered.notes,
        scan=drawn(registered_scan_sheet, caption_registered_scan, registration),
        measurements=measurements_table(registration.measurements),
        stages=stages_table(registration),
        moved=MM * float(np.linalg.norm(registration.vertices - registration.model, axis=1).mean()),
        others=others_table(registration),
        files=FILES,
        recording=recorded_registration(registration),
    )


def _facts(registration: Registration) -> dict[str, str]:
    betas = list(registration.values.values())[1]
    left_out = registration.left_out
    without = f"; {left_out:,} at the boundary were left out" if left_out else ""
    hidden, known = ~registration.seen, ""
    if hidden.any():
        off = MM * float(np.sqrt(np.mean(registration.sd[hidden] ** 2)))
        known = f"; they rest on the priors, with a standard deviation of {off:.0f} mm"
    return {
        "points used": f"{registration.scan.n_points:,}{without}",
        "in contact": f"{100 * registration.stages[-1].touching:.0f} %",
        "their median distance": f"{MM * registration.median:.1f} mm",
        "vertices not seen": f"{hidden.sum():,} of {len(registration.seen):,}{known}",
        f"{registration.size.name} at rest": f"{registration.size.metres:.2f} m",
        "length of the betas": f"{np.linalg.norm(betas):.1f} standard deviations",
        "time": f"{sum(stage.seconds for stage in registration.stages):.1f} s",
    }


def stages_table(registration: Registration) -> Table:
    """How each stage ended."""
    columns: Columns[StageOutcome] = {
        "stage": lambda stage: stage.name,
        "unknowns": lambda stage: f"{stage.unknowns:,}",
        "iterations": lambda stage: f"{stage.iterations:,}",
        "cost": lambda stage: number(stage.cost),
        "in contact": lambda stage: f"{100 * stage.touching:.0f} %",
        "median (mm)": lambda stage: number(MM * stage.median, 3),
        "time (s)": lambda stage: number(stage.seconds, 3),
    }
    return Table.of(registration.stages, columns, tuple(range(1, 7)))


def others_table(registration: Registration) -> Table | None:
    """The other ends of the fit of the body; None if there were none."""
    if not registration.others:
        return None
    columns: Columns[tuple[int, OtherEnd]] = {
        "end": lambda of: str(of[0]),
        "cost above the best": lambda of: f"{100 * of[1].excess:.1f} %",
        "vertices differ by (mm)": lambda of: number(MM * of[1].apart, 3),
    }
    return Table.of(enumerate(registration.others, start=2), columns, (0, 1, 2))


REGISTRATIONS, LEARNED = "registrations", "body.npz"
JOINT_FILES = {
    "index.html": "this page",
    LEARNED: "the body that was learned, with its model card in it",
    REGISTRATIONS + "/": "the registrations, as workbench train reads them",
    "coregistration.npz": "everything that was found, from which a run with more scans or rounds "
    "does not continue: remove it to start anew",
    SUMMARY: "the numbers of this page, for programs",
}
MOST_TEMPLATES = 6  # people in the figure


def write_coregistration(
    start: SkinnedBody,
    scans: RegisteredScans,
    problem: Coregistration | TriangleCoregistration,
    state: Any,
    betas: int,
    place: Path,
    source: str,
) -> Path:
    """Write the end of a problem's run, its `state`, into `place`, which exists; return the page.

    `start` is the body that was registered to each scan by itself. The learned body has at most
    `betas` shape directions. Raises BadFile.
    """
    learned = problem.learned(state, betas)
    registrations = place / REGISTRATIONS
    registrations.mkdir(exist_ok=True)
    names = scans.names
    for name, vertices, seen in zip(names, state.vertices, problem.seen(state), strict=True):
        arrays = {"vertices": vertices, "faces": start.faces, "confidence": seen}
        write_arrays(registrations / f"{name}.npz", arrays)
    rows = [
        Row(f"{name}.npz", row.subject, row.gender, row.set)
        for name, row in zip(names, scans.rows, strict=True)
    ]
    write_file(registrations / TABLE, subjects_csv(rows))
    for path, body in ((registrations / BODY_FILE, start), (place / LEARNED, learned)):
        save_body(body, path)
    measured = distances(scans, start, state.vertices)
    away = beyond_betas(start, state.templates)
    html = coregistration_page(start, scans, problem, state, measured, away, str(place))
    write_file(place / "index.html", html)
    numbers = {  # of the page, for programs: lengths in m, times in s
        "kind": "coregistration",
        "scans": list(scans.names),
        "warnings": scans.doubts(),
        "subjects": list(scans.subjects),
        "costs": [state.log[0].before, *(entry.after for entry in state.log)],
        "blocks": [entry.block for entry in state.log],
        "seconds": sum(entry.seconds for entry in state.log),
        "median_m": {name: each.tolist() for name, each in measured.items()},
        "beyond_betas_m": away.mean(axis=1).tolist(),
    }
    write_file(place / SUMMARY, summary_text(source, numbers, list(JOINT_FILES)))
    return place / "index.html"


def subjects_csv(rows: Sequence[Row]) -> str:
    """The table of subjects (.csv) of registered scans, as `open_folder` reads it."""
    return csv_text(COLUMNS, ((row.file, row.subject, row.gender, row.set) for row in rows))


def begin_folder(place: Path, source: str) -> None:
    """Mark a folder as that of a coregistration of `source`, before there is a result."""
    summary = summary_text(source, {"kind": "coregistration"}, list(JOINT_FILES))
    write_file(place / SUMMARY, summary)


def coregistration_page(
    start: SkinnedBody,
    scans: RegisteredScans,
    problem: Coregistration | TriangleCoregistration,
    state: Any,
    measured: Mapping[str, Array],
    beyond: Array,
    place: str,
) -> str:
    """The page of a coregistration; `beyond` (S, N) m is what `beyond_betas` says of templates."""
    away, subjects, counts = MM * beyond, scans.subjects, np.bincount(scans.subject)
    return page(
        "coregistration.html",
        title=f"{len(scans.rows)} scans of {len(subjects)} people, together",
        rows=len(scans.rows),
        people=len(subjects),
        rounds=problem.plan.rounds,
        doubted=[f"{n}, by itself: {d}" for n, doubts in scans.doubts().items() for d in doubts],
        folder=place,
        cost=plotted(9.0, 4.4, plot_joint_cost, caption_joint_cost, state.log),
        templates=_templates(start, state.templates, subjects, away),
        subjects=Table(
            ("person", "scans", "beyond betas, mean (mm)", "at most (mm)"),
            tuple(
                (name, str(n), number(d.mean(), 3), number(d.max(), 3))
                for name, n, d in zip(subjects, counts, away, strict=True)
            ),
            (1, 2, 3),
        ),
        scans=Table(
            ("scan", "person", "apart (mm)", "together (mm)", "moved (mm)"),
            tuple(
                (name, row.subject, *(number(MM * measured[k][j], 3) for k in measured))
                for j, (name, row) in enumerate(zip(scans.names, scans.rows, strict=True))
            ),
            (2, 3, 4),
        ),
        files=JOINT_FILES,
    )


def _templates(start: SkinnedBody, templates: Array, names: Sequence[str], away: Array) -> Shown:
    """The first people's templates, coloured by what betas do not reach."""
    people = zip(names, templates[:MOST_TEMPLATES], away, strict=False)
    coloured = [(Figurine(name, T, front), d) for name, T, d in people]
    end = float(np.percentile(away, 98))
    label = "from the nearest shape of the starting body (mm)"
    draw = partial(line_up_coloured, coloured, start.faces, end, label)
    more = "" if len(names) <= MOST_TEMPLATES else f" of the first {MOST_TEMPLATES} people"
    caption = (
        f"The templates{more}, coloured by their distance from the nearest shape that betas of the "
        "starting body reach: what was learned about a person that this body could not say. Look "
        "for whole regions of one colour, such as a belly; scattered spots are noise."
    )
    return shown(figure_of(draw, 2.0 + 1.6 * len(coloured), 3.2), caption)
