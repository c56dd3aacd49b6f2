"""The diagnosis of a sequence in words and as data."""

from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Layout
from workbench.diagnostics.findings import Finding, listed, some_of
from workbench.diagnostics.schema import plain
from workbench.diagnostics.sequence_names import NullDirections
from workbench.diagnostics.shared_unknowns import SharedUnknowns
from workbench.diagnostics.structure import counted
from workbench.diagnostics.tables import sections, table
from workbench.problem import Linearization, Problem

SCHEMA = "workbench.sequence-diagnosis"
VERSION = 1  # raised whenever a key goes or changes its meaning; new keys may come without
FEW = 0.1  # of the frames: a shared unknown that no more of them see deserves a warning
WORST = 5  # frames of each block that a report lists


class SequenceResults(Protocol):
    """The numbers of the diagnosis of a sequence; what each means is said at SequenceDiagnosis."""

    # ruff: noqa: D102

    @property
    def problem(self) -> Problem: ...
    @property
    def here(self) -> Linearization: ...
    @property
    def priors(self) -> tuple[str, ...]: ...
    @property
    def free(self) -> Layout: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def count(self) -> int: ...
    @property
    def tolerance(self) -> float: ...
    @property
    def rank(self) -> int: ...
    @property
    def null_directions(self) -> tuple[NullDirections, ...]: ...
    @property
    def shared(self) -> SharedUnknowns: ...
    @property
    def largest_sigma(self) -> dict[str, Array]: ...
    @property
    def blind(self) -> dict[str, tuple[int, ...]]: ...
    @property
    def missing(self) -> dict[str, tuple[int, ...]]: ...
    @property
    def between(self) -> tuple[str, ...]: ...
    @property
    def findings(self) -> tuple[Finding, ...]: ...


def findings(d: SequenceResults) -> tuple[Finding, ...]:
    """What deserves a sentence, warnings first."""
    found = []
    n, T = d.shape[1], d.count
    if not d.here.finite:
        return (Finding("values", f"not finite: {_not_finite(d)}", True),)
    if d.rank < n:
        found.append(Finding("rank", f"{n - d.rank} of {n} directions change no residual", True))
    for i, count in enumerate(d.shared.frames_seen):
        if count == T:
            continue
        told = np.isfinite(d.shared.sigma[i])
        text = f"{d.shared.layout.label(i)} is seen in {count} of {T} frames"
        if not count and told:
            text += ": only residuals that belong to no single frame determine it"
        found.append(Finding("shared", text, bool(count <= FEW * T)))
    for name, some in d.blind.items():
        if some:
            text = (
                f"{frames_in_words(some, T)} see{'s' if len(some) == 1 else ''} nothing of {name}"
            )
            inside = d.largest_sigma[name][list(some)]
            warning = bool(np.isinf(inside).any())
            text += "" if warning else f": there it is determined by {' and '.join(d.between)}"
            found.append(Finding("frames", text, warning))
    for name, some in d.missing.items():
        found.append(
            Finding(
                "frames", f"the residual {name} is missing in {frames_in_words(some, T)}", False
            )
        )
    if d.problem.bounded or d.problem.constraints:
        text = "bounds and constraints are ignored in a sequence of this size"
        found.append(Finding("rank", text, False))
    return tuple(sorted(found, key=lambda finding: not finding.warning))


def summary(d: SequenceResults) -> str:
    """Size, rank, and what is not seen."""
    n = d.shape[1]
    lines = _size(d)
    if not d.here.finite:
        return "\n".join([*lines, *(finding.text for finding in d.findings)])
    lines.append(f"numerical rank {d.rank} of {n}")
    lines += _unseen(d) if d.rank < n else ["full rank"]
    lines += [finding.text for finding in d.findings if finding.part != "rank"]
    return "\n".join(lines)


def report(d: SequenceResults) -> str:
    """Everything in words, section by section."""
    parts = [("findings", listed(d.findings)), ("size", _size(d))]
    if d.here.finite:
        parts += [
            ("rank", _rank(d)),
            ("null directions", _unseen(d) if d.rank < d.shape[1] else []),
            ("shared unknowns", _shared(d)),
            ("frames", _frames(d)),
        ]
    return sections(parts)


def _size(d: SequenceResults) -> list[str]:
    m, n = d.shape
    shared = d.shared.layout.size if d.here.finite else 0
    each = f"{d.count} frames" + (f", {counted(shared, 'shared unknown')}" if shared else "")
    between = f"frames are coupled by {' and '.join(d.between)}"
    return [f"Jacobian {m} x {n}: {each}", between if d.between else "nothing couples frames"]


def _rank(d: SequenceResults) -> list[str]:
    n = d.shape[1]
    lines = [f"numerical rank {d.rank} of {n}, columns of length 1; tolerance {d.tolerance:.1e}"]
    for name, rank in d.shared.ranks.items():
        size = d.shared.layout[name].size
        lines.append(f"{name}: rank {rank} of {size} once all other unknowns are eliminated")
    return lines


def _unseen(d: SequenceResults) -> list[str]:
    lines = [f"{counted(d.shape[1] - d.rank, 'null direction')} (no residual changes along them):"]
    return [*lines, *(f"  {x.said(d.count)}" for x in d.null_directions)]


def _shared(d: SequenceResults) -> list[str]:
    known = d.shared
    if not known.layout.size:
        return []
    return [
        "a frame sees an unknown if its own unknowns cannot compensate a change of it, and sees it",
        f"well if a whole yardstick ({known.yardsticks}) changes the rest by a sigma or more",
        *table(
            ("unknown", "frames that see it", "see it well", "sigma", "unit"),
            [
                (
                    known.layout.label(i),
                    f"{known.frames_seen[i]} of {d.count}",
                    f"{known.frames_well[i]} of {d.count}",
                    f"{known.sigma[i]:.3g}",
                    known.layout.unit(i),
                )
                for i in range(known.layout.size)
            ],
        ),
    ]


def _frames(d: SequenceResults) -> list[str]:
    lines = []
    for name, sigma in d.largest_sigma.items():
        unknown = np.flatnonzero(np.isinf(sigma))
        if unknown.size:
            lines.append(
                f"{name} is not fully identified in {frames_in_words(unknown.tolist(), d.count)}"
            )
        order = worst(sigma)
        if order:
            told = ", ".join(f"{t} ({sigma[t]:.3g})" for t in order)
            lines.append(
                f"{name} is least certain in frames {told}: largest sigma, {_unit(d, name)}"
            )
    return lines


def worst(sigma: Array) -> list[int]:
    """The frames of the largest finite sigmas, largest first."""
    order = np.argsort(-np.where(np.isfinite(sigma), sigma, 0.0), kind="stable")[:WORST]
    return [int(t) for t in order if np.isfinite(sigma[t]) and sigma[t] > 0]


def _unit(d: SequenceResults, name: str) -> str:
    unit = d.free[name].unit
    return "no unit" if unit == "1" else unit


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


def _not_finite(d: SequenceResults) -> str:
    rows = [d.problem.row_label(int(i)) for i in np.flatnonzero(~np.isfinite(d.here.residual))]
    entries = (f"{d.problem.row_label(i)} by {d.free.label(j)}" for i, j in d.here.not_finite)
    return some_of([*rows, *entries])


def as_data(d: SequenceResults) -> dict[str, Any]:
    """Everything; infinite numbers are null."""
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
                "frames": len({t for t, _ in r.each}),
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
