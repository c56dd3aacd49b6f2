"""A diagnosis in a few lines: size, rank, and the names of the null directions."""

from collections.abc import Iterator, Sequence

from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.findings import held
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.structure import counted, gathered


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
        yield f"{count} (no residual changes along them):"
        yield from (f"  {line}" for line in names_of(d.null_directions))
    if d.weak_count:
        yield (
            f"{counted(d.weak_count, 'weak direction')} (a whole yardstick changes the residuals "
            f"by less than one sigma; a yardstick is {d.point.yardsticks})"
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
    if d.point.constrained.eliminated is not None:
        return ""
    s, rank = d.singular_values, d.reduced_rank
    if not 0 < rank < s.size:
        return ""
    return f" (singular value {rank} is {s[rank - 1]:.2g}, the next {s[rank]:.2g})"
