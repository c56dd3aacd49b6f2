"""The whole report of a diagnosis in words, section by section."""

from collections.abc import Callable, Sequence

import numpy as np

from workbench.diagnostics.conditioning import PARALLEL
from workbench.diagnostics.findings import Finding, held, unread
from workbench.diagnostics.identifiability import UNCHANGED, Verdict
from workbench.diagnostics.known import Known
from workbench.diagnostics.structure import bulges, counted, gathered, named_groups, named_rows
from workbench.diagnostics.suggestion import Suggestion
from workbench.diagnostics.summary import gap, unseen
from workbench.diagnostics.tables import table

MOST = 12  # lines of one list


def report(d: Known, findings: Sequence[Finding], suggestions: Sequence[Suggestion]) -> str:
    """Everything that is known, what deserves a sentence of it, and what to do."""
    sections = [("findings", _findings(findings)), ("size and structure", _structure(d))]
    if d.here.finite:
        sections += [
            ("rank", _rank(d)),
            ("not seen", _unseen(d)),
            ("hardly seen", _weak(d)),
            ("conditioning", _conditioning(d)),
            ("what is known of each unknown", _known(d)),
            ("what each residual adds", _contributions(d)),
            ("derivatives", _derivatives(d)),
        ]
    sections.append(("what to do (each was carried out)", _advice(suggestions)))
    return "\n\n".join(
        "\n".join([title.upper(), *(f"  {line}" for line in lines)])
        for title, lines in sections
        if lines
    )


def _findings(findings: Sequence[Finding]) -> list[str]:
    if not findings:
        return ["no warnings"]
    return [f"{'warning' if f.warning else 'note'}: {f.text}" for f in findings]


def _structure(d: Known) -> list[str]:
    m, n = d.shape
    s = d.structure
    lines = [
        f"{m} rows x {n} unknowns, {d.nonzeros} of {m * n} entries may be nonzero ({d.density:.1%})"
    ]
    if d.here.finite and d.nonzeros:
        lines.append(
            f"{d.thick} of them are above a thousandth of their column's largest here{_thin(d)}"
        )
    lines += table(
        ("residual", "block", "rows", "columns", "nonzeros", "density", "norm"),
        [
            (t.term, t.block, str(t.rows), str(t.columns), str(t.nonzeros),
             f"{t.nonzeros / max(1, t.rows * t.columns):.0%}", f"{t.norm:.3g}")
            for t in d.terms
        ],
    )  # fmt: skip
    lines.append(f"structural rank {s.rank} of {n}: the most that numbers in this pattern allow")
    if s.unread.size:
        lines.append(unread(d))
    lines.append(
        f"Dulmage and Mendelsohn: over-determined {s.over.rows.size} x {s.over.columns.size}, "
        f"square {s.square.rows.size} x {s.square.columns.size}, "
        f"under-determined {s.under.rows.size} x {s.under.columns.size} (rows x unknowns)"
    )
    if s.under.columns.size:
        lines.append(
            f"under-determined are {named_groups(d.free, s.under.columns)}, by "
            f"{named_rows(d.point.rows, s.under.rows) or 'no row'}"
        )
    return lines


def _rank(d: Known) -> list[str]:
    n = d.shape[1]
    lines = [f"numerical rank {d.rank} of {n}{gap(d)}; tolerance {d.tolerance:.1e}"]
    if d.point.held.any:
        lines.append(held(d))
    if d.here.estimated:
        lines.append(
            "the Jacobian is large and sparse: singular values are estimates from J'J, good down "
            "to 1e-8 of the largest; leverage, neighbours and contributions are left out"
        )
    if d.structural_rank > d.rank:
        lines.append(
            f"the pattern alone would allow {d.structural_rank}: the other "
            f"{d.structural_rank - d.rank} are lost to the numbers, not to their places"
        )
    lines.append(f"with columns of length 1: rank {d.scaled_rank}")
    if d.nearby.ranks:
        lines.append(
            f"at {len(d.nearby.ranks)} points a tenth of a yardstick away: rank "
            f"{', '.join(map(str, d.nearby.ranks))}; the weakest direction that is seen here is "
            f"{d.nearby.weaker_here:.2g} times as strong there"
        )
    if d.rank_law:
        lines.append(f"the rank law of observed joints says {d.rank_law[0]}: {d.rank_law[1]}")
    if d.rank == n:
        lines.append(f"condition {d.condition:.3g}")
    return lines


def _unseen(d: Known) -> list[str]:
    if d.rank == d.shape[1]:
        return []
    worst = max(x.change for x in d.null_directions)
    lines = [
        f"{counted(len(d.null_directions), 'direction')}; along a whole unit of any of them the "
        f"residuals change by at most {worst:.1e} sigma",
        *unseen(d),
    ]
    if d.weak_directions and any(x.kind in ("joint", "mixed") for x in d.null_directions):
        lines.append(
            "(the longer ones are combinations of what is hardly seen one by one: see below)"
        )
    return lines


def _weak(d: Known) -> list[str]:
    if not d.weak_directions:
        return []
    shown = d.weak_directions[:MOST]
    lines = [
        "directions along which a whole yardstick changes the residuals by less than one sigma",
        f"(a yardstick is {d.point.yardsticks})",
        *table(("direction", "|J d|"), [(x.name, f"{x.change:.2g}") for x in shown]),
    ]
    more = len(d.weak_directions) - len(shown)
    return [*lines, f"and {more} more"] if more else lines


def _conditioning(d: Known) -> list[str]:
    if not d.free.size:
        return ["nothing is free"]
    norms = d.here.column_norms
    longest, shortest = int(np.argmax(norms)), int(np.argmin(norms))
    lines = [
        f"longest column {d.free.label(longest)}: {norms[longest]:.3g}; shortest "
        f"{d.free.label(shortest)}: {norms[shortest]:.3g} (sigmas per unit)"
    ]
    for pair in d.parallel_columns[:MOST]:
        what = "do the same" if pair.apart <= PARALLEL else f"nearly the same ({pair.apart:.1e})"
        lines.append(f"{d.free.label(pair.first)} and {d.free.label(pair.second)}: {what}")
    for weak in d.weakest[:1]:
        columns = ", ".join(gathered([d.free.label(i) for i in weak.columns[:MOST]]))
        rows = ", ".join(d.problem.row_label(i) for i in weak.rows[:6])
        lines.append(
            f"weakest direction that is seen ({weak.change:.2g} sigma per yardstick): {columns}; "
            f"it is seen by {rows}{' and others' if len(weak.rows) > 6 else ''}"
        )
    if d.leverage is not None:
        top = np.argsort(-d.leverage)[:3]
        named = ", ".join(f"{d.problem.row_label(int(i))} ({d.leverage[i]:.2f})" for i in top)
        lines.append(f"rows that decide most by themselves (leverage, at most 1): {named}")
    if d.parallel_rows:
        pair = d.parallel_rows[0]
        lines.append(
            f"{counted(len(d.parallel_rows), 'pair')} of parallel rows, such as "
            f"{d.problem.row_label(pair.first)} and {d.problem.row_label(pair.second)}"
        )
    return lines


def _known(d: Known) -> list[str]:
    known = d.identifiability
    rows = []
    verdicts = np.array([v.name for v in known.verdicts])
    for block in d.free.blocks:
        at = d.free.slices[block.name]
        finite = known.sigma[at][np.isfinite(known.sigma[at])]
        spread = f"{finite.min():.2g} .. {finite.max():.2g}" if finite.size else "-"
        counts = [str(int(np.sum(verdicts[at] == v.name))) for v in reversed(Verdict)]
        rows.append((block.name, block.unit, spread, *counts))
    header = ("block", "unit", "sigma", "identified", "practical", "numerical", "structural")
    lines = table(header, rows)
    lines.append(
        f"identified: sigma is below {UNCHANGED} of the prior's; without a prior, below a "
        f"yardstick ({d.point.yardsticks})"
    )
    if d.priors:
        lines.append(
            f"the data decide {known.effective:.1f} of {d.shape[1]} directions (effective degrees "
            f"of freedom); {known.better_from_data} are better known from the data than from "
            f"{', '.join(d.priors)}"
        )
    for a, b, c in known.correlations[:3]:
        lines.append(f"correlation {c:+.3f}: {d.free.label(a)} and {d.free.label(b)}")
    return lines


def _contributions(d: Known) -> list[str]:
    if not d.contributions:
        return []
    names = d.free.names
    rows = [
        (c.term, str(c.rank_without), str(c.rank_with), *(
            changed(c.sigma_without[n], c.sigma_with[n], lambda sigma: f"{sigma:.2g}")
            for n in names
        ))
        for c in d.contributions
    ]  # fmt: skip
    header = ("residual", "rank without", "with", *(f"sigma {n}" for n in names))
    return table(header, rows)


def changed(without: float, with_it: float, number: Callable[[float], str]) -> str:
    """`0.3 -> 0.1`: a sigma without a residual and with it; infinite is called unknown."""
    if np.isinf(without) and np.isinf(with_it):
        return "unknown"
    first = "unknown" if np.isinf(without) else number(without)
    return f"{first} -> {'unknown' if np.isinf(with_it) else number(with_it)}"


def _thin(d: Known) -> str:
    """What the thin entries are, where that is known: pose blend shapes far from a joint."""
    if d.thick == d.nonzeros:
        return ""
    example = ", such as what pose blend shapes do far from a joint" if bulges(d.problem) else ""
    return f"; the others are thin{example}"


def _derivatives(d: Known) -> list[str]:
    check = d.derivatives
    of = "" if len(check.columns) == d.shape[1] else f" ({len(check.columns)} columns, at random)"
    lines = [f"against differences{of}: {check.wrong} entries wrong, largest error "
             f"{check.largest_error:.1e} of the column's largest entry"]  # fmt: skip
    if check.slope is not None:
        lines.append(f"the linear model errs like h^{check.slope:.2f} (2 is right)")
    if check.hessian_error is not None:
        lines.append(f"exact Hessian against differences: {check.hessian_error:.1e}")
    if check.neglected is not None:
        lines.append(f"Gauss and Newton's J'J leaves out {check.neglected:.1%} of the Hessian")
    return lines


def _advice(suggestions: Sequence[Suggestion]) -> list[str]:
    lines = []
    for s in suggestions:
        lines += [f"{s.what}: {s.before} -> {s.after}", f"  why: {s.why}; it costs: {s.cost}"]
    return lines
