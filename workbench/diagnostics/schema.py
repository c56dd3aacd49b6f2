"""A diagnosis as plain data for JSON: names instead of indices, numbers that JSON knows."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from workbench.diagnostics.findings import Finding
from workbench.diagnostics.known import Known
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.structure import named_rows
from workbench.diagnostics.suggestion import Suggestion

SCHEMA = "workbench.diagnosis"
VERSION = 1  # raised whenever a key goes or changes its meaning; new keys may come without


def as_data(
    d: Known, findings: Iterable[Finding], suggestions: Iterable[Suggestion]
) -> dict[str, Any]:
    """Everything but pictures; infinite and undefined numbers are null."""
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "version": VERSION,
        "finite": d.here.finite,
        "estimated": d.here.estimated,
        "shape": list(d.shape),
        "nonzeros": d.nonzeros,
        "thick": d.thick if d.here.finite else None,
        "density": d.density,
        "structural_rank": d.structural_rank,
        "blocks": [
            {"name": b.name, "shape": list(b.shape), "unit": b.unit} for b in d.free.blocks
        ],
        "residuals": [
            {"name": r.name, "rows": r.size, "unit": r.unit, "prior": r.name in d.priors}
            for r in d.problem.residuals
        ],
        "terms": [
            {"residual": t.term, "block": t.block, "rows": t.rows, "columns": t.columns,
             "nonzeros": t.nonzeros, "norm": t.norm}
            for t in d.terms
        ],
        "structure": {
            "unread": _labels(d, d.structure.unread),
            "under_determined": {
                "rows": len(d.structure.under.rows),
                "of": named_rows(d.point.rows, d.structure.under.rows),
                "unknowns": _labels(d, d.structure.under.columns),
            },
            "square": len(d.structure.square.columns),
            "over_determined": {
                "rows": len(d.structure.over.rows), "unknowns": len(d.structure.over.columns),
            },
            "duplicates": [list(pair) for pair in d.duplicates],
        },
        "not_finite": {
            "count": len(d.not_finite),
            "first": [
                {"row": d.problem.row_label(i), "column": d.free.label(j) if j >= 0 else None}
                for i, j in d.not_finite[:100]
            ],
        },
        "findings": [
            {"part": f.part, "text": f.text, "warning": f.warning} for f in findings
        ],
        "suggestions": [
            {"what": s.what, "why": s.why, "costs": s.cost, "kind": s.kind,
             "before": vars(s.before), "after": vars(s.after)}
            for s in suggestions
        ],
    }  # fmt: skip
    if d.here.finite:
        data |= _numbers(d)
    return _plain(data)  # type: ignore[no-any-return]


def _numbers(d: Known) -> dict[str, Any]:
    known, check, law = d.identifiability, d.derivatives, d.rank_law
    return {
        "rank": d.rank,
        "held": list(d.point.held.names),
        "tolerance": d.tolerance,
        "condition": d.condition,
        "singular_values": d.singular_values,
        "scaled_rank": d.scaled_rank,
        "ranks_nearby": list(d.nearby.ranks),
        "weaker_here": d.nearby.weaker_here,
        "rank_law": None if law is None else {"rank": law[0], "because": law[1]},
        "null_directions": [_direction(d, x) for x in d.null_directions],
        "weak_directions": [_direction(d, x) for x in d.weak_directions],
        "parallel_columns": [
            {"first": d.free.label(p.first), "second": d.free.label(p.second), "sine": p.apart}
            for p in d.parallel_columns
        ],
        "turns": [vars(turn) for turn in d.turns],
        "weakest": [
            {"singular_value": w.singular_value, "change": w.change,
             "columns": [d.free.label(i) for i in w.columns],
             "rows": [d.problem.row_label(i) for i in w.rows]}
            for w in d.weakest
        ],
        "entries": [
            {"name": d.free.label(i), "unit": d.free.unit(i), "sigma": known.sigma[i],
             "prior_sigma": known.prior_sigma[i], "verdict": known.verdicts[i].name.lower()}
            for i in range(d.free.size)
        ],
        "effective_degrees_of_freedom": known.effective,
        "better_from_data": known.better_from_data,
        "correlations": [
            {"first": d.free.label(a), "second": d.free.label(b), "value": c}
            for a, b, c in known.correlations
        ],
        "contributions": [
            {"residual": c.term, "rank_without": c.rank_without, "rank_with": c.rank_with,
             "sigma_without": c.sigma_without, "sigma_with": c.sigma_with}
            for c in d.contributions
        ],
        "derivatives": {
            "passed": check.passed, "wrong": check.wrong, "largest_error": check.largest_error,
            "slope": check.slope, "gradient_error": check.gradient_error,
            "hessian_error": check.hessian_error, "neglected": check.neglected,
            "suspects": [
                {"row": d.problem.row_label(s.row), "column": d.free.label(s.column),
                 "given": s.given, "differences": s.differences}
                for s in check.suspects
            ],
        },
    }  # fmt: skip


def _direction(d: Known, x: Direction) -> dict[str, Any]:
    entries = {d.free.label(int(i)): x.vector[i] for i in np.flatnonzero(x.vector)}
    return {"name": x.name, "kind": x.kind, "change": x.change, "entries": entries}


def _labels(d: Known, columns: np.ndarray) -> list[str]:
    return [d.free.label(int(i)) for i in columns]


def _plain(value: Any) -> Any:
    """Only what JSON knows."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
