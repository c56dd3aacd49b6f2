"""The whole report of a diagnosis in words, section by section."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from workbench.diagnostics.conditioning import PARALLEL
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.findings import gap, gauges_in_words, held, listed, names_of, unread
from workbench.diagnostics.identifiability import UNCHANGED, EntryIdentifiability
from workbench.diagnostics.structure import pose_moves_template
from workbench.diagnostics.words import counted, gathered, named_groups, named_rows, sections, table
from workbench.errors import joined

MOST = 12  # lines of one list


def report(d: Diagnosis) -> str:
    """Findings, all numbers, and suggestions, section by section."""
    parts: list[tuple[str, Iterable[str]]] = [
        ("findings", listed(d.findings)),
        ("size and structure", _structure(d)),
    ]
    if d.here.finite:
        parts += [
            ("rank", _rank(d)),
            ("null directions", _unseen(d)),
            ("weak directions", _weak(d)),
            ("conditioning", _conditioning(d)),
            ("standard deviations and where the information comes from", _known(d)),
            ("what each residual contributes", _contributions(d)),
            ("derivatives", _derivatives(d)),
        ]
    parts.append(("suggestions (each was tried out)", _advice(d)))
    return sections(parts)


def _structure(d: Diagnosis) -> Iterator[str]:
    m, n = d.shape
    s = d.structure
    nonzeros = f"{d.nonzeros} of {m * n} entries can be nonzero ({d.density:.1%})"
    yield f"{m} rows x {n} unknowns; {nonzeros}"
    if d.here.finite and d.nonzeros:
        others = _small_entries(d)
        yield f"{d.thick} of them are above a thousandth of their column's largest entry{others}"
    yield from table(
        ("residual", "block", "rows", "columns", "nonzeros", "density", "norm"),
        [
            (
                t.residual,
                t.block,
                str(t.rows),
                str(t.columns),
                str(t.nonzeros),
                f"{t.nonzeros / max(1, t.rows * t.columns):.0%}",
                f"{t.norm:.3g}",
            )
            for t in d.terms
            if t.nonzeros
        ],
    )
    yield f"structural rank {s.rank} of {n}, the largest that the sparsity pattern allows"
    if s.unread.size:
        yield unread(d)
    yield (
        "Dulmage-Mendelsohn decomposition: "
        f"over-determined {s.over.rows.size} x {s.over.columns.size}, "
        f"square {s.square.rows.size} x {s.square.columns.size}, "
        f"under-determined {s.under.rows.size} x {s.under.columns.size} (rows x unknowns)"
    )
    if s.under.columns.size:
        yield (
            f"the under-determined unknowns are {named_groups(d.free, s.under.columns)}, in "
            f"{named_rows(d.point.rows, s.under.rows) or 'no row'}"
        )


def _rank(d: Diagnosis) -> Iterator[str]:
    n = d.shape[1]
    yield f"numerical rank {d.rank} of {n}{gap(d)}; tolerance {d.tolerance:.1e}"
    if d.point.active.any:
        yield held(d)
    if d.here.estimated:
        yield (
            "the Jacobian is large and sparse: the rank was found by a factorization, without "
            "singular values; leverage, nearby points and contributions are left out"
        )
    if d.structural_rank > d.rank:
        yield (
            f"the sparsity pattern allows {d.structural_rank}: {d.structural_rank - d.rank} of the "
            "null directions are due to the numbers, not to the pattern"
        )
    yield f"with columns of length 1: rank {d.scaled_rank}"
    if d.nearby.ranks:
        yield (
            f"at {len(d.nearby.ranks)} points drawn nearby (a tenth of a yardstick away, see "
            "STANDARD DEVIATIONS): rank "
            f"{', '.join(map(str, d.nearby.ranks))}; the smallest nonzero singular value is "
            f"{d.nearby.weaker_here:.2g} times as large there"
        )
    if d.rank_law:
        yield f"the kinematic tree predicts the rank {d.rank_law[0]}: {d.rank_law[1]}"
    if d.rank == n:
        yield f"condition {d.condition:.3g}"


def _unseen(d: Diagnosis) -> Iterator[str]:
    if d.rank == d.shape[1]:
        return
    worst = max(x.change for x in d.null_directions)
    yield (
        f"{counted(len(d.null_directions), 'direction')}; one unit along any of them changes the "
        f"residuals by at most {worst:.1e} sigma"
    )
    if text := gauges_in_words(d.null_directions):
        yield text
    yield from names_of(d.null_directions)
    if d.weak_directions and any(x.kind in ("joint", "mixed") for x in d.null_directions):
        yield "(directions of many entries combine weak directions, which are listed below)"


def _weak(d: Diagnosis) -> Iterator[str]:
    if not d.weak_directions:
        return
    shown = d.weak_directions[:MOST]
    yield "a whole yardstick along each of these changes the residuals by less than one sigma"
    yield f"(a yardstick is, {d.point.yardsticks})"
    yield from table(("direction", "|J d|"), [(x.name, f"{x.change:.2g}") for x in shown])
    if d.weak_count > len(shown):
        yield f"and {d.weak_count - len(shown)} more"


def _conditioning(d: Diagnosis) -> Iterator[str]:
    if not d.free.size:
        yield "nothing is free"
        return
    norms = d.here.column_norms
    longest, shortest = int(np.argmax(norms)), int(np.argmin(norms))
    yield (
        f"longest column {d.free.label(longest)}: {norms[longest]:.3g}; shortest "
        f"{d.free.label(shortest)}: {norms[shortest]:.3g} (sigmas per unit)"
    )
    for pair in d.parallel_columns[:MOST]:
        how = "parallel" if pair.sine <= PARALLEL else f"nearly parallel (sine {pair.sine:.1e})"
        yield f"{d.free.label(pair.first)} and {d.free.label(pair.second)}: {how} columns"
    for weak in d.weakest[:1]:
        columns = ", ".join(gathered([d.free.label(i) for i in weak.columns[:MOST]]))
        rows = ", ".join(d.problem.row_label(i) for i in weak.rows[:6])
        yield (
            f"smallest nonzero singular value ({weak.change:.2g} sigma per yardstick): along "
            f"{columns}; it changes {rows}{' and others' if len(weak.rows) > 6 else ''}"
        )
    if d.leverage is not None:
        top = np.argsort(-d.leverage)[:3]
        named = ", ".join(f"{d.problem.row_label(int(i))} ({d.leverage[i]:.2f})" for i in top)
        yield f"rows with the largest leverage (at most 1): {named}"
    if d.parallel_rows:
        pair = d.parallel_rows[0]
        yield (
            f"{counted(len(d.parallel_rows), 'pair')} of parallel rows, such as "
            f"{d.problem.row_label(pair.first)} and {d.problem.row_label(pair.second)}"
        )


# How well entries are identified, from well to not at all: heads of tables.
VERDICTS = ("identified", "practically not", "numerically not", "structurally not")


def _known(d: Diagnosis) -> Iterator[str]:
    known = d.identifiability
    rows = []
    for block in d.free.blocks:
        at = d.free.slices[block.name]
        finite = known.sigma[at][np.isfinite(known.sigma[at])]
        spread = f"{finite.min():.2g} .. {finite.max():.2g}" if finite.size else "-"
        counts = [str(known.verdicts[at].count(v)) for v in reversed(EntryIdentifiability)]
        rows.append((block.name, block.unit, spread, *counts))
    header = ("block", "unit", "sigma", *VERDICTS)
    yield from table(header, rows)
    yield (
        f"identified: sigma is below {UNCHANGED} of the prior's or, without a prior, below a "
        "yardstick; practically not: the residuals depend on it, but sigma is not below that; "
        "numerically not: it has a part in a null direction; structurally not: the sparsity "
        "pattern alone leaves it open"
    )
    yield f"a yardstick is, {d.point.yardsticks}"
    if d.priors:
        yield (
            f"the data determine {known.effective:.1f} of {d.shape[1]} directions (effective "
            f"degrees of freedom); they say more than {', '.join(d.priors)} about "
            f"{known.better_from_data} directions"
        )
    for a, b, c in known.correlations[:3]:
        yield f"correlation {c:+.3f}: {d.free.label(a)} and {d.free.label(b)}"


def _contributions(d: Diagnosis) -> Iterator[str]:
    if not d.contributions:
        return
    names, unknown = compared_blocks(d)
    rows = [
        (
            c.residual,
            str(c.rank_without),
            str(c.rank_with),
            *(
                changed(c.sigma_without[n], c.sigma_with[n], lambda sigma: f"{sigma:.2g}")
                for n in names
            ),
        )
        for c in d.contributions
    ]
    header = ("residual", "rank without", "with", *(f"sigma {n}" for n in names))
    yield from table(header, rows)
    if unknown:
        yield f"with or without any one of them the sigmas of {joined(unknown)} are unknown"


def compared_blocks(d: Diagnosis) -> tuple[list[str], list[str]]:
    """The blocks whose sigmas are known with or without some residual, and the others."""
    known = {
        name
        for c in d.contributions
        for name in d.free.names
        if np.isfinite([c.sigma_without[name], c.sigma_with[name]]).any()
    }
    names = d.free.names
    return [n for n in names if n in known], [n for n in names if n not in known]


def changed(without: float, with_it: float, number: Callable[[float], str]) -> str:
    """`0.3 -> 0.1`: a sigma without a residual and with it; infinite is called unknown."""
    if np.isinf(without) and np.isinf(with_it):
        return "unknown"
    first = "unknown" if np.isinf(without) else number(without)
    return f"{first} -> {'unknown' if np.isinf(with_it) else number(with_it)}"


def _small_entries(d: Diagnosis) -> str:
    """What the small entries are, where that is known: pose blend shapes far from a joint."""
    if d.thick == d.nonzeros:
        return ""
    if pose_moves_template(d.problem):
        return "; the others are small, such as what pose blend shapes do far from a joint"
    return "; the others are small"


def _derivatives(d: Diagnosis) -> Iterator[str]:
    check = d.derivatives
    of = "" if len(check.columns) == d.shape[1] else f" ({len(check.columns)} columns, at random)"
    yield (
        f"compared with finite differences{of}: {check.wrong} entries wrong, largest error "
        f"{check.largest_error:.1e} of the column's largest entry"
    )
    if check.slope is not None:
        yield f"the error of the linear model falls like h^{check.slope:.2f} (2 is right)"
    if check.hessian_error is not None:
        yield f"exact Hessian compared with finite differences: {check.hessian_error:.1e}"
    if check.neglected is not None:
        yield (
            f"the Gauss-Newton Hessian J'J leaves out {check.neglected:.1%} of the exact Hessian"
        )


def _advice(d: Diagnosis) -> Iterator[str]:
    for s in d.suggestions:
        yield f"{s.what}: {s.before} -> {s.after}"
        yield f"  reason: {s.why}; cost: {s.cost}"
