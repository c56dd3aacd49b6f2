"""The folder of a coregistration: its page, the body, and the registrations for training."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.files.saving import save_body
from workbench.plots.body import Figurine, front
from workbench.plots.distances import line_up_coloured
from workbench.plots.figure import drawn as figure_of
from workbench.plots.joint_cost import caption_joint_cost, plot_joint_cost
from workbench.registration.coregistration import Coregistration, State
from workbench.registration.coregistration.folder import (
    BODY,
    RegisteredScans,
    beyond_betas,
    distances,
)
from workbench.reports.figures import Shown, plotted, shown
from workbench.reports.folder import SUMMARY, summary_text
from workbench.reports.page import page
from workbench.reports.registration_folder import table_of
from workbench.reports.tables import Table, number
from workbench.training.folder import TABLE, Row
from workbench.writing import write_arrays, write_file

REGISTRATIONS, LEARNED = "registrations", "body.npz"
FILES = {
    "index.html": "this page",
    LEARNED: "the body that was learned, with its model card in it",
    REGISTRATIONS + "/": "the registrations, as workbench train reads them",
    "coregistration.npz": "everything that was found, from which a run with more scans or rounds "
    "does not continue: remove it to start anew",
    SUMMARY: "the numbers of this page, for programs",
}
MM = 1e3
DRAWN = 6  # people in the figure


@dataclass(frozen=True, eq=False)
class Coregistered:
    """A coregistration that has ended, with what is written of it.

    Attributes:
        problem: the joint problem.
        scans: where its scans are from.
        state: how it ended.
        body: the body that was learned.
    """

    problem: Coregistration
    scans: RegisteredScans
    state: State
    body: SkinnedBody


def write_coregistration(found: Coregistered, place: Path, source: str) -> Path:
    """Write everything into `place`, which exists, and return its page. Raises BadFile."""
    registrations = place / REGISTRATIONS
    registrations.mkdir(exist_ok=True)
    names, start = found.scans.names, found.problem.body
    # about 1 where a surface was scanned: a scan is sure across its surface, and not along it
    trust = np.trace(found.state.confidence, axis1=2, axis2=3)
    for name, vertices, seen in zip(names, found.state.vertices, trust, strict=True):
        arrays = {"vertices": vertices, "faces": start.faces, "confidence": seen.clip(0, 1)}
        write_arrays(registrations / f"{name}.npz", arrays)
    rows = [
        Row(f"{name}.npz", row.subject, row.gender, row.set)
        for name, row in zip(names, found.scans.rows, strict=True)
    ]
    write_file(registrations / TABLE, table_of(rows))
    for path, body in ((registrations / BODY, start), (place / LEARNED, found.body)):
        save_body(body, path)
    scans, state = found.scans, found.state
    measured = distances(scans, start, state.vertices)
    away = beyond_betas(start, state.estimate.templates)
    for name, text in (
        ("index.html", coregistration_page(found, measured, away, str(place))),
        (SUMMARY, summary_text(source, summary(found, measured, away), list(FILES))),
    ):
        write_file(place / name, text)
    return place / "index.html"


def begin_folder(place: Path, source: str) -> None:
    """Mark a folder as that of a coregistration of `source`, before there is a result."""
    write_file(place / SUMMARY, summary_text(source, {"kind": "coregistration"}, list(FILES)))


def coregistration_page(
    found: Coregistered, measured: Mapping[str, Array], beyond: Array, place: str
) -> str:
    """The page of a coregistration; `beyond` (S, N) m is what `beyond_betas` says of templates."""
    log, away = found.state.log, MM * beyond
    subjects, counts = found.scans.subjects, np.bincount(found.scans.subject)
    return page(
        "coregistration.html",
        title=f"{len(found.scans.rows)} scans of {len(subjects)} people, together",
        rows=len(found.scans.rows),
        people=len(subjects),
        rounds=found.problem.plan.rounds,
        doubted=[f"{n}, by itself: {d}" for n, told in found.scans.doubts().items() for d in told],
        folder=place,
        cost=plotted(9.0, 4.4, plot_joint_cost, caption_joint_cost, log),
        templates=_templates(found, away),
        subjects=Table(
            ("person", "scans", "beyond betas, mean (mm)", "at most (mm)"),
            tuple(
                (name, str(n), number(one.mean(), 3), number(one.max(), 3))
                for name, n, one in zip(subjects, counts, away, strict=True)
            ),
            (1, 2, 3),
        ),
        scans=Table(
            ("scan", "person", "apart (mm)", "together (mm)", "moved (mm)"),
            tuple(
                (name, row.subject, *(number(MM * measured[k][j], 3) for k in measured))
                for j, (name, row) in enumerate(
                    zip(found.scans.names, found.scans.rows, strict=True)
                )
            ),
            (2, 3, 4),
        ),
        files=FILES,
    )


def _templates(found: Coregistered, away: Array) -> Shown:
    """The first people's templates, coloured by what betas do not reach."""
    each = found.state.estimate.templates[:DRAWN]
    names = found.scans.subjects
    coloured = [
        (Figurine(name, T, front), d) for name, T, d in zip(names, each, away, strict=False)
    ]
    end = float(np.percentile(away, 98))
    label = "from the nearest shape of the starting body (mm)"
    draw = partial(line_up_coloured, coloured, found.problem.body.faces, end, label)
    more = "" if len(names) <= DRAWN else f" of the first {DRAWN} people"
    caption = (
        f"The templates{more}, coloured by their distance from the nearest shape that betas of the "
        "starting body reach: what was learned about a person that this body could not say. Look "
        "for whole regions of one colour, such as a belly; scattered spots are noise."
    )
    return shown(figure_of(draw, 2.0 + 1.6 * len(coloured), 3.2), caption)


def summary(found: Coregistered, measured: Mapping[str, Array], beyond: Array) -> dict[str, Any]:
    """The numbers of the page, for programs: lengths in m, times in s."""
    log = found.state.log
    return {
        "kind": "coregistration",
        "scans": list(found.scans.names),
        "warnings": found.scans.doubts(),
        "subjects": list(found.scans.subjects),
        "costs": [log[0].before, *(entry.after for entry in log)],
        "blocks": [entry.block for entry in log],
        "seconds": sum(entry.seconds for entry in log),
        "median_m": {name: each.tolist() for name, each in measured.items()},
        "beyond_betas_m": beyond.mean(axis=1).tolist(),
    }
