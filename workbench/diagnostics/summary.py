"""A diagnosis in a few lines: size, rank, and the names of what is not seen."""

from workbench.diagnostics.findings import findings, held
from workbench.diagnostics.known import Known
from workbench.diagnostics.structure import counted, gathered


def summary(d: Known) -> str:
    """Size, rank, and the names of what is not seen."""
    m, n = d.shape
    lines = [
        f"Jacobian {m} x {n}, {d.nonzeros} nonzeros ({d.density:.1%})",
        f"structural rank {d.structural_rank} of {n}: what the pattern alone allows",
    ]
    if not d.here.finite:
        return "\n".join([*lines, *(finding.text for finding in findings(d))])
    lines.append(f"numerical rank {d.rank} of {n}{gap(d)}")
    if d.point.held.any:
        lines.append(held(d))
    if d.rank == n:
        lines.append(f"condition {d.condition:.3g}; every direction is seen")
    else:
        lines.append(f"{counted(len(d.null_directions), 'direction')} that no residual notices:")
        lines += [f"  {line}" for line in unseen(d)]
    if d.hardly_seen:
        lines.append(
            f"{counted(d.hardly_seen, 'direction')} hardly noticed (less than one sigma for a "
            f"whole yardstick: {d.point.yardsticks})"
        )
    return "\n".join(lines)


def unseen(d: Known) -> list[str]:
    """The null directions, single entries gathered in one line."""
    entries = [x.name for x in d.null_directions if x.kind == "entry"]
    others = [x.name for x in d.null_directions if x.kind != "entry"]
    noun = "single entry" if len(entries) == 1 else "single entries"
    first = [f"{len(entries)} {noun}: {', '.join(gathered(entries))}"]
    return (first if entries else []) + others


def gap(d: Known) -> str:
    """Between which singular values the rank is cut off; empty at a rank of nothing or of all."""
    s, rank = d.singular_values, d.noticed
    if not 0 < rank < s.size:
        return ""
    return f" (singular values fall from {s[rank - 1]:.2g} to {s[rank]:.2g} there)"
