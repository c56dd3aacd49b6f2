"""The diagnosis of a sequence in words and as data."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.diagnostics.data import plain
from workbench.diagnostics.report import listed
from workbench.diagnostics.sequences import SequenceDiagnosis
from workbench.diagnostics.wording import Finding, Wording
from workbench.diagnostics.words import counted, sections, table
from workbench.errors import some_of

SCHEMA = "workbench.sequence-diagnosis"
VERSION = 1  # raised when a key is removed or changes its meaning; new keys do not raise it
FEW = 0.1  # of the frames: a shared unknown that at most so many see causes a warning
WORST = 5  # frames of each block that a report lists


def findings(d: SequenceDiagnosis) -> tuple[Finding, ...]:
    """All findings, warnings first."""
    return tuple(sorted(_found(d), key=lambda finding: not finding.warning))


def _found(d: SequenceDiagnosis) -> Iterator[Finding]:
    n, T = d.shape[1], d.count
    if not d.here.finite:
        yield Finding("values", f"not finite: {_not_finite(d)}")
        return
    if d.rank < n:
        yield Finding("rank", f"{n - d.rank} of {n} directions change no residual")
    for i, count in enumerate(d.shared.frames_seen):
        if count == T:
            continue
        text = f"{d.shared.layout.label(i)} is seen in {count} of {T} frames"
        if not count and np.isfinite(d.shared.sigma[i]):
            text += ": only residuals that belong to no single frame determine it"
        yield Finding("shared", text, bool(count <= FEW * T))
    for name, some in d.blind.items():
        if some:
            verb = "sees" if len(some) == 1 else "see"
            text = f"{frames_in_words(some, T)} {verb} nothing of {name}"
            inside = d.largest_sigma[name][list(some)]
            warning = bool(np.isinf(inside).any())
            text += "" if warning else f": there it is determined by {' and '.join(d.between)}"
            yield Finding("frames", text, warning)
    for name, some in d.missing.items():
        text = f"the residual {name} is missing in {frames_in_words(some, T)}"
        yield Finding("frames", text, False)
    if d.problem.bounded or d.problem.constraints:
        text = "bounds and constraints are ignored in a sequence of this size"
        yield Finding("rank", text, False)


def summary(d: SequenceDiagnosis) -> str:
    """Size, rank and null directions."""
    lines = _size(d)
    if not d.here.finite:
        return "\n".join([*lines, *(finding.text for finding in d.findings)])
    lines.append(f"numerical rank {d.rank} of {d.shape[1]}")
    lines += _unseen(d) or ["full rank"]
    lines += [finding.text for finding in d.findings if finding.part != "rank"]
    return "\n".join(lines)


def report(d: SequenceDiagnosis) -> str:
    """Everything in words, section by section."""
    parts: list[tuple[str, Iterable[str]]] = [("findings", listed(d.findings)), ("size", _size(d))]
    if d.here.finite:
        parts += [
            ("rank", _rank(d)),
            ("null directions", _unseen(d)),
            ("shared unknowns", _shared(d)),
            ("frames", _frames(d)),
        ]
    return sections(parts)


def _size(d: SequenceDiagnosis) -> list[str]:
    m, n = d.shape
    shared = d.shared.layout.size if d.here.finite else 0
    each = f"{d.count} frames" + (f", {counted(shared, 'shared unknown')}" if shared else "")
    between = f"frames are coupled by {' and '.join(d.between)}"
    return [f"Jacobian {m} x {n}: {each}", between if d.between else "nothing couples frames"]


def _rank(d: SequenceDiagnosis) -> Iterator[str]:
    columns = f"columns of length 1; tolerance {d.tolerance:.1e}"
    yield f"numerical rank {d.rank} of {d.shape[1]}, {columns}"
    for name, rank in d.shared.ranks.items():
        size = d.shared.layout[name].size
        yield f"{name}: rank {rank} of {size} once all other unknowns are eliminated"


def _unseen(d: SequenceDiagnosis) -> list[str]:
    missing = d.shape[1] - d.rank
    if not missing:
        return []
    title = f"{counted(missing, 'null direction')} (no residual changes along them):"
    return [title, *(f"  {x.described(d.count)}" for x in d.null_directions)]


def _shared(d: SequenceDiagnosis) -> Iterator[str]:
    known = d.shared
    if not known.layout.size:
        return
    yield "a frame sees an unknown if its own unknowns cannot compensate a change of it; it sees it"
    yield f"well if a whole yardstick ({known.yardsticks}) changes the rest by a sigma or more"
    rows = [
        (
            known.layout.label(i),
            f"{known.frames_seen[i]} of {d.count}",
            f"{known.frames_well[i]} of {d.count}",
            f"{known.sigma[i]:.3g}",
            known.layout.unit(i),
        )
        for i in range(known.layout.size)
    ]
    yield from table(("unknown", "frames that see it", "see it well", "sigma", "unit"), rows)


def _frames(d: SequenceDiagnosis) -> Iterator[str]:
    for name, sigma in d.largest_sigma.items():
        unknown = np.flatnonzero(np.isinf(sigma)).tolist()
        if unknown:
            yield f"{name} is not fully identified in {frames_in_words(unknown, d.count)}"
        if order := worst(sigma):
            largest = ", ".join(f"{t} ({sigma[t]:.3g})" for t in order)
            unit = d.free[name].unit
            unit = "no unit" if unit == "1" else unit
            yield f"{name} is least certain in frames {largest}: largest sigma, {unit}"


def worst(sigma: Array) -> list[int]:
    """The frames of the largest finite sigmas, largest first."""
    order = np.argsort(-np.where(np.isfinite(sigma), sigma, 0.0), kind="stable")[:WORST]
    return [int(t) for t in order if np.isfinite(sigma[t]) and sigma[t] > 0]


def frames_in_words(frames: Iterable[int], total: int) -> str:
    """`3 of 40 frames (0 to 1, 7)`."""
    some = list(frames)
    runs: list[list[int]] = []
    for t in some:
        if runs and runs[-1][1] == t - 1:
            runs[-1][1] = t
        else:
            runs.append([t, t])
    named = [str(a) if a == b else f"{a} to {b}" for a, b in runs]
    more = ", ..." if len(named) > WORST else ""
    where = f" ({', '.join(named[:WORST])}{more})" if len(some) < total else ""
    return f"{len(some)} of {total} frames{where}"


def _not_finite(d: SequenceDiagnosis) -> str:
    rows = [d.problem.row_label(int(i)) for i in np.flatnonzero(~np.isfinite(d.here.residual))]
    entries = (f"{d.problem.row_label(i)} by {d.free.label(j)}" for i, j in d.here.not_finite)
    return some_of([*rows, *entries])


def as_data(d: SequenceDiagnosis) -> dict[str, Any]:
    """All parts of a sequence's diagnosis; infinite numbers are null."""
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "version": VERSION,
        "finite": d.here.finite,
        "shape": d.shape,
        "frames": d.count,
        "blocks": [
            {"name": b.name, "shape": b.shape, "unit": b.unit, "shared": not b.base.framed}
            for b in d.free.blocks
        ],
        "residuals": [
            {
                "name": r.name,
                "rows": r.size,
                "unit": r.unit,
                "prior": r.name in d.priors,
                "frames": len({t for t, _ in r.by_frame}),
                "between": r.name in d.between,
            }
            for r in d.problem.residuals
        ],
        "findings": [vars(finding) for finding in d.findings],
    }
    if not d.here.finite:
        return plain(data)  # type: ignore[no-any-return]
    known = d.shared
    data |= {
        "rank": d.rank,
        "tolerance": d.tolerance,
        "null_directions": [
            {
                "name": x.name,
                "joints": x.joints,
                "frames": x.frames,
                "directions": x.count,
                "tied": x.tied,
                "shared": x.shared,
            }
            for x in d.null_directions
        ],
        "shared": [
            {
                "name": known.layout.label(i),
                "unit": known.layout.unit(i),
                "frames_seen": known.frames_seen[i],
                "frames_seen_well": known.frames_well[i],
                "sigma": known.sigma[i],
            }
            for i in range(known.layout.size)
        ],
        "shared_ranks": known.ranks,
        "largest_sigma": d.largest_sigma,
        "blind": {name: some for name, some in d.blind.items() if some},
        "missing": d.missing,
    }
    return plain(data)  # type: ignore[no-any-return]


WORDING = Wording(findings, summary, report, as_data)
