"""A diagnosis as a folder: one page with figures, and the same as text and as JSON beside it."""

import json
from pathlib import Path

from workbench.bodies import SkinnedBody
from workbench.diagnostics import Diagnosis, DiagnosisComparison, SequenceDiagnosis
from workbench.diagnostics.findings import held
from workbench.diagnostics.structure import pose_moves_template
from workbench.errors import BadArgument
from workbench.plots import (
    caption_data_share,
    caption_sigmas,
    caption_singular_values,
    caption_sparsity,
    caption_taylor,
    sheets,
)
from workbench.reports import tables
from workbench.reports.diagnosis_tables import (
    conditioning_table,
    contributions_table,
    derivatives_table,
    entries_table,
    known_table,
    parts_table,
    ranks_table,
    suggestions_table,
)
from workbench.reports.direction_pictures import pictures
from workbench.reports.figures import shown
from workbench.reports.folder import SUMMARY, write_folder
from workbench.reports.page import page

FILES = {
    "index.html": "this page",
    "diagnosis.txt": "the diagnosis as text",
    "diagnosis.json": "the diagnosis as data, for programs; its schema has a version",
    SUMMARY: "the title and the number of warnings, for programs",
}


def write_diagnosis(
    diagnosis: Diagnosis | SequenceDiagnosis,
    folder: str | Path,
    *,
    title: str,
    question: str = "",
    body: SkinnedBody | None = None,
    against: Diagnosis | SequenceDiagnosis | None = None,
    source: str | None = None,
) -> Path:
    """Write the folder of a diagnosis, and return its page.

    With `body` the directions are drawn on it; with `against` a comparison is on the page. The
    folder appears whole or not at all; raises BadFile if it cannot be written. The page of a long
    sequence is its report without figures, and BadArgument is raised for comparing it.
    """
    compared = None if against is None else _compared(diagnosis, against)
    text, data = diagnosis.report(), diagnosis.data()
    if compared is not None:
        text, data = f"{text}\n\nCOMPARISON\n{compared.report()}", compared.data()
    if isinstance(diagnosis, SequenceDiagnosis):
        html = sequence_page(diagnosis, title, question)
    else:
        html = diagnosis_page(diagnosis, title, question, body, compared)
    contents = {
        "index.html": html,
        "diagnosis.txt": text + "\n",
        "diagnosis.json": json.dumps(data, indent=1, allow_nan=False),
    }
    summary = {"title": title, "warnings": len(diagnosis.warnings)}
    return write_folder(folder, source, contents, summary)


def _compared(
    first: Diagnosis | SequenceDiagnosis, second: Diagnosis | SequenceDiagnosis
) -> DiagnosisComparison:
    if isinstance(first, SequenceDiagnosis) or isinstance(second, SequenceDiagnosis):
        raise BadArgument(
            "diagnoses are compared by their singular values, which a long sequence does not have; "
            "compare frames of it instead: diagnosis.frame(t)"
        )
    return DiagnosisComparison(first, second)


def sequence_page(d: SequenceDiagnosis, title: str, question: str) -> str:
    """The page of a long sequence: its findings and its report."""
    return page(
        "sequence.html",
        title=title,
        question=question,
        shape=f"{d.count:,} frames, {d.shape[0]:,} residuals by {d.shape[1]:,} unknowns",
        rank=f"rank {d.rank} of {d.shape[1]}" if d.here.finite else "not finite",
        warnings=[f.text for f in d.findings if f.warning],
        notes=[f.text for f in d.findings if not f.warning],
        report=d.report(),
        files=FILES,
    )


def diagnosis_page(
    d: Diagnosis,
    title: str,
    question: str,
    body: SkinnedBody | None,
    compared: DiagnosisComparison | None,
) -> str:
    """The page of a diagnosis."""
    finite = d.here.finite
    return page(
        "diagnosis.html",
        title=title,
        question=question,
        shape=f"{d.shape[0]:,} residuals by {d.shape[1]:,} unknowns",
        rank=f"rank {d.rank} of {d.shape[1]}" if finite else "not finite",
        warnings=[f.text for f in d.findings if f.warning],
        notes=[f.text for f in d.findings if not f.warning],
        suggestions=suggestions_table(d),
        density=f"{d.density:.1%}",
        nonzeros=f"{d.nonzeros:,}",
        thick=f"{d.thick:,}" if finite else "",
        thin=finite and d.thick < d.nonzeros,
        pose_moves_template=pose_moves_template(d.problem),
        yardsticks=str(d.point.yardsticks) if finite else "",
        held=held(d) if d.point.active.any else "",
        sparsity=None if d.here.estimated else shown(sheets.sparsity_sheet(d), caption_sparsity(d)),
        terms=tables.terms_table(d),
        parts=parts_table(d),
        ranks=ranks_table(d) if finite else None,
        spectrum=(
            shown(sheets.singular_values_sheet(d), caption_singular_values(d)) if finite else None
        ),
        estimated=d.here.estimated,
        unseen=tables.gathered_directions_table(d.null_directions) if finite else None,
        unseen_pictures=pictures(d, d.null_directions, body) if finite else [],
        weak=tables.gathered_directions_table(d.weak_directions, "yardstick") if finite else None,
        weak_pictures=pictures(d, d.weak_directions, body) if finite else [],
        conditioning=conditioning_table(d) if finite else None,
        sigmas=shown(sheets.sigmas_sheet(d), caption_sigmas(d)) if finite else None,
        share=(
            shown(sheets.data_share_sheet(d), caption_data_share(d))
            if finite and d.priors
            else None
        ),
        known=known_table(d) if finite else None,
        entries=entries_table(d) if finite else None,
        contributions=contributions_table(d) if finite else None,
        taylor=shown(sheets.taylor_sheet(d), caption_taylor(d)) if finite else None,
        derivatives=derivatives_table(d) if finite else None,
        compared=None if compared is None else compared.report(),
        files=FILES,
    )
