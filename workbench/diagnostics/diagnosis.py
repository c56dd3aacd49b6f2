"""The Jacobian of a fit at one point: its size, what is zero, its rank, and what it cannot see."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Layout
from workbench.diagnostics.null_space import Direction, null_directions
from workbench.problem import Linearization, Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TermBlock:
    """One residual's part of the Jacobian in one block's columns."""

    term: str
    block: str
    rows: int
    columns: int
    nonzeros: int  # structural
    norm: float  # Frobenius, of the whitened Jacobian


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was found; `str` of it is the report."""

    free: Layout
    terms: tuple[TermBlock, ...]
    pattern: NDArray[np.bool_] = field(repr=False)  # (m, n): structurally nonzero
    row_edges: tuple[int, ...]  # where each residual's rows begin, and m
    singular_values: Array = field(repr=False)  # (min(m, n),), falling
    tolerance: float
    rank: int
    structural_rank: int
    null_directions: tuple[Direction, ...]

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n)."""
        return int(self.pattern.shape[0]), int(self.pattern.shape[1])

    @property
    def nonzeros(self) -> int:
        """Structural nonzeros."""
        return int(self.pattern.sum())

    @property
    def density(self) -> float:
        """Nonzeros over entries, 0 to 1."""
        return self.nonzeros / max(1, self.pattern.size)

    @property
    def condition(self) -> float:
        """Largest over smallest singular value; infinite without full column rank."""
        s = self.singular_values
        full = self.rank == self.shape[1] and s.size
        return float(s[0] / s[-1]) if full else float("inf")

    def __str__(self) -> str:
        m, n = self.shape
        lines = [
            f"Jacobian {m} x {n}, {self.nonzeros} nonzeros ({self.density:.1%})",
            f"structural rank {self.structural_rank} of {n}: what the pattern alone allows",
            f"numerical rank {self.rank} of {n}{self._gap()}",
        ]
        if self.rank == n:
            lines.append(f"condition {self.condition:.3g}; every direction is seen")
        else:
            lines.append(f"{len(self.null_directions)} directions that no residual notices:")
            lines += [f"  {line}" for line in self._unseen()]
        return "\n".join(lines)

    def _gap(self) -> str:
        s, rank = self.singular_values, self.rank
        if not 0 < rank < s.size:
            return ""
        return f" (singular values fall from {s[rank - 1]:.2g} to {s[rank]:.2g} there)"

    def _unseen(self) -> list[str]:
        entries = [d.name for d in self.null_directions if d.kind == "entry"]
        others = [d.name for d in self.null_directions if d.kind != "entry"]
        first = [f"{len(entries)} single entries: {', '.join(_gathered(entries))}"]
        return (first if entries else []) + others


def _gathered(entries: list[str]) -> list[str]:
    """`pose[head, x]`, `pose[head, y]` as `pose[head, x y]`."""
    rows: dict[str, list[str]] = {}
    for entry in entries:
        row, comma, last = entry.removesuffix("]").rpartition(", ")
        rows.setdefault(row + comma, []).append(last if comma else entry)
    return [row + " ".join(last) + "]" if row else ", ".join(last) for row, last in rows.items()]


def diagnose(problem: Problem, at: Mapping[str, ArrayLike]) -> Diagnosis:
    """Look at a problem's whitened Jacobian at the values `at`."""
    return diagnose_linearization(problem, problem.linearize(at))


def diagnose_linearization(problem: Problem, here: Linearization) -> Diagnosis:
    """The same, of a linearization that was already made."""
    sparsity = problem.derivative.sparsity_out("J")
    pattern = np.asarray(cs.DM(sparsity, 1.0)) != 0
    J = here.jacobian
    terms = tuple(
        TermBlock(
            term, block, rows.stop - rows.start, columns.stop - columns.start,
            int(pattern[rows, columns].sum()), float(np.linalg.norm(J[rows, columns])),
        )
        for term, rows in problem.rows.items()
        for block, columns in problem.free.slices.items()
    )  # fmt: skip
    return Diagnosis(
        free=problem.free,
        terms=terms,
        pattern=pattern,
        row_edges=(*(rows.start for rows in problem.rows.values()), problem.size),
        singular_values=here.svd[1],
        tolerance=here.tolerance,
        rank=here.rank,
        structural_rank=int(cs.sprank(cs.DM(sparsity, 1.0))),
        null_directions=null_directions(J, problem.free, problem.trees, here.tolerance),
    )
