"""The pages of a diagnosis and of a design of measurements, with figures and tables."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from workbench import plots
from workbench.bodies.body import Body
from workbench.diagnostics import (
    Diagnosis,
    DiagnosisComparison,
    Direction,
    EntryIdentifiability,
    MeasurementDesign,
    SequenceDiagnosis,
)
from workbench.diagnostics.conditioning import PARALLEL
from workbench.diagnostics.report import VERDICTS, compared_blocks, held
from workbench.diagnostics.structure import Submatrix, TermBlock
from workbench.diagnostics.words import gathered, named_groups, named_rows
from workbench.errors import BadArgument
from workbench.fitting.refits import Profile
from workbench.fitting.setup import View
from workbench.plots.diagnosis import MOST_RANKED
from workbench.reports.folder import SUMMARY, write_folder
from workbench.reports.page import Columns, Table, number, page, plotted, sparsity_figure, spectrum
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
        context = _findings(diagnosis, title, question)
        html = page("sequence.html", **context, d=diagnosis, report=diagnosis.report())
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
        suggestions=suggestions_table(d),
        held=held(d) if d.active.any else "",
        sparsity=None if d.here.estimated else sparsity_figure(d),
        terms=terms_table(d),
        parts=parts_table(d),
        compared=None if compared is None else compared.report(),
        profiles=[
            plotted(
                6.4, 4.0, plots.plot_profile_likelihood, plots.caption_profile_likelihood, profile
            )
            for profile in profiles
        ],
        **(_finite_part(d, body, views) if d.here.finite else {}),
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


def _finite_part(d: Diagnosis, body: Body | None, views: Sequence[View]) -> dict[str, Any]:
    """What the page says of a Jacobian whose numbers are finite."""
    return {
        "scales": str(d.scales),
        "ranks": ranks_table(d),
        "spectrum": spectrum(d),
        "null_table": gathered_directions_table(d.null_directions),
        "weak": gathered_directions_table(d.weak_directions, "characteristic scale"),
        "recording": recorded_diagnosis(d, body, views),
        "conditioning": conditioning_table(d),
        "sigmas": plotted(8.0, 4.4, plots.plot_sigmas, plots.caption_sigmas, d)
        if np.isfinite(d.identifiability.sigma).any()
        else None,
        "known": known_table(d),
        "entries": entries_table(d),
        "contributions": contributions_table(d),
        "derivatives": derivatives_table(d),
    }


MOST_LISTED = 3000  # entries


def suggestions_table(d: Diagnosis) -> Table:
    """What to do, why, and the rank and condition before and after it."""
    rows = tuple((s.what, str(s.before), str(s.after), s.why, s.cost) for s in d.suggestions)
    return Table(("suggestion", "before", "after", "why", "what it costs"), rows, ())


def parts_table(d: Diagnosis) -> Table:
    """The three parts of the structure, by Dulmage and Mendelsohn's decomposition."""
    s = d.structure
    parts = (("over-determined", s.over), ("square", s.square), ("under-determined", s.under))
    columns: Columns[tuple[str, Submatrix]] = {
        "part": lambda of: of[0],
        "rows": lambda of: f"{len(of[1].rows):,}",
        "unknowns": lambda of: f"{len(of[1].columns):,}",
        "which rows": lambda of: named_rows(d.rows, of[1].rows) or "–",
        "which unknowns": lambda of: named_groups(d.free, of[1].columns) or "–",
    }
    return Table.of(parts, columns, (1, 2))


def ranks_table(d: Diagnosis) -> Table:
    """The structural rank, the numerical rank, and what they depend on."""
    n = d.shape[1]
    rows = [
        ("structural rank", str(d.structural_rank), "the most that this pattern of zeros allows"),
        (
            "numerical rank",
            str(d.rank),
            f"singular values above {number(d.tolerance, 2)} at this point",
        ),
    ]
    if d.ranks_nearby:
        near = ", ".join(map(str, d.ranks_nearby))
        rows.append(("nearby", near, "at random points a tenth of a characteristic scale away"))
    if d.rank_law:
        rows.append(("rank law of observed joints", str(d.rank_law[0]), d.rank_law[1]))
    rows.append(("unknowns", str(n), "the rank needed to determine all of them"))
    return Table(("which", "rank", "what it says"), tuple(rows), (1,))


def conditioning_table(d: Diagnosis) -> Table:
    """Column lengths, near-parallel pairs, the weakest direction."""
    norms = d.here.column_norms
    rows: list[tuple[str, str, str]] = []
    if norms.size:
        longest, shortest = int(np.argmax(norms)), int(np.argmin(norms))
        rows += [
            ("condition", number(d.condition, 3), "largest over smallest singular value"),
            ("longest column", number(float(norms[longest]), 3), d.free.label(longest)),
            ("shortest column", number(float(norms[shortest]), 3), d.free.label(shortest)),
        ]
    for pair in d.parallel_columns[:8]:
        what = f"{d.free.label(pair.first)} and {d.free.label(pair.second)}"
        label = "the same column" if pair.sine <= PARALLEL else "nearly parallel (sine)"
        rows.append((label, number(pair.sine, 2), what))
    for weak in d.weakest[:2]:
        columns = ", ".join(gathered(d.free.labels_of(weak.columns[:8])))
        seen_by = ", ".join(d.problem.row_label(i) for i in weak.rows[:3])
        more = " and others" if len(weak.rows) > 3 else ""
        rows.append(
            (
                "weakest direction (|J d|)",
                number(weak.change, 3),
                f"{columns}; it changes {seen_by}{more}",
            )
        )
    return Table(("quantity", "value", "where"), tuple(rows), (1,))


def known_table(d: Diagnosis) -> Table:
    """How many entries of each block are identified, and why others are not."""
    rows = []
    for block in d.free.blocks:
        verdicts = d.identifiability.verdicts[d.free.slices[block.name]]
        counts = (str(verdicts.count(v)) for v in reversed(EntryIdentifiability))
        rows.append((block.name, block.unit, *counts))
    head = ("block", "unit", *VERDICTS)
    return Table(head, tuple(rows), (2, 3, 4, 5))


def entries_table(d: Diagnosis) -> Table:
    """A table with a row for every unknown."""
    known, sizes = d.identifiability, d.scales.sizes
    columns: Columns[int] = {
        "unknown": d.free.label,
        "unit": d.free.unit,
        "sigma": lambda i: number(float(known.sigma[i]), 3),
        "prior sigma": lambda i: number(float(known.prior_sigma[i]), 3),
        "characteristic scale": lambda i: number(float(sizes[i]), 3),
        "verdict": lambda i: known.verdicts[i].value,
    }
    return Table.of(range(min(d.free.size, MOST_LISTED)), columns, (2, 3, 4))


def contributions_table(d: Diagnosis) -> Table | None:
    """The rank and the standard deviations with and without each residual, None if not computed."""
    if not d.contributions:
        return None
    names, _ = compared_blocks(d)

    def row(name: str, rank: int, sigma: Mapping[str, float]) -> tuple[str, ...]:
        return name, str(rank), *(number(sigma[n], 2) for n in names)

    whole = d.contributions[0]
    rows = [row("nothing", whole.rank_with, whole.sigma_with)]
    rows += [row(c.residual, c.rank_without, c.sigma_without) for c in d.contributions]
    head = ("left out", "rank", *(f"sigma of {n}" for n in names))
    return Table(head, tuple(rows), tuple(range(1, len(head))))


def derivatives_table(d: Diagnosis) -> Table:
    """What was checked and how far off it is."""
    check = d.derivatives
    rows = [
        ("entries not confirmed by differences", str(check.wrong), f"{len(check.columns)} columns"),
        ("largest error", number(check.largest_error, 2), "of the column's largest entry"),
        ("gradient against J'r", number(check.gradient_error, 2), "relative"),
    ]
    if check.slope is not None:
        rows.append(("error of the linear model", f"like h^{check.slope:.2f}", "h^2 is right"))
    if check.neglected is not None:
        share = f"{check.neglected:.1%}"
        rows.append(("left out by J'J", share, "of the exact Hessian, as in Gauss-Newton"))
    for s in check.suspects:
        where = f"{d.problem.row_label(s.row)} by {d.free.label(s.column)}"
        values = f"given {number(s.given, 6)}, differences {number(s.differences, 6)}"
        rows.append(("suspect", values, where))
    return Table(("quantity", "value", "where"), tuple(rows), (1,))


def terms_table(diagnosis: Diagnosis) -> Table:
    """The Jacobian by term and block, without pairs that do not depend on each other."""
    columns: Columns[TermBlock] = {
        "term": lambda t: t.residual,
        "block": lambda t: t.block,
        "rows": lambda t: f"{t.rows:,}",
        "columns": lambda t: f"{t.columns:,}",
        "nonzeros": lambda t: f"{t.nonzeros:,}",
        "density": lambda t: f"{t.nonzeros / max(1, t.rows * t.columns):.1%}",
        "norm": lambda t: number(t.norm),
    }
    some = [term for term in diagnosis.terms if term.nonzeros]
    return Table.of(some, columns, (2, 3, 4, 5, 6))


def directions_table(diagnosis: Diagnosis) -> Table:
    """The null directions, by name."""
    rows = tuple((d.name, d.kind, number(d.change, 2)) for d in diagnosis.null_directions)
    return Table(("null direction", "kind", "change of the whitened residual"), rows, (2,))


def gathered_directions_table(directions: Sequence[Direction], per: str = "unit") -> Table:
    """Single entries in one row, other directions one by one; `per` is the unit of a change."""
    entries = [x for x in directions if x.kind == "entry"]
    rows = []
    if entries:
        worst = max(x.change for x in entries)
        names = ", ".join(gathered([x.name for x in entries]))
        how_many = "1 single entry" if len(entries) == 1 else f"{len(entries)} single entries"
        rows.append((f"{how_many}: {names}", "entry", f"≤ {number(worst, 2)}"))
    rows += [(x.name, x.kind, number(x.change, 2)) for x in directions if x.kind != "entry"]
    return Table(("direction", "kind", f"|J d|, sigmas per {per}"), tuple(rows), (2,))


DESIGN_FILES = {
    "index.html": "this page",
    "design.txt": "the design as text",
    "design.json": "the design as data, for programs",
    SUMMARY: "the title and the choice, for programs",
}


def write_design(
    design: MeasurementDesign,
    folder: str | Path,
    *,
    title: str,
    question: str = "",
    source: str | None = None,
) -> Path:
    """Write the folder of a design, and return its page.

    The folder appears whole or not at all; raises BadFile if it cannot be written.
    """
    rows = min(len(design.ranking), MOST_RANKED)
    ranking = plotted(
        7.4,
        1.2 + 0.21 * rows,
        plots.plot_measurement_ranking,
        plots.caption_measurement_ranking,
        design,
    )
    text = design.report()
    contents = {
        "index.html": page(
            "design.html",
            title=title,
            question=question,
            d=design,
            outcome=outcome(design),
            ranking=ranking,
            report=design.report(),
            files=DESIGN_FILES,
        ),
        "design.txt": text + "\n",
        "design.json": json.dumps(design.data(), indent=1, allow_nan=False),
    }
    return write_folder(folder, source, contents, {"title": title, "chosen": list(design.chosen)})


def outcome(design: MeasurementDesign) -> str:
    """What the choice changes, in a sentence."""
    unit = "" if design.unit == "1" else f" {design.unit}"
    if design.after.open:
        return (
            f"{design.after.open} of the numbers that matter stay undetermined; "
            f"{design.before.open} were before."
        )
    if design.before.open:
        return f"what was undetermined has a standard deviation of {design.after.sd:.3g}{unit}."
    before, after = design.before.sd, design.after.sd
    return f"from {before:.3g} to {after:.3g}{unit}, {design.gain:.3g} times smaller."
