"""What deserves a sentence: warnings, which make a fit's answer arbitrary, and remarks."""

from dataclasses import dataclass

import numpy as np

from workbench.diagnostics.conditioning import PARALLEL
from workbench.diagnostics.known import Known
from workbench.diagnostics.null_space import dominant
from workbench.diagnostics.structure import counted, named_groups

ILL = 1e8  # condition of J from which half of the digits are gone
UNEVEN = 1e6  # longest over shortest column
FLAT = 0.3  # second best turn of a joint over its best: below, it is seen from one side only
MOSTLY = 0.75  # of the joints: then it is the view, not the pose of one limb
FELT = 0.05  # of the best turn of all: joints that turn less are left out of that
WEAKER = 30.0  # times, than nearby: near a point where the rank falls
ALONE = 0.999  # leverage of a row that alone decides something


@dataclass(frozen=True)
class Finding:
    """One sentence; `part` says where more is to be read."""

    part: str
    text: str
    warning: bool


def findings(d: Known) -> tuple[Finding, ...]:
    """All of them, warnings first."""
    found = [*_values(d)]
    if d.here.finite:
        found += [*_structure(d), *_rank(d), *_conditioning(d), *_priors(d)]
        found += _derivatives(d)
    return tuple(sorted(found, key=lambda finding: not finding.warning))


def _values(d: Known) -> list[Finding]:
    if d.here.finite:
        return []
    found = []
    for what, here in (
        ("the residual", [row for row, column in d.not_finite if column < 0]),
        ("the Jacobian", [entry for entry in d.not_finite if entry[1] >= 0]),
    ):
        names = [
            d.problem.row_label(entry) if isinstance(entry, int)
            else f"{d.problem.row_label(entry[0])} by {d.free.label(entry[1])}"
            for entry in here[:5]
        ]  # fmt: skip
        more = f" and {len(here) - 5} more" if len(here) > 5 else ""
        if here:
            found.append(Finding("values", f"{what} is not finite: {', '.join(names)}{more}", True))
    return found


def _structure(d: Known) -> list[Finding]:
    found = []
    if d.structure.unread.size:
        found.append(Finding("structure", unread(d), True))
    under = np.setdiff1d(d.structure.under.columns, d.structure.unread)
    if under.size:
        text = (
            f"{len(d.structure.under.rows)} rows have to decide {under.size} unknowns: "
            f"{named_groups(d.free, under)}"
        )
        found.append(Finding("structure", text, True))
    for name, rows in d.problem.rows.items():
        idle = np.sum((d.structure.idle >= rows.start) & (d.structure.idle < rows.stop))
        if idle == rows.stop - rows.start > 0:
            text = f"the residual {name} reads nothing that is free: it cannot change"
            found.append(Finding("structure", text, True))
    for first, second in d.duplicates:
        text = f"{second} says row for row what {first} says: it is counted twice"
        found.append(Finding("structure", text, True))
    return found


def _rank(d: Known) -> list[Finding]:
    n = d.shape[1]
    found = []
    if d.rank < n:
        text = f"no residual notices {n - d.rank} of {n} directions"
        text += f" and no {_one(d)} forbids them" if d.point.held.any else ""
        found.append(Finding("rank", text, True))
    if d.point.held.any:
        found.append(Finding("rank", held(d), False))
    if d.nearby.ranks and max(d.nearby.ranks) > d.rank:
        there = max(d.nearby.ranks)
        text = f"the rank is {d.rank} only here; a tenth of a yardstick away it is {there}"
        found.append(Finding("rank", text, True))
    weaker = d.nearby.weaker_here
    if weaker > WEAKER:
        which = dominant(d.weakest[0].vector, d.free)
        text = (
            f"nearly degenerate here: the weakest direction that is seen is {weaker:.0f} times "
            f"weaker than a tenth of a yardstick away: {which}"
        )
        found.append(Finding("rank", text, False))
    found += _depth(d)
    if d.hardly_seen:
        text = (
            f"{counted(d.hardly_seen, 'direction')} hardly noticed: less than one sigma for a "
            f"whole yardstick ({d.point.yardsticks})"
        )
        found.append(Finding("rank", text, False))
    return found


def unread(d: Known) -> str:
    """The unknowns that nothing reads, in a sentence."""
    who = f"residual and no {_one(d)} that holds" if d.point.held.any else "residual"
    return f"read by no {who}: {named_groups(d.free, d.structure.unread)}"


def _one(d: Known) -> str:
    """`bound`, `constraint`, or `bound or constraint`."""
    return " or ".join(word.removesuffix("s") for word in d.point.held.what.split(" and "))


def held(d: Known) -> str:
    """What bounds and constraints add to the rank, in a sentence."""
    names, count, what = d.point.held.names, d.point.tied.count, d.point.held.what
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return (
        f"{counted(count, 'direction')} {'is' if count == 1 else 'are'} fixed by {what} that "
        f"are active here ({', '.join(names[:5])}{more}) and "
        f"{'counts' if count == 1 else 'count'} as noticed"
    )


def _depth(d: Known) -> list[Finding]:
    """A body that lies flat across the view of one camera shows one turn of each bone only."""
    felt = FELT * max((turn.best for turn in d.turns), default=0.0)
    seen = [turn for turn in d.turns if turn.best > felt]
    flat = [turn.joint for turn in seen if turn.second < FLAT * turn.best]
    if len(seen) < 3 or len(flat) < MOSTLY * len(seen):
        return []
    text = (
        f"nearly degenerate in depth: {len(flat)} of {len(seen)} joints ({', '.join(flat[:3])}, "
        f"...) show a turn about one axis well and about the next less than {FLAT:g} as well, as "
        "where a body lies flat across the view of one camera: what bends towards it or away "
        "hardly shows"
    )
    return [Finding("rank", text, False)]


def _conditioning(d: Known) -> list[Finding]:
    found = []
    if ILL < d.condition < np.inf:
        text = f"the condition is {d.condition:.1e}: half of the digits and more are lost"
        found.append(Finding("conditioning", text, True))
    norms = d.here.column_norms[d.here.column_norms > 0]
    if norms.size and norms.max() > UNEVEN * norms.min():
        text = f"the columns differ in length by a factor of {norms.max() / norms.min():.1e}"
        found.append(Finding("conditioning", text, False))
    same = [p for p in d.parallel_columns if p.apart <= PARALLEL]
    if same:
        pairs = ", ".join(f"{d.free.label(p.first)} and {d.free.label(p.second)}" for p in same[:3])
        text = f"{counted(len(same), 'pair')} of unknowns that do the same: {pairs}"
        found.append(Finding("conditioning", text, True))
    if d.leverage is not None:
        alone = np.flatnonzero(d.leverage > ALONE)
        data = [int(i) for i in alone if not _is_prior(d, int(i))]
        if data:
            named = ", ".join(d.problem.row_label(i) for i in data[:3])
            text = (
                f"{counted(len(data), 'row')} that alone decide a direction, so that no outlier "
                f"shows: {named}"
            )
            found.append(Finding("conditioning", text, False))
    return found


def _priors(d: Known) -> list[Finding]:
    if not d.priors:
        return []
    known = d.identifiability
    text = (
        f"the data decide {known.effective:.1f} of {d.shape[1]} directions, the priors the rest; "
        f"{known.better_from_data} are better known from the data than from the priors"
    )
    return [Finding("identifiability", text, False)]


def _is_prior(d: Known, row: int) -> bool:
    return any(d.problem.rows[name].start <= row < d.problem.rows[name].stop for name in d.priors)


def _derivatives(d: Known) -> list[Finding]:
    check = d.derivatives
    found = []
    if check.wrong:
        worst = check.suspects[0]
        text = (
            f"{check.wrong} of the Jacobian's entries not as differences say; the worst is "
            f"{d.problem.row_label(worst.row)} by {d.free.label(worst.column)}: given "
            f"{worst.given:.6g}, differences {worst.differences:.6g}"
        )
        found.append(Finding("derivatives", text, True))
    if check.slope is not None and check.slope < 1.5:
        text = f"the linear model errs like h^{check.slope:.1f}, not like h^2"
        found.append(Finding("derivatives", text, True))
    if check.gradient_error >= 1e-8:
        text = f"the gradient is not J'r: they differ by {check.gradient_error:.1e}"
        found.append(Finding("derivatives", text, True))
    if check.hessian_error is not None and check.hessian_error >= 1e-4:
        text = f"the exact Hessian is {check.hessian_error:.1e} off differences of the gradient"
        found.append(Finding("derivatives", text, True))
    return found
