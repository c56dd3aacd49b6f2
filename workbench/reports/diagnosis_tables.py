"""The tables of a diagnosis, as rows of text."""

from collections.abc import Sequence

import numpy as np

from workbench.diagnostics import Diagnosis, Direction, EntryIdentifiability
from workbench.diagnostics.conditioning import PARALLEL
from workbench.diagnostics.report import VERDICTS, changed, compared_blocks
from workbench.diagnostics.structure import Submatrix, TermBlock
from workbench.diagnostics.words import gathered, named_groups, named_rows
from workbench.reports.page import Columns, Table, number

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
        "which rows": lambda of: named_rows(d.point.rows, of[1].rows) or "–",
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
        ("with columns of length 1", str(d.scaled_rank), "the same whatever the units are"),
    ]
    if d.nearby.ranks:
        near = ", ".join(map(str, d.nearby.ranks))
        rows.append(("nearby", near, "at random points a tenth of a characteristic scale away"))
    if d.rank_law:
        rows.append(("rank law of observed joints", str(d.rank_law[0]), d.rank_law[1]))
    rows.append(("unknowns", str(n), "the rank needed to determine all of them"))
    return Table(("which", "rank", "what it says"), tuple(rows), (1,))


def conditioning_table(d: Diagnosis) -> Table:
    """Column lengths, near-parallel pairs, the weakest direction, leverage."""
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
                number(weak.change, 2),
                f"{columns}; it changes {seen_by}{more}",
            )
        )
    if d.leverage is not None:
        for i in np.argsort(-d.leverage)[:3]:
            row = d.problem.row_label(int(i))
            rows.append(("leverage", number(float(d.leverage[i]), 2), f"{row}, of at most 1"))
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
    known, sizes = d.identifiability, d.point.scales.sizes
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
    rows = tuple(
        (
            c.residual,
            str(c.rank_without),
            str(c.rank_with),
            number(float(c.singular_values_without.min(initial=np.inf)), 2),
            number(float(c.singular_values_with.min(initial=np.inf)), 2),
            *(
                changed(c.sigma_without[n], c.sigma_with[n], lambda sigma: number(sigma, 2))
                for n in names
            ),
        )
        for c in d.contributions
    )
    head = (
        "residual",
        "rank without",
        "with",
        "least singular value without",
        "with",
        *(f"sigma of {n}" for n in names),
    )
    return Table(head, rows, tuple(range(1, len(head))))


def derivatives_table(d: Diagnosis) -> Table:
    """What was checked and how far off it is."""
    check = d.derivatives
    rows = [
        ("entries not confirmed by differences", str(check.wrong), f"{len(check.columns)} columns"),
        ("largest error", number(check.largest_error, 2), "of the column's largest entry"),
        ("gradient against J'r", number(check.gradient_error, 2), "relative"),
    ]
    if check.hessian_error is not None:
        rows.append(("exact Hessian", number(check.hessian_error, 2), "against differences"))
    if check.neglected is not None:
        share = f"{check.neglected:.1%}"
        rows.append(("left out by J'J", share, "of the exact Hessian, as in Gauss-Newton"))
    for s in check.suspects:
        where = f"{d.problem.row_label(s.row)} by {d.free.label(s.column)}"
        said = f"given {number(s.given, 6)}, differences {number(s.differences, 6)}"
        rows.append(("suspect", said, where))
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
