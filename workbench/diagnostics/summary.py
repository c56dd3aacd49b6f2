"""A diagnosis in a few lines: size, rank, and the names of the null directions."""

from workbench.diagnostics.findings import findings, held
from workbench.diagnostics.results import DiagnosisResults
from workbench.diagnostics.structure import counted, gathered


def summary(d: DiagnosisResults) -> str:
    """Size, rank, and the names of the null directions."""
    m, n = d.shape
    lines = [
        f"Jacobian {m} x {n}, {d.nonzeros} nonzeros ({d.density:.1%})",
        f"structural rank {d.structural_rank} of {n}, the largest that the sparsity pattern allows",
    ]
    if not d.here.finite:
        return "\n".join([*lines, *(finding.text for finding in findings(d))])
    lines.append(f"numerical rank {d.rank} of {n}{gap(d)}")
    if d.point.active.any:
        lines.append(held(d))
    if d.rank == n:
        lines.append(f"full rank, condition {d.condition:.3g}")
    else:
        lines.append(
            f"{counted(len(d.null_directions), 'null direction')} (no residual changes along them):"
        )
        lines += [f"  {line}" for line in unseen(d)]
    if d.weak_count:
        lines.append(
            f"{counted(d.weak_count, 'weak direction')} (a whole yardstick changes the residuals "
            f"by less than one sigma; a yardstick is {d.point.yardsticks})"
        )
    return "\n".join(lines)


def unseen(d: DiagnosisResults) -> list[str]:
    """The names of the null directions, with all single entries in one line."""
    entries = [x.name for x in d.null_directions if x.kind == "entry"]
    others = [x.name for x in d.null_directions if x.kind != "entry"]
    noun = "single entry" if len(entries) == 1 else "single entries"
    first = [f"{len(entries)} {noun}: {', '.join(gathered(entries))}"]
    return (first if entries else []) + others


def gap(d: DiagnosisResults) -> str:
    """Between which singular values the tolerance lies; empty for a rank of zero or full rank."""
    s, rank = d.singular_values, d.reduced_rank
    if not 0 < rank < s.size:
        return ""
    return f" (singular value {rank} is {s[rank - 1]:.2g}, the next {s[rank]:.2g})"
