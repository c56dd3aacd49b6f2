"""A diagnosis as plain data for JSON: names instead of indices, numbers that JSON knows."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.words import named_rows

if TYPE_CHECKING:
    from workbench.diagnostics.diagnosis import Diagnosis

SCHEMA = "workbench.diagnosis"
VERSION = 3  # raised when a key is removed or changes its meaning; new keys do not raise it
CHECKED = ("passed", "wrong", "largest_error", "slope", "gradient_error", "neglected")


def as_data(d: "Diagnosis") -> dict[str, Any]:
    """All parts of a diagnosis; infinite and undefined numbers are null.

    There are no singular values of a sparse Jacobian, which is factorized.
    """
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "version": VERSION,
        "finite": d.here.finite,
        "estimated": d.here.estimated,
        "shape": d.shape,
        "nonzeros": d.nonzeros,
        "density": d.density,
        "structural_rank": d.structural_rank,
        "blocks": [{"name": b.name, "shape": b.shape, "unit": b.unit} for b in d.free.blocks],
        "residuals": [
            {"name": r.name, "rows": r.size, "unit": r.unit, "prior": r.name in d.priors}
            for r in d.problem.residuals
        ],
        "terms": [vars(term) for term in d.terms],
        "structure": {
            "unread": d.free.labels_of(d.structure.unread),
            "under_determined": {
                "rows": len(d.structure.under.rows),
                "of": named_rows(d.rows, d.structure.under.rows),
                "unknowns": d.free.labels_of(d.structure.under.columns),
            },
            "square": len(d.structure.square.columns),
            "over_determined": {
                "rows": len(d.structure.over.rows),
                "unknowns": len(d.structure.over.columns),
            },
            "duplicates": d.duplicates,
        },
        "not_finite": {
            "count": len(d.not_finite),
            "first": [
                {"row": d.problem.row_label(i), "column": d.free.label(j) if j >= 0 else None}
                for i, j in d.not_finite[:100]
            ],
        },
        "findings": [vars(finding) for finding in d.findings],
        "suggestions": [
            {
                "what": s.what,
                "why": s.why,
                "costs": s.cost,
                "kind": s.kind,
                "before": vars(s.before),
                "after": vars(s.after),
            }
            for s in d.suggestions
        ],
    }
    if d.here.finite:
        data |= _numbers(d)
    return plain(data)  # type: ignore[no-any-return]


def _numbers(d: "Diagnosis") -> dict[str, Any]:
    known, check, law = d.identifiability, d.derivatives, d.rank_law
    return {
        "rank": d.rank,
        "held": d.active.names,
        "tolerance": d.tolerance,
        "condition": d.condition,
        "singular_values": [] if d.sparse is not None else d.singular_values,
        "weak_count": d.weak_count,
        "ranks_nearby": d.ranks_nearby,
        "rank_law": None if law is None else {"rank": law[0], "because": law[1]},
        "null_directions": [_direction(d, x) for x in d.null_directions],
        "weak_directions": [_direction(d, x) for x in d.weak_directions],
        "parallel_columns": [
            {"first": d.free.label(p.first), "second": d.free.label(p.second), "sine": p.sine}
            for p in d.parallel_columns
        ],
        "weakest": [
            {
                "change": w.change,
                "columns": d.free.labels_of(w.columns),
                "rows": [d.problem.row_label(i) for i in w.rows],
            }
            for w in d.weakest
        ],
        "entries": [
            {
                "name": d.free.label(i),
                "unit": d.free.unit(i),
                "sigma": known.sigma[i],
                "prior_sigma": known.prior_sigma[i],
                "verdict": known.verdicts[i].name.lower(),
            }
            for i in range(d.free.size)
        ],
        "effective_degrees_of_freedom": known.effective,
        "better_from_data": known.better_from_data,
        "correlations": [
            {"first": d.free.label(a), "second": d.free.label(b), "value": c}
            for a, b, c in known.correlations
        ],
        "contributions": [vars(c) for c in d.contributions],
        "derivatives": {
            **{key: getattr(check, key) for key in CHECKED},
            "suspects": [
                {
                    "row": d.problem.row_label(s.row),
                    "column": d.free.label(s.column),
                    "given": s.given,
                    "differences": s.differences,
                }
                for s in check.suspects
            ],
        },
    }


def _direction(d: "Diagnosis", x: Direction) -> dict[str, Any]:
    entries = {d.free.label(int(i)): x.vector[i] for i in np.flatnonzero(x.vector)}
    return {"name": x.name, "kind": x.kind, "change": x.change, "entries": entries}


def plain(value: Any) -> Any:
    """A value as numbers, texts, lists and dicts; numbers that are not finite become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
