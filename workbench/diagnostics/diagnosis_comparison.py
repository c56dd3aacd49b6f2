"""Two diagnoses side by side: two problems, or one problem at two points."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.report import names_of
from workbench.diagnostics.words import counted, table

CHANGED_FACTOR = 1.5  # by which a sigma has to change to be listed


@dataclass(frozen=True, eq=False)
class DiagnosisComparison:
    """Two diagnoses side by side, compared in the unknowns that have the same names in both.

    Attributes:
        first: one diagnosis.
        second: the other.
    """

    first: Diagnosis
    second: Diagnosis

    @cached_property
    def gained(self) -> tuple[Direction, ...]:
        """Null directions of the first along which the second changes (above its tolerance)."""
        return _seen_by(self.second, self.first)

    @cached_property
    def lost(self) -> tuple[Direction, ...]:
        """Null directions of the second along which the first changes (above its tolerance)."""
        return _seen_by(self.first, self.second)

    @cached_property
    def sigmas(self) -> tuple[tuple[str, float, float], ...]:
        """Entries of both with their two sigmas, the most changed first."""
        a, b = (_sigmas(d) for d in (self.first, self.second))
        pairs = [(name, a[name], b[name]) for name in a if name in b]
        return tuple(sorted(pairs, key=lambda p: -_factor(p[1], p[2])))

    def report(self) -> str:
        """The comparison in words."""
        sides = [_figures(d) for d in (self.first, self.second)]
        lines = table(
            ("", "first", "second"), [(k, *(side[k] for side in sides)) for k in sides[0]]
        )
        for which, directions in (("second", self.gained), ("first", self.lost)):
            if directions:
                count = counted(len(directions), "direction")
                lines += ["", f"{count} determined by the {which} only:"]
                lines += [f"  {name}" for name in names_of(directions)]
        changed = [p for p in self.sigmas if _factor(p[1], p[2]) > CHANGED_FACTOR][:12]
        if changed:
            rows = [(name, f"{x:.3g}", f"{y:.3g}") for name, x, y in changed]
            lines += ["", "sigmas that change most", *table(("unknown", "first", "second"), rows)]
        return "\n".join(lines)

    def data(self) -> dict[str, Any]:
        """For JSON: both diagnoses, and the names of what was gained and lost."""
        return {
            "schema": "workbench.comparison_of_diagnoses",
            "version": 1,
            "first": self.first.data(),
            "second": self.second.data(),
            "gained": [x.name for x in self.gained],
            "lost": [x.name for x in self.lost],
        }


def _figures(d: Diagnosis) -> dict[str, str]:
    """The numbers to compare; `-` where the Jacobian is not finite."""
    m, n = d.shape
    figures = {"rows": str(m), "unknowns": str(n), "structural rank": str(d.structural_rank)}
    finite = ("rank", "null directions", "weak directions", "condition", "determined by data")
    figures |= dict.fromkeys(finite, "-")
    if d.here.finite:
        numbers = (d.rank, n - d.rank, d.weak_count)
        decided = (f"{d.condition:.3g}", f"{d.identifiability.effective:.1f}")
        figures |= zip(finite, (*map(str, numbers), *decided), strict=True)
    return figures | {"warnings": str(len(d.warnings))}


def _seen_by(observer: Diagnosis, other: Diagnosis) -> tuple[Direction, ...]:
    """Null directions of `other` that change residuals of the observer, in unknowns that it has."""
    if not (observer.here.finite and other.here.finite):
        return ()
    places = {observer.free.label(i): i for i in range(observer.free.size)}
    constrained = observer.constrained  # what a constraint forbids is seen as well
    seen: list[Direction] = []
    for direction in other.null_directions:
        entries = np.flatnonzero(direction.vector)
        labels = other.free.labels_of(entries)
        if places.keys() >= set(labels):
            v = np.zeros(observer.free.size)
            v[[places[label] for label in labels]] = direction.vector[entries]
            if np.linalg.norm(constrained.stacked.along(v)) > 1e3 * constrained.tolerance:
                seen.append(direction)
    return tuple(seen)


def _sigmas(d: Diagnosis) -> dict[str, float]:
    if not d.here.finite:
        return {}
    return {d.free.label(i): float(s) for i, s in enumerate(d.identifiability.sigma)}


def _factor(a: float, b: float) -> float:
    if not (np.isfinite(a) and np.isfinite(b)):
        return float("inf") if np.isfinite(a) != np.isfinite(b) else 1.0
    return max(a, b) / max(min(a, b), 1e-300)
