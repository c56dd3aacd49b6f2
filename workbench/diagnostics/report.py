"""A diagnosis in words: its findings, a summary, and the whole report section by section."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from workbench.diagnostics.conditioning import PARALLEL
from workbench.diagnostics.gauges import is_gauge
from workbench.diagnostics.identifiability import EntryIdentifiability
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.scales import METRES
from workbench.diagnostics.words import counted, gathered, named_groups, sections, table
from workbench.errors import joined, some_of

if TYPE_CHECKING:
    from workbench.diagnostics.diagnosis import Diagnosis

MOST_LINES = 12  # of one list
ILL_CONDITIONED = 1e8  # condition of J from which half of the digits are gone
NEARBY = 1e-3  # characteristic scales: how far from a point that is not finite to look again
ROUNDED = 1e-12  # characteristic scales: a smaller value is a zero with rounding errors
FAR_FROM_SCALE = 1e3  # times a characteristic scale, or less by that: it may not be what matters
GAUGES = {  # nouns, one and several, by the kinds of directions that are gauges
    "translation": ("translation", "translations"),
    "rotation": ("rotation", "rotations"),
    "scale": ("change of scale", "changes of scale"),
    "offset": ("common offset", "common offsets"),
    "mixing": ("mixing of factors", "mixings of factors"),
    "projective": ("projective map", "projective maps"),
    "trade-off": ("trade-off", "trade-offs"),
    "gauge": ("other gauge", "other gauges"),
}
# How well entries are identified, from well to not at all: heads of tables.
VERDICTS = ("identified", "practically not", "numerically not", "structurally not")


# Findings.


@dataclass(frozen=True)
class Finding:
    """One sentence about a problem.

    Attributes:
        part: the section of the report that says more.
        text: the sentence.
        warning: whether it is a warning, or else a note.
    """

    part: str
    text: str
    warning: bool = True


def findings(d: "Diagnosis") -> tuple[Finding, ...]:
    """All findings, warnings first."""
    if not d.here.finite:
        return tuple(_values(d))
    parts = (_structure, _rank, _conditioning, _priors, _derivatives)
    every = [finding for part in parts for finding in part(d)]
    return tuple(sorted(every, key=lambda finding: not finding.warning))


def listed(findings: Sequence[Finding]) -> list[str]:
    """Each finding as a line of a report."""
    lines = [f"{'warning' if finding.warning else 'note'}: {finding.text}" for finding in findings]
    return lines or ["no warnings"]


def _values(d: "Diagnosis") -> Iterator[Finding]:
    label, free = d.problem.row_label, d.free
    for what, where in (
        ("the residual", [label(i) for i, j in d.not_finite if j < 0]),
        ("the Jacobian", [f"{label(i)} by {free.label(j)}" for i, j in d.not_finite if j >= 0]),
    ):
        if where:
            yield Finding("values", f"{what} is not finite: {some_of(where)}")
    rng, step = np.random.default_rng(0), NEARBY * d.scales.sizes
    x, fixed = d.problem.split(d.values)
    moved = d.problem.values(x + step * rng.standard_normal(x.shape), fixed)
    if d.problem.linearize(d.values | moved).finite:
        text = (
            "a thousandth of a characteristic scale away it is finite: start there, or write the "
            "formula as a series around this point"
        )
        yield Finding("values", text, False)


def _structure(d: "Diagnosis") -> Iterator[Finding]:
    if d.structure.unread.size:
        yield Finding("structure", unread(d))
    under = np.setdiff1d(d.structure.under.columns, d.structure.unread)
    if under.size:
        text = (
            f"{counted(len(d.structure.under.rows), 'row')} cannot determine {under.size} "
            f"unknowns: {named_groups(d.free, under)}"
        )
        yield Finding("structure", text)
    idle = set(d.structure.idle.tolist())
    for name, rows in d.problem.rows.items():
        if rows.stop > rows.start and idle.issuperset(range(rows.start, rows.stop)):
            text = f"the residual {name} depends on no free block, so it is constant"
            yield Finding("structure", text)
    for first, second in d.duplicates:
        text = f"{second} repeats {first} row by row, so that these rows count twice"
        yield Finding("structure", text)


def _rank(d: "Diagnosis") -> Iterator[Finding]:
    n = d.shape[1]
    if d.rank < n:
        text = f"{n - d.rank} of {n} directions change no residual"
        text += f", and no active {_active_kind(d)} forbids them" if d.active.any else ""
        yield Finding("rank", text)
        if text := gauges_in_words(d.null_directions):
            yield Finding("rank", text, False)
        for gauge in d.gauges:
            if not is_gauge(gauge, d.problem, d.values, d.constrained.null):
                text = f"{gauge.name} is declared to be a gauge, but no other unknowns undo it here"
                yield Finding("rank", text)
    if d.active.any:
        yield Finding("rank", held(d), False)
    if d.ranks_nearby and max(d.ranks_nearby) > d.rank:
        text = (
            f"the rank is {d.rank} at this point, but {max(d.ranks_nearby)} a tenth of a "
            "characteristic scale away"
        )
        yield Finding("rank", text)
    if d.weak_count:
        text = (
            f"{counted(d.weak_count, 'weak direction')}: a whole characteristic scale "
            f"({d.scales}) changes the residuals by less than one sigma"
        )
        yield Finding("rank", text, False)
    yield from _scales(d)


def _scales(d: "Diagnosis") -> Iterator[Finding]:
    """Zeros say nothing, nor does what is small in a unit with a zero of its own, as an angle."""
    x, far = d.problem.split(d.values)[0], []
    for block in d.free.blocks:
        part = d.free.slices[block.name]
        size = float((abs(x[part]) / d.scales.sizes[part]).max(initial=0.0))
        small = ROUNDED < size <= 1 / FAR_FROM_SCALE and block.unit in METRES
        if (size >= FAR_FROM_SCALE or small) and block.name not in d.given_scales:
            far.append(block.name)
    if far:
        text = (
            f"values of {joined(far)} and their characteristic scales differ by a factor of "
            f"{FAR_FROM_SCALE:g} or more: `scales` says how large a change of them matters"
        )
        yield Finding("identifiability", text, False)


def gauges_in_words(directions: Sequence[Direction]) -> str:
    """`no residual changes under 3 translations: 3 of 6 null directions are gauges`, or empty."""
    counts = {kind: sum(x.kind == kind for x in directions) for kind in GAUGES}
    parts = [f"{count} {GAUGES[kind][count > 1]}" for kind, count in counts.items() if count]
    if not parts:
        return ""
    count = sum(counts.values())
    null, are = counted(len(directions), "null direction"), "is a" if count == 1 else "are"
    gauges = "gauge" if count == 1 else "gauges"
    return f"no residual changes under {joined(parts)}: {count} of {null} {are} {gauges}"


def unread(d: "Diagnosis") -> str:
    """The unknowns that no residual depends on, in a sentence."""
    nothing = f"residual and no active {_active_kind(d)}" if d.active.any else "residual"
    return f"no {nothing} depends on {named_groups(d.free, d.structure.unread)}"


def _active_kind(d: "Diagnosis") -> str:
    """`bound`, `constraint`, or `bound or constraint`."""
    return " or ".join(word.removesuffix("s") for word in d.active.what.split(" and "))


def held(d: "Diagnosis") -> str:
    """What bounds and constraints add to the rank, in a sentence."""
    names, count, what = d.active.names, d.constrained.count, d.active.what
    return (
        f"active {what} ({some_of(names)}) fix {counted(count, 'direction')}, which "
        f"{'counts' if count == 1 else 'count'} towards the rank"
    )


def _conditioning(d: "Diagnosis") -> Iterator[Finding]:
    if ILL_CONDITIONED < d.condition < np.inf:
        text = f"the condition number is {d.condition:.1e}: at least half of the digits are lost"
        yield Finding("conditioning", text)
    same = [p for p in d.parallel_columns if p.sine <= PARALLEL]
    if same:
        pairs = ", ".join(f"{d.free.label(p.first)} and {d.free.label(p.second)}" for p in same[:3])
        text = f"{counted(len(same), 'pair')} of unknowns with parallel columns: {pairs}"
        yield Finding("conditioning", text)


def _priors(d: "Diagnosis") -> Iterator[Finding]:
    if not d.priors:
        return
    known = d.identifiability
    others = ", the priors the rest" if known.effective < d.shape[1] - 0.05 else ""
    text = (
        f"the data determine {known.effective:.1f} of {d.shape[1]} directions (effective degrees "
        f"of freedom){others}; they say more than {joined(d.priors)} about "
        f"{counted(known.better_from_data, 'direction')}"
    )
    yield Finding("identifiability", text, False)


def _derivatives(d: "Diagnosis") -> Iterator[Finding]:
    check = d.derivatives
    if check.wrong:
        worst = check.suspects[0]
        text = (
            f"{check.wrong} of the Jacobian's entries disagree with finite differences; the worst "
            f"is {d.problem.row_label(worst.row)} by {d.free.label(worst.column)}: "
            f"{worst.given:.6g}, by differences {worst.differences:.6g}"
        )
        yield Finding("derivatives", text)
    yield from (Finding("derivatives", fault) for fault in check.faults)


# A few lines.


def summary(d: "Diagnosis") -> Iterator[str]:
    """Lines of size, rank, and the names of the null directions."""
    m, n = d.shape
    yield f"Jacobian {m} x {n}, {d.nonzeros} nonzeros ({d.density:.1%})"
    structural = f"structural rank {d.structural_rank} of {n}"
    yield f"{structural}, the largest that the sparsity pattern allows"
    if not d.here.finite:
        yield from (finding.text for finding in d.findings)
        return
    yield f"numerical rank {d.rank} of {n}{gap(d)}"
    if d.active.any:
        yield held(d)
    if d.rank == n:
        yield f"full rank, condition {d.condition:.3g}"
    else:
        if text := gauges_in_words(d.null_directions):
            yield text
        null = counted(len(d.null_directions), "null direction")
        yield f"{null} (no residual changes along them):"
        yield from (f"  {line}" for line in names_of(d.null_directions))
    if d.weak_count:
        yield (
            f"{counted(d.weak_count, 'weak direction')} (a whole characteristic scale changes the "
            f"residuals by less than one sigma; the scales are, {d.scales})"
        )


def names_of(directions: Sequence[Direction]) -> list[str]:
    """The names of null directions, with all single entries in one line."""
    entries = [x.name for x in directions if x.kind == "entry"]
    others = [x.name for x in directions if x.kind != "entry"]
    noun = "single entry" if len(entries) == 1 else "single entries"
    first = [f"{len(entries)} {noun}: {', '.join(gathered(entries))}"]
    return (first if entries else []) + others


def gap(d: "Diagnosis") -> str:
    """Between which singular values the tolerance lies; empty for a rank of zero or full rank.

    Empty, too, where the rank was found by elimination, without singular values.
    """
    if d.sparse is not None:
        return ""
    s, rank = d.singular_values, d.reduced_rank
    if not 0 < rank < s.size:
        return ""
    return f" (singular value {rank} is {s[rank - 1]:.2g}, the next {s[rank]:.2g})"


# The whole report.


def report(d: "Diagnosis") -> str:
    """Findings, all numbers, and suggestions, section by section."""
    parts: list[tuple[str, Iterable[str]]] = [
        ("findings", listed(d.findings)),
        ("size and structure", _size(d)),
    ]
    if d.here.finite:
        parts += [
            ("rank", _ranks(d)),
            ("null directions", _null(d)),
            ("weak directions", _weak(d)),
            ("conditioning", _columns_and_rows(d)),
            ("standard deviations and where the information comes from", _known(d)),
            ("what each residual contributes", _contributions(d)),
            ("derivatives", _checked(d)),
        ]
    parts.append(("suggestions (each was tried out)", _advice(d)))
    return sections(parts)


def _size(d: "Diagnosis") -> Iterator[str]:
    m, n = d.shape
    s = d.structure
    nonzeros = f"{d.nonzeros} of {m * n} entries can be nonzero ({d.density:.1%})"
    yield f"{m} rows x {n} unknowns; {nonzeros}"
    yield from table(
        ("residual", "block", "rows", "columns", "nonzeros", "density", "norm"),
        [
            (t.residual, t.block, *map(str, (t.rows, t.columns, t.nonzeros)), share, norm)
            for t in d.terms
            if t.nonzeros
            for share, norm in [(f"{t.nonzeros / (t.rows * t.columns):.0%}", f"{t.norm:.3g}")]
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


def _ranks(d: "Diagnosis") -> Iterator[str]:
    n = d.shape[1]
    yield f"numerical rank {d.rank} of {n}{gap(d)}; tolerance {d.tolerance:.1e}"
    if d.active.any:
        yield held(d)
    if d.here.estimated:
        yield (
            "the Jacobian is large and sparse: the rank was found by a factorization, without "
            "singular values; nearby points and contributions are left out"
        )
    if d.ranks_nearby:
        yield (
            f"at {len(d.ranks_nearby)} points drawn nearby, a tenth of a characteristic scale away:"
            f" rank {', '.join(map(str, d.ranks_nearby))}"
        )
    if d.rank_law:
        yield f"the kinematic tree predicts the rank {d.rank_law[0]}: {d.rank_law[1]}"
    if d.rank == n:
        yield f"condition {d.condition:.3g}"


def _null(d: "Diagnosis") -> Iterator[str]:
    if d.rank == d.shape[1]:
        return
    worst, count = max(x.change for x in d.null_directions), len(d.null_directions)
    which = "it" if count == 1 else "any of them"
    yield (
        f"{counted(count, 'direction')}; one unit along {which} changes the residuals by at most "
        f"{worst:.1e} sigma"
    )
    if text := gauges_in_words(d.null_directions):
        yield text
    yield from names_of(d.null_directions)


def _weak(d: "Diagnosis") -> Iterator[str]:
    if shown := d.weak_directions[:MOST_LINES]:
        yield "a whole characteristic scale along each changes the residuals by less than one sigma"
        numbered = [(f"{x.change:.2g}", x.name) for x in shown]
        yield from table(("|J d|", "direction"), numbered, numbers=(0,))
    if shown and d.weak_count > len(shown):
        yield f"and {d.weak_count - len(shown)} more"


def _columns_and_rows(d: "Diagnosis") -> Iterator[str]:
    if not d.free.size:
        yield "nothing is free"
        return
    norms = d.here.column_norms
    longest, shortest = int(np.argmax(norms)), int(np.argmin(norms))
    yield (
        f"longest column {d.free.label(longest)}: {norms[longest]:.3g}; shortest "
        f"{d.free.label(shortest)}: {norms[shortest]:.3g} (sigmas per unit)"
    )
    for pair in d.parallel_columns[:MOST_LINES]:
        how = "parallel" if pair.sine <= PARALLEL else f"nearly parallel (sine {pair.sine:.1e})"
        yield f"{d.free.label(pair.first)} and {d.free.label(pair.second)}: {how} columns"
    for weak in d.weakest[:1]:
        rows = [d.problem.row_label(i) for i in weak.rows]
        yield (
            f"smallest nonzero singular value ({weak.change:.2g} sigma per characteristic scale): "
            f"along {_columns(d, weak.columns)}; it changes {some_of(rows)}"
        )


def _columns(d: "Diagnosis", columns: Sequence[int]) -> str:
    return some_of(gathered(d.free.labels_of(columns)))


def _known(d: "Diagnosis") -> Iterator[str]:
    known = d.identifiability
    rows = []
    for block in d.free.blocks:
        part = d.free.slices[block.name]
        sigma = known.sigma[part]
        finite = sigma[np.isfinite(sigma)]
        spread = f"{finite.min():.2g} .. {finite.max():.2g}" if finite.size else "-"
        counts = [known.verdicts[part].count(v) for v in reversed(EntryIdentifiability)]
        rows.append((block.name, block.unit, spread, *map(str, counts)))
    used = [verdict in known.verdicts for verdict in reversed(EntryIdentifiability)]
    kept = [0, 1, 2, *(3 + k for k, is_used in enumerate(used) if is_used)]  # 80 letters are few
    head = ("block", "unit", "sigma", *VERDICTS)
    yield from table([head[k] for k in kept], [[row[k] for k in kept] for row in rows])
    means = zip(VERDICTS, reversed(EntryIdentifiability), used, strict=True)
    yield "; ".join(f"{head}: {verdict.value}" for head, verdict, is_used in means if is_used)
    if not d.weak_count:
        yield f"the characteristic scales are, {d.scales}"
    for a, b, c in known.correlations[:3]:
        yield f"correlation {c:+.3f}: {d.free.label(a)} and {d.free.label(b)}"


def _contributions(d: "Diagnosis") -> Iterator[str]:
    if not d.contributions:
        return
    names, unknown = compared_blocks(d)
    whole = d.contributions[0]

    def row(name: str, rank: int, sigma: Mapping[str, float]) -> tuple[str, ...]:
        known = (f"{sigma[n]:.2g}" if np.isfinite(sigma[n]) else "unknown" for n in names)
        return name, str(rank), *known

    rows = [row("nothing", whole.rank_with, whole.sigma_with)]
    rows += [row(c.residual, c.rank_without, c.sigma_without) for c in d.contributions]
    yield from table(("left out", "rank", *(f"sigma {n}" for n in names)), rows)
    if unknown:
        yield f"with or without any one of them the sigmas of {joined(unknown)} are unknown"


def compared_blocks(d: "Diagnosis") -> tuple[list[str], list[str]]:
    """The blocks whose sigmas are known with or without some residual, and the others."""
    known = {
        name
        for c in d.contributions
        for name in d.free.names
        if np.isfinite([c.sigma_without[name], c.sigma_with[name]]).any()
    }
    names = d.free.names
    return [n for n in names if n in known], [n for n in names if n not in known]


def _checked(d: "Diagnosis") -> Iterator[str]:
    check = d.derivatives
    all_columns = len(check.columns) == d.shape[1]
    which = "" if all_columns else f" ({len(check.columns)} columns, at random)"
    yield (
        f"compared with finite differences{which}: {check.wrong} entries wrong, largest "
        f"error {check.largest_error:.1e} of the column's largest entry"
    )
    if check.slope is not None:
        yield f"the error of the linear model falls like h^{check.slope:.2f} (2 is right)"
    if check.neglected is not None:
        yield (
            f"the Gauss-Newton Hessian J'J leaves out {check.neglected:.1%} of the exact Hessian"
        )


def _advice(d: "Diagnosis") -> Iterator[str]:
    for s in d.suggestions:
        yield f"{s.what}: {s.before} -> {s.after}"
        yield f"  reason: {s.why}; cost: {s.cost}"
