"""A diagnosis as a folder: one page with figures, and the same as text and as JSON beside it."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench import plots
from workbench.bodies.body import Body
from workbench.diagnostics import Diagnosis, DiagnosisComparison, SequenceDiagnosis
from workbench.diagnostics.diagnosis import diagnose_whole
from workbench.diagnostics.report import compared_blocks, further, held
from workbench.errors import BadArgument, joined
from workbench.fitting.refits import Profile
from workbench.fitting.setup import View
from workbench.plots.diagnosis import sparsity_sheet
from workbench.reports import diagnosis_tables
from workbench.reports.diagnosis_tables import gathered_directions_table, terms_table
from workbench.reports.direction_pictures import pictures
from workbench.reports.folder import SUMMARY, write_folder
from workbench.reports.page import Shown, drawn, page, plotted, spectrum
from workbench.reports.replay import recorded_diagnosis

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
    body: Body | None = None,
    views: Sequence[View] = (),
    against: Diagnosis | SequenceDiagnosis | None = None,
    profiles: Sequence[Profile] = (),
    source: str | None = None,
) -> Path:
    """Write the folder of a diagnosis, and return its page.

    With `body` the directions are drawn on it, and with `views` what cameras observed of it; with
    `against` a comparison is on the page, and with `profiles` a figure of each. The folder appears
    whole or not at all; raises BadFile if it cannot be written. The page of a long sequence is its
    report without figures, and BadArgument is raised for comparing it.
    """
    compared = None if against is None else _compared(diagnosis, against)
    text, data = diagnosis.report(), diagnosis.data()
    if compared is not None:
        text, data = f"{text}\n\nCOMPARISON\n{compared.report()}", compared.data()
    if profiles:
        text = "\n".join([text, "", "PROFILES", *map(str, profiles)])
    if isinstance(diagnosis, SequenceDiagnosis):
        html = sequence_page(diagnosis, title, question)
    else:
        html = diagnosis_page(diagnosis, title, question, body, views, compared, profiles)
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
    return page("sequence.html", **_findings(d, title, question), d=d, report=d.report())


def diagnosis_page(
    d: Diagnosis,
    title: str,
    question: str,
    body: Body | None,
    views: Sequence[View],
    compared: DiagnosisComparison | None,
    profiles: Sequence[Profile] = (),
) -> str:
    """The page of a diagnosis."""
    return page(
        "diagnosis.html",
        **_findings(d, title, question),
        d=d,
        suggestions=diagnosis_tables.suggestions_table(d),
        further=further(d),
        held=held(d) if d.active.any else "",
        sparsity=(None if d.here.estimated else drawn(sparsity_sheet, plots.caption_sparsity, d)),
        terms=terms_table(d),
        parts=diagnosis_tables.parts_table(d),
        compared=None if compared is None else compared.report(),
        profiles=[
            plotted(6.4, 4.0, plots.plot_profile_likelihood, plots.caption_profile_likelihood, one)
            for one in profiles
        ],
        **(_numbers(d, body, views) if d.here.finite else {}),
    )


def _findings(d: Diagnosis | SequenceDiagnosis, title: str, question: str) -> dict[str, Any]:
    """What every page of a diagnosis begins and ends with."""
    finite = d.here.finite
    return {
        "title": title,
        "question": question,
        "finite": finite,
        "rank": f"rank {d.rank} of {d.shape[1]}" if finite else "not finite",
        "warnings": [f.text for f in d.findings if f.warning],
        "notes": [f.text for f in d.findings if not f.warning],
        "files": FILES,
    }


def _sigmas(d: Diagnosis) -> dict[str, Any]:
    """The standard deviations, after a remedy where none of them is finite without it."""
    known, unknown = compared_blocks(d) if d.contributions else ([], [])
    found: dict[str, Any] = {
        "sigmas": None,
        "sigmas_known": bool(known),
        "sigmas_unknown": joined(unknown) if unknown else "",
    }
    if np.isfinite(d.identifiability.sigma).any():
        return found | {"sigmas": _drawn_sigmas(d)}
    for one in d.suggestions:
        if one.kind == "least":
            after = diagnose_whole(one.problem, one.values, priors=d.priors)
            return found | {"remedied": _drawn_sigmas(after), "remedied_by": one.what}
    return found


def _drawn_sigmas(d: Diagnosis) -> Shown:
    return plotted(8.0, 4.4, plots.plot_sigmas, plots.caption_sigmas, d)


def _numbers(d: Diagnosis, body: Body | None, views: Sequence[View]) -> dict[str, Any]:
    """What the page says of a Jacobian whose numbers are finite."""
    return {
        "scales": str(d.scales),
        "ranks": diagnosis_tables.ranks_table(d),
        "spectrum": spectrum(d),
        "null_table": gathered_directions_table(d.null_directions),
        "null_pictures": pictures(d, d.null_directions, body),
        "weak": gathered_directions_table(d.weak_directions, "characteristic scale"),
        "weak_pictures": pictures(d, d.weak_directions, body),
        "recording": recorded_diagnosis(d, body, views),
        "conditioning": diagnosis_tables.conditioning_table(d),
        **_sigmas(d),
        "share": plotted(8.0, 3.4, plots.plot_data_share, plots.caption_data_share, d)
        if d.priors and d.identifiability.data_share is not None
        else None,
        "known": diagnosis_tables.known_table(d),
        "entries": diagnosis_tables.entries_table(d),
        "contributions": diagnosis_tables.contributions_table(d),
        "taylor": plotted(6.0, 3.8, plots.plot_taylor, plots.caption_taylor, d),
        "derivatives": diagnosis_tables.derivatives_table(d),
    }
