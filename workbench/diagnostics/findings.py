"""What a diagnosis finds: notes, and warnings if a fit's answer is arbitrary or wrong."""

from collections.abc import Iterator, Sequence

import numpy as np

from workbench.blocks.directions import in_units
from workbench.diagnostics.conditioning import PARALLEL
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.gauges import is_gauge
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.wording import Finding
from workbench.diagnostics.words import counted, gathered, named_groups
from workbench.errors import some_of

ILL = 1e8  # condition of J from which half of the digits are gone
UNEVEN = 1e6  # longest over shortest column
FLAT = 0.3  # second best turn of a joint over its best, below which only one turn is seen
MOSTLY = 0.75  # of the joints: if so many are flat, the view is the reason and not one limb
FELT = 0.05  # of the best turn of all joints: joints with weaker turns are not counted
WEAKER = 30.0  # times weaker than nearby: the point is near one where the rank falls
GAUGES = {  # nouns by the kinds of directions that are gauges
    "translation": "translation",
    "rotation": "rotation",
    "scale": "change of scale",
    "offset": "common offset",
    "mixing": "mixing of factors",
    "projective": "projective map",
    "trade-off": "trade-off",
    "gauge": "other gauge",
}
ALONE = 0.999  # leverage from which on a row determines a direction alone


def findings(d: Diagnosis) -> tuple[Finding, ...]:
    """All findings, warnings first."""
    parts = (_structure, _rank, _conditioning, _priors, _derivatives)
    found = [finding for part in (parts if d.here.finite else (_values,)) for finding in part(d)]
    return tuple(sorted(found, key=lambda finding: not finding.warning))


def _values(d: Diagnosis) -> Iterator[Finding]:
    label, free = d.problem.row_label, d.free
    for what, here in (
        ("the residual", [label(i) for i, j in d.not_finite if j < 0]),
        ("the Jacobian", [f"{label(i)} by {free.label(j)}" for i, j in d.not_finite if j >= 0]),
    ):
        if here:
            yield Finding("values", f"{what} is not finite: {some_of(here)}")


def listed(found: Sequence[Finding]) -> list[str]:
    """Each finding as a line of a report."""
    return [f"{'warning' if f.warning else 'note'}: {f.text}" for f in found] or ["no warnings"]


def _structure(d: Diagnosis) -> Iterator[Finding]:
    if d.structure.unread.size:
        yield Finding("structure", unread(d))
    under = np.setdiff1d(d.structure.under.columns, d.structure.unread)
    if under.size:
        text = (
            f"{counted(len(d.structure.under.rows), 'row')} cannot determine {under.size} "
            f"unknowns: {named_groups(d.free, under)}"
        )
        yield Finding("structure", text)
    for name, rows in d.problem.rows.items():
        idle = np.sum((d.structure.idle >= rows.start) & (d.structure.idle < rows.stop))
        if idle == rows.stop - rows.start > 0:
            text = f"the residual {name} depends on no free block, so it is constant"
            yield Finding("structure", text)
    for first, second in d.duplicates:
        text = f"{second} repeats {first} row by row, so that these rows count twice"
        yield Finding("structure", text)


def _rank(d: Diagnosis) -> Iterator[Finding]:
    n = d.shape[1]
    if d.rank < n:
        text = f"{n - d.rank} of {n} directions change no residual"
        text += f", and no active {_one(d)} forbids them" if d.point.active.any else ""
        yield Finding("rank", text)
        yield from _gauges(d)
    for names in d.exchanges:
        text = (
            f"the rows of {' and '.join(names)} can be exchanged without changing a residual, so "
            "that every solution has equals elsewhere"
        )
        yield Finding("rank", text, False)
    if d.point.active.any:
        yield Finding("rank", held(d), False)
    if d.nearby.ranks and max(d.nearby.ranks) > d.rank:
        there = max(d.nearby.ranks)
        text = f"the rank is {d.rank} at this point, but {there} a tenth of a yardstick away"
        yield Finding("rank", text)
    weaker = d.nearby.weaker_here
    if weaker > WEAKER:
        which = in_units(d.weakest[0].vector * d.point.scales.sizes, d.free, d.here.column_norms)
        text = (
            f"nearly degenerate: the smallest nonzero singular value is {weaker:.0f} times smaller "
            f"here than a tenth of a yardstick away; its direction is {which}"
        )
        yield Finding("rank", text, False)
    yield from _depth(d)
    if d.weak_count:
        text = (
            f"{counted(d.weak_count, 'weak direction')}: a whole yardstick ({d.point.yardsticks}) "
            "changes the residuals by less than one sigma"
        )
        yield Finding("rank", text, False)


def _gauges(d: Diagnosis) -> Iterator[Finding]:
    """What the problem is invariant to, and which declared gauges are none."""
    if text := gauges_in_words(d.null_directions):
        yield Finding("rank", text, False)
    for gauge in d.gauges:
        if not is_gauge(gauge, d.problem, d.values, d.point.constrained.null):
            text = f"{gauge.name} is declared to be a gauge, but no other unknowns undo it here"
            yield Finding("rank", text)


def gauges_in_words(directions: Sequence[Direction]) -> str:
    """`nothing changes under 3 translations and 1 rotation (4 of 6 null directions)`, or empty."""
    count = {noun: sum(x.kind == kind for x in directions) for kind, noun in GAUGES.items()}
    parts = [counted(some, noun) for noun, some in count.items() if some]
    if not parts:
        return ""
    words = " and ".join([", ".join(parts[:-1]), parts[-1]] if parts[1:] else parts)
    return (
        f"no residual changes under {words}: {sum(count.values())} of "
        f"{counted(len(directions), 'null direction')} are gauges"
    )


def unread(d: Diagnosis) -> str:
    """The unknowns that no residual depends on, in a sentence."""
    nothing = f"residual and no active {_one(d)}" if d.point.active.any else "residual"
    return f"no {nothing} depends on {named_groups(d.free, d.structure.unread)}"


def _one(d: Diagnosis) -> str:
    """`bound`, `constraint`, or `bound or constraint`."""
    return " or ".join(word.removesuffix("s") for word in d.point.active.what.split(" and "))


def held(d: Diagnosis) -> str:
    """What bounds and constraints add to the rank, in a sentence."""
    names, count, what = d.point.active.names, d.point.constrained.count, d.point.active.what
    return (
        f"active {what} ({some_of(names)}) fix {counted(count, 'direction')}, which "
        f"{'counts' if count == 1 else 'count'} towards the rank"
    )


def _depth(d: Diagnosis) -> Iterator[Finding]:
    """A body that lies flat across the view of one camera shows one turn of each bone only."""
    felt = FELT * max((turn.best for turn in d.joint_turns), default=0.0)
    seen = [turn for turn in d.joint_turns if turn.best > felt]
    flat = [turn.joint for turn in seen if turn.second < FLAT * turn.best]
    if len(seen) < 3 or len(flat) < MOSTLY * len(seen):
        return
    text = (
        f"nearly degenerate in depth: {len(flat)} of {len(seen)} joints ({', '.join(flat[:3])}, "
        f"...) change the residuals strongly when they turn about one axis, and less than {FLAT:g} "
        "times as strongly about any other, as happens when a body lies flat across the view of a "
        "single camera: bending towards the camera or away from it changes the image little"
    )
    yield Finding("rank", text, False)


def _conditioning(d: Diagnosis) -> Iterator[Finding]:
    if ILL < d.condition < np.inf:
        text = f"the condition number is {d.condition:.1e}: at least half of the digits are lost"
        yield Finding("conditioning", text)
    norms = d.here.column_norms[d.here.column_norms > 0]
    if norms.size and norms.max() > UNEVEN * norms.min():
        text = f"the columns differ in length by a factor of {norms.max() / norms.min():.1e}"
        yield Finding("conditioning", text, False)
    same = [p for p in d.parallel_columns if p.sine <= PARALLEL]
    if same:
        pairs = ", ".join(f"{d.free.label(p.first)} and {d.free.label(p.second)}" for p in same[:3])
        text = f"{counted(len(same), 'pair')} of unknowns with parallel columns: {pairs}"
        yield Finding("conditioning", text)
    if d.leverage is not None:
        data = np.flatnonzero((d.leverage > ALONE) & ~d.point.is_prior).tolist()
        if data:
            named = ", ".join(d.problem.row_label(i) for i in data[:3])
            text = (
                f"{counted(len(data), 'row')} with a leverage of 1: each determines a direction "
                f"alone, so that an outlier there cannot be detected: {named}"
            )
            yield Finding("conditioning", text, False)


def _priors(d: Diagnosis) -> Iterator[Finding]:
    if not d.priors:
        return
    known = d.identifiability
    rest = ", the priors the rest" if known.effective < d.shape[1] - 0.05 else ""
    text = (
        f"the data determine {known.effective:.1f} of {d.shape[1]} directions"
        f"{rest}; the data say more than the priors about {known.better_from_data} directions"
    )
    yield Finding("identifiability", text, False)


def _derivatives(d: Diagnosis) -> Iterator[Finding]:
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


def summary(d: Diagnosis) -> str:
    """Size, rank, and the names of the null directions."""
    return "\n".join(_lines(d))


def _lines(d: Diagnosis) -> Iterator[str]:
    m, n = d.shape
    yield f"Jacobian {m} x {n}, {d.nonzeros} nonzeros ({d.density:.1%})"
    structural = f"structural rank {d.structural_rank} of {n}"
    yield f"{structural}, the largest that the sparsity pattern allows"
    if not d.here.finite:
        yield from (finding.text for finding in d.findings)
        return
    yield f"numerical rank {d.rank} of {n}{gap(d)}"
    if d.point.active.any:
        yield held(d)
    if d.rank == n:
        yield f"full rank, condition {d.condition:.3g}"
    else:
        count = counted(len(d.null_directions), "null direction")
        if text := gauges_in_words(d.null_directions):
            yield text
        yield f"{count} (no residual changes along them):"
        yield from (f"  {line}" for line in names_of(d.null_directions))
    if d.weak_count:
        yield (
            f"{counted(d.weak_count, 'weak direction')} (a whole yardstick changes the residuals "
            f"by less than one sigma; a yardstick is, {d.point.yardsticks})"
        )


def names_of(directions: Sequence[Direction]) -> list[str]:
    """The names of null directions, with all single entries in one line."""
    entries = [x.name for x in directions if x.kind == "entry"]
    others = [x.name for x in directions if x.kind != "entry"]
    noun = "single entry" if len(entries) == 1 else "single entries"
    first = [f"{len(entries)} {noun}: {', '.join(gathered(entries))}"]
    return (first if entries else []) + others


def gap(d: Diagnosis) -> str:
    """Between which singular values the tolerance lies; empty for a rank of zero or full rank.

    Empty, too, where the rank was found by elimination, without singular values.
    """
    if d.by_elimination is not None:
        return ""
    s, rank = d.singular_values, d.reduced_rank
    if not 0 < rank < s.size:
        return ""
    return f" (singular value {rank} is {s[rank - 1]:.2g}, the next {s[rank]:.2g})"
